"""Data flows one way: a module imports only from rows above its own, and nothing heavy at import."""

import ast
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import voxkernel

PACKAGE = Path(voxkernel.__file__).parent
# The rows of the design, top to bottom.
# A private module (`_name`) has no row: what it imports counts as imported by whoever imports it.
ROWS = (
    "errors", "_checks", "_core",
    "mesh", "mesh_input", "repair",
    "halfspaces",
    "convexity", "predicates", "feasibility", "domain", "certificate", "polytope",
    "grid", "grid_export", "violation", "octree", "vdb",
    "visibility", "measures", "moments", "points", "polyhedral",
    "registration", "registration_batch", "spherical", "demo_shapes", "pictures",
    "evaluate", "report",
    "cli",
)  # fmt: skip
HEAVY = {
    "open3d", "pymeshlab", "plotly", "pyvista", "vtk", "vtkmodules", "trimesh", "meshio", "pyarrow", "pandas",
    "dask", "distributed", "fsspec", "jinja2", "rich", "PIL", "matplotlib", "scipy", "libusb_package", "asyncio",
}  # fmt: skip
ONLY_IN = {"open3d": "_open3d"}


def modules():
    names = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        names[".".join(p for p in parts if p != "__init__")] = file
    return names


MODULES = modules()


def _imports(tree, at_import_only=False):
    """Absolute dotted names a module imports; `from a import b` gives a.b."""
    found = []
    stack = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) and at_import_only:
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            stack.extend(node.orelse)
            continue
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "relative import"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
        stack.extend(ast.iter_child_nodes(node))
    return found


@cache
def tree_of(name):
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


def row_name(name):
    """`cli.main` belongs to the row `cli`."""
    return name.split(".")[0]


@cache
def own_modules(name):
    """Modules of this package that a module imports, anywhere in its text."""
    found = set()
    for dotted in _imports(tree_of(name)):
        if not dotted.startswith("voxkernel"):
            continue
        local = dotted.removeprefix("voxkernel").removeprefix(".")
        while local and local not in MODULES:
            local = local.rpartition(".")[0]
        if local:
            found.add(local)
    return frozenset(found)


def reached_rows(name, seen=()):
    """Rows reached, looking through private modules without a row."""
    for other in own_modules(name):
        if row_name(other) in ROWS:
            yield row_name(other), (*seen, other)
        elif other not in seen:
            yield from reached_rows(other, (*seen, other))


def test_every_public_module_has_a_row():
    public = {row_name(name) for name in MODULES if name and not name.startswith("_")}
    assert public <= set(ROWS), f"give these modules a row: {sorted(public - set(ROWS))}"


@pytest.mark.parametrize("name", [n for n in MODULES if n and row_name(n) in ROWS])
def test_imports_come_from_rows_above(name):
    own = ROWS.index(row_name(name))
    is_package = "." in name or name == "cli"  # modules of one folder may import each other
    wrong = [
        " -> ".join((name, *way))
        for row, way in reached_rows(name)
        if ROWS.index(row) > own or (ROWS.index(row) == own and not is_package)
    ]
    assert not wrong, f"imports from its own row or below: {wrong}"


@pytest.mark.parametrize("name", list(MODULES))
def test_nothing_heavy_at_import(name):
    heavy = {dotted.split(".")[0] for dotted in _imports(tree_of(name), at_import_only=True)} & HEAVY
    assert not heavy, f"import these inside the function that needs them: {sorted(heavy)}"


@pytest.mark.parametrize(("package", "home"), ONLY_IN.items())
def test_imported_in_one_file(package, home):
    users = {name for name in MODULES for dotted in _imports(tree_of(name)) if dotted.split(".")[0] == package}
    assert users <= {home}


def test_import_loads_nothing_heavy():
    # A fresh interpreter: what is really loaded, whoever asked for it.
    code = f"import sys, voxkernel; print(sorted({{m.split('.')[0] for m in sys.modules}} & {HEAVY!r}))"
    env = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert done.stdout.strip() == "[]"
