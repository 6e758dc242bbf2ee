"""Pages of the reference: one for every name in ``voxkernel.__all__``, and one for every module called by its name."""

import ast
import importlib
import inspect
import pkgutil
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import voxkernel

_SKIPPED = ("voxkernel._core", "voxkernel.cli")
# Modules a user calls by their full name: every function in their `__all__` is documented as well.
_NAMED = ("registration", "polyhedral", "pictures", "view", "grid", "halfspaces", "demo_shapes", "errors")


def public_names() -> dict[str, Any]:
    """The public names and what they stand for."""
    return {name: getattr(voxkernel, name) for name in sorted(voxkernel.__all__, key=str.lower)}


def result_classes() -> dict[str, type]:
    """Classes that public names take or give back, and those these lead to, and that are not public: there are none."""
    known = _classes()
    found: dict[str, type] = {}
    todo = list(public_names().values())
    while todo:
        for name in _words_of(todo.pop()):
            cls = known.get(name)
            if cls is not None and cls not in found.values() and cls not in public_names().values():
                found[name] = cls
                todo.append(cls)
    return dict(sorted(found.items()))


def named_modules() -> dict[str, ModuleType]:
    """Public modules with functions of their own."""
    return {name: importlib.import_module(f"voxkernel.{name}") for name in _NAMED}


def _classes() -> dict[str, type]:
    """Every class a module of the library lists in its `__all__`."""
    found: dict[str, type] = {}
    for info in pkgutil.walk_packages(voxkernel.__path__, "voxkernel."):
        if info.name.startswith(_SKIPPED):
            continue
        module = importlib.import_module(info.name)
        for name in getattr(module, "__all__", ()):
            thing = getattr(module, name)
            if inspect.isclass(thing) and thing.__module__ == info.name:
                found[name] = thing
    return found


def _words_of(thing: Any) -> set[str]:
    """Names in what a function takes and returns; of a class, in its fields, properties and public methods."""
    texts: list[Any] = []
    if inspect.isclass(thing):
        fields = inspect.get_annotations(thing)
        texts += [text for name, text in fields.items() if not name.startswith("_")]
        for name, member in vars(thing).items():
            function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            if not name.startswith("_") and inspect.isfunction(function):
                texts.append(function.__annotations__.get("return", ""))
    else:
        texts += thing.__annotations__.values()
    words: set[str] = set()
    for text in texts:
        words |= set(re.findall(r"[A-Za-z_]\w*", text if isinstance(text, str) else str(text)))
        words.add(getattr(text, "__name__", ""))
    return words


def _heading(text: str) -> str:
    return f"{text}\n{'=' * len(text)}\n"


def _summary(thing: Any) -> str:
    return (inspect.getdoc(thing) or "").strip().split("\n\n")[0].replace("\n", " ")


def _page(title: str, target: str, thing: Any) -> str:
    """One object, as autodoc and numpydoc show it."""
    if inspect.isclass(thing):
        kind = "autoexception" if issubclass(thing, BaseException) else "autoclass"
        members = "" if kind == "autoexception" else "   :members:\n"
        return f"{_heading(title)}\n.. {kind}:: {target}\n{members}"
    return f"{_heading(title)}\n.. autofunction:: {target}\n"


def _table(rows: dict[str, Any], prefix: str) -> str:
    lines = [".. list-table::", "   :widths: 30 70", ""]
    for name, thing in rows.items():
        lines += [f"   * - :doc:`{name} <{prefix}{name}>`", f"     - {_summary(thing)}"]
    return "\n".join(lines) + "\n"


def _toctree(entries: list[str]) -> str:
    return ".. toctree::\n   :hidden:\n\n" + "".join(f"   {entry}\n" for entry in entries)


def _functions_of(module: ModuleType) -> list[str]:
    tree = ast.parse(Path(inspect.getfile(module)).read_text(encoding="utf-8"))
    order = [n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    listed = [n for n in module.__all__ if not isinstance(getattr(module, n), tuple)]
    return sorted(listed, key=lambda n: order.index(n) if n in order else -1)


def _module_page(name: str, module: ModuleType, documented: set[Any]) -> str:
    """The functions of one module; what has a page of its own is left to it."""
    parts = [_heading(f"voxkernel.{name}"), _summary(module), ""]
    for function in _functions_of(module):
        thing = getattr(module, function)
        if thing in documented:
            continue
        origin = f"{thing.__module__}.{thing.__qualname__}"
        kind = "autofunction"
        if inspect.isclass(thing):
            kind = "autoexception" if issubclass(thing, BaseException) else "autoclass"
        parts += [f".. {kind}:: {origin}", ""]
    return "\n".join(parts)


def _index() -> str:
    names, modules = public_names(), named_modules()
    functions = {n: t for n, t in names.items() if not inspect.isclass(t)}
    classes = {n: t for n, t in names.items() if inspect.isclass(t)}
    errors = {n: t for n, t in classes.items() if issubclass(t, Exception)}
    parts = [
        _heading("Reference"),
        "Everything in ``voxkernel.__all__``. Positions are float64 in the units of the mesh, facets are "
        "counter-clockwise seen from outside; see :doc:`/theory/conventions`.\n",
        "Public is what these pages show; every other name may change in any release.\n",
        "Results are frozen. Their arrays are read-only, also after a pickle, `copy.deepcopy` and on the way from a "
        "worker process; ``==`` and ``hash`` go by identity, but for `SparseGrid`, which compares voxels, values and "
        "transform. ``dataclasses.replace`` makes a changed one; what was kept for later calls is not carried over.\n",
        ".. rubric:: Functions\n", _table(functions, ""),
        ".. rubric:: Classes\n", _table({n: t for n, t in classes.items() if n not in errors}, "classes/"),
        ".. rubric:: Errors\n", _table(errors, "classes/"),
        ".. rubric:: Modules called by their full name\n", _table(modules, "module_"),
        ":doc:`/api/openvdb_names` puts the names of `SparseGrid` beside those of OpenVDB.\n",
        _toctree(
            [*functions, *(f"classes/{n}" for n in classes), *(f"module_{n}" for n in modules), "/api/openvdb_names"]
        ),
    ]  # fmt: skip
    return "\n".join(parts)


def write_pages(folder: Path) -> None:
    """Write the pages of the reference; unchanged files keep their time, stale ones go."""
    names = public_names()
    documented = set(names.values())
    # Classes in a folder of their own: `Starshapeness` and `starshapeness` are one file where case does not count.
    pages = {
        f"classes/{n}" if inspect.isclass(thing) else n: _page(n, f"voxkernel.{n}", thing) for n, thing in names.items()
    }
    pages |= {f"module_{n}": _module_page(n, m, documented) for n, m in named_modules().items()}
    pages["index"] = _index()
    (folder / "classes").mkdir(parents=True, exist_ok=True)
    for old in folder.rglob("*.rst"):
        if old.relative_to(folder).with_suffix("").as_posix() not in pages:
            old.unlink()
    for name, text in pages.items():
        file = folder / f"{name}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def _public_name(_role: str, _raw: str, text: str, _line: int, _inliner: Any, *_: Any) -> tuple[list[Any], list[Any]]:
    """A word in single backquotes: a link to its page if it is a public name, plain code if not."""
    from docutils import nodes
    from sphinx.addnodes import pending_xref

    word = nodes.literal(text, text)
    name = text.removeprefix("voxkernel.")
    if name not in voxkernel.__all__:
        return [word], []
    link = pending_xref("", word, refdomain="py", reftype="obj", reftarget=f"voxkernel.{name}", refexplicit=True)
    return [link], []


def _on_start(app: Any) -> None:
    write_pages(Path(app.srcdir) / "made" / "api")


def _keep_bars(_app: Any, _what: str, _name: str, _thing: Any, _options: Any, lines: list[str]) -> None:
    """Docstrings are plain text: `|m|` is a magnitude there, not a substitution."""
    lines[:] = [line if ">>>" in line else re.sub(r"\|(\w+)\|", r"\\|\1\\|", line) for line in lines]


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before Sphinx looks for its sources; touch up docstrings; link names in single backquotes."""
    app.add_role("public-name", _public_name)
    app.connect("builder-inited", _on_start)
    app.connect("autodoc-process-docstring", _keep_bars, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
