"""The house: a folder imports only from those above it, its face is short, and nothing heavy is imported at import."""

import ast
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import voxkernel
from voxkernel._extras import EXTRAS

PACKAGE = Path(voxkernel.__file__).parent
# Top to bottom: a row imports from rows above it, and one that has words beside it from those and the ground only.
GROUND = (
    "_version", "errors", "_core", "_core_check", "_extras", "_threads", "_checks", "_notebook", "_thumbnail",
    "_frozen", "_plain", "_input_file", "_output_file", "_npz", "_open3d", "_vtk_arrays", "_vtk_xml", "_viewing",
    "_dask_client", "_palette", "_sizes", "_file_lock", "_scratch_folder", "_fork_server",
)  # fmt: skip
FOLDERS = {
    "mesh": None,
    "halfspaces": None,
    "large": None,
    "exact": None,
    "relaxed": None,
    "grid": "",
    "vdb": "grid",
    "voxels": None,
    "guarding": None,
    "measures": None,
    "spherical": None,
    "registration": None,
    "polyhedral": None,
    "labels": None,
    "pictures": None,
    "view": None,
    "run_table": "",
    "run_index": "run_table",
    "evaluation": None,
    "report": "run_table run_index",
    "demo_shapes": "mesh",
    "cli": None,
}
ROWS = (*GROUND, *FOLDERS)
MOST_LINES = 500

HEAVY = {
    "open3d", "pymeshlab", "plotly", "pyvista", "vtk", "vtkmodules", "trimesh", "meshio", "pyarrow", "pandas",
    "dask", "distributed", "fsspec", "jinja2", "rich", "PIL", "matplotlib", "scipy", "libusb_package", "asyncio",
    "tifffile", "nibabel", "nrrd", "h5py", "zarr",
    "trame", "trame_vtk", "aiohttp",
}  # fmt: skip
# Packages of extras are imported by `optional`; the child of `mesh` that reads files by PyMeshLab knows nothing of it.
MAY_IMPORT = {"mesh.meshlab_child": {"pymeshlab"}}


def modules():
    names = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        names[".".join(p for p in parts if p != "__init__")] = file
    return {name: file for name, file in names.items() if not name.startswith("_core.")}


MODULES = modules()
FACES = [name for name in FOLDERS if (PACKAGE / name / "__init__.py").exists()]


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


def row_of(name):
    """`cli.main` belongs to the row `cli`."""
    return name.split(".")[0]


@cache
def offered(face):
    """What a face imports: name -> module; of `mesh`, `repair` is a function though a file is called so."""
    nodes = [n for n in tree_of(face).body if isinstance(n, ast.ImportFrom)]
    return {alias.asname or alias.name: n.module.removeprefix("voxkernel.") for n in nodes for alias in n.names}


@cache
def own_modules(name):
    """Modules of this package that a module imports, anywhere in its text."""
    found = set()
    for dotted in _imports(tree_of(name)):
        if not dotted.startswith("voxkernel."):
            continue
        local = dotted.removeprefix("voxkernel.")
        parent, _, last = local.rpartition(".")
        if parent in FACES and last in offered(parent):
            found.add(parent)
            continue
        if local == "_core" or parent == "_core":
            found.add("_core")
            continue
        while local and local not in MODULES:
            local = local.rpartition(".")[0]
        if local:
            found.add(local)
    return frozenset(found)


def may_import(row):
    above = ROWS[: ROWS.index(row)]
    allowed = FOLDERS.get(row)
    return set(above) if allowed is None else {*GROUND, *allowed.split()}


def test_every_file_has_a_row():
    assert {row_of(name) for name in MODULES if name} == set(ROWS) - {"_core"}


@pytest.mark.parametrize("row", ROWS)
def test_imports_come_from_rows_above(row):
    wrong = [
        f"{name} -> {other}"
        for name in MODULES
        for other in (own_modules(name) if row_of(name) == row and name else ())
        if row_of(other) != row and row_of(other) not in may_import(row)
    ]
    assert not wrong


@pytest.mark.parametrize("folder", FACES)
def test_no_circles_within_a_folder(folder):
    wanted = {n: own_modules(n) & set(MODULES) for n in MODULES if row_of(n) == folder and n != folder}
    through_face = [n for n, others in wanted.items() if folder in others]
    assert not through_face, "a file of a folder imports from the others, not from their face"
    while free := [n for n, others in wanted.items() if not (others - {n}) & set(wanted)]:
        for name in free:
            del wanted[name]
    assert not wanted, "these import each other"


@pytest.mark.parametrize("folder", FACES)
def test_a_face_is_imports_and_few_words(folder):
    tree = tree_of(folder)
    words, *rest = tree.body
    assert len(ast.get_docstring(tree).splitlines()) <= 5
    assert words.value.value
    for node in rest:
        assert isinstance(node, ast.ImportFrom) or ast.unparse(node).startswith("__all__ = "), ast.unparse(node)
    if folder != "cli":
        module = __import__(f"voxkernel.{folder}", fromlist=["__all__"])
        assert set(module.__all__) == set(offered(folder))


@pytest.mark.parametrize("name", [n for n in MODULES if n])
def test_files_are_short_and_folders_have_plain_names(name):
    assert len(MODULES[name].read_text(encoding="utf-8").splitlines()) <= MOST_LINES
    folder, _, file = name.partition(".")
    assert not file.startswith("_")
    assert folder in GROUND or not folder.startswith("_")


@pytest.mark.parametrize("name", list(MODULES))
def test_nothing_heavy_at_import(name):
    heavy = {dotted.split(".")[0] for dotted in _imports(tree_of(name), at_import_only=True)} & HEAVY
    assert not heavy, f"import these inside the function that needs them: {sorted(heavy)}"


def called_with(name, functions):
    """First words of texts that these functions are called with, as `plotly` of import_module("plotly.subplots")."""
    calls = [n for n in ast.walk(tree_of(name)) if isinstance(n, ast.Call) and n.args]
    wanted = [n.args[0] for n in calls if ast.unparse(n.func).split(".")[-1] in functions]
    return {node.value.split(".")[0] for node in wanted if isinstance(node, ast.Constant)}


@pytest.mark.parametrize("name", list(MODULES))
def test_packages_of_extras_are_imported_by_optional(name):
    imported = {dotted.split(".")[0] for dotted in _imports(tree_of(name))} | called_with(name, ("import_module",))
    assert imported & set(EXTRAS) <= MAY_IMPORT.get(name, set())
    asked = called_with(name, ("optional", "check_installed"))
    assert asked <= set(EXTRAS)
    if name not in ("_open3d", "cli.register", "evaluation.evaluate"):
        assert "open3d" not in asked, "import it by `_open3d.open3d`"


@pytest.mark.parametrize("name", ["evaluate", "repair", "violation", "register", "exact_kernel", "voxel_kernel"])
def test_a_public_name_is_the_function_even_after_its_file_was_imported(name):
    home = getattr(voxkernel, name).__module__
    code = f"import {home}, voxkernel; assert callable(voxkernel.{name}); print(voxkernel.{name}.__module__)"
    env = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert done.stdout.strip() == home


def test_import_loads_nothing_heavy():
    # A fresh interpreter: what is really loaded, whoever asked for it.
    code = f"import sys, voxkernel; print(sorted({{m.split('.')[0] for m in sys.modules}} & {HEAVY!r}))"
    env = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert done.stdout.strip() == "[]"
