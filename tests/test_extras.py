"""A package that an extra brings and that is not installed: one line, which names the extra, wherever it is wanted."""

import re
import sys
import tomllib
import types
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._extras import EXTRAS, check_installed, optional
from voxkernel.cli import progress
from voxkernel.cli.main import main
from voxkernel.errors import MissingExtraError
from voxkernel.evaluation import EvaluateSettings
from voxkernel.evaluation.progress import EvaluationProgress
from voxkernel.grid import to_pyvista_image
from voxkernel.pictures import surface_picture

ROOT = Path(__file__).resolve().parent.parent
INSTALLED_AS = {"PIL": "pillow", "vtkmodules": "pyvista", "distributed": "dask", "nrrd": "pynrrd",
    "trame_client": "trame-client", "trame_vtk": "trame-vtk",
}  # fmt: skip
ALSO = {"libusb-package"}  # for Open3D alone, which may not need it
SHARED = {"view": {"pyvista"}}  # of another extra


@pytest.fixture
def hide(monkeypatch):
    def hidden(*packages):
        for name in [*packages, *(name for name in sys.modules if name.split(".")[0] in packages)]:
            monkeypatch.setitem(sys.modules, name, None)

    return hidden


@pytest.fixture
def cube():
    return voxkernel.as_mesh(shapes.cube())


def line(package):
    extra = EXTRAS[package]
    return re.escape(
        f"`{package}` is not installed; the extra `{extra}` brings it: "
        f'`pip install "voxkernel[{extra}]"`, in a checkout `pip install ".[{extra}]"`'
    )


def test_pyproject_says_the_same():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {extra: {re.split(r"[\[<>=;]", text)[0] for text in texts}
             for extra, texts in project["optional-dependencies"].items()}  # fmt: skip
    wanted = {}
    for package, extra in EXTRAS.items():
        wanted.setdefault(extra, set()).add(INSTALLED_AS.get(package, package))
    assert {
        extra: {n.removesuffix("-cpu") for n in names[extra]} - ALSO - SHARED.get(extra, set()) for extra in wanted
    } == wanted  # fmt: skip
    assert project["optional-dependencies"]["all"] == [f"voxkernel[{','.join(e for e in names if e in wanted)}]"]
    needed = {re.split(r"[\[<>=;]", text)[0] for text in project["dependencies"]}
    assert needed == {"mapbox-earcut", "numpy", "scipy"}


@pytest.mark.parametrize("package", EXTRAS)
def test_a_missing_package_is_one_line(hide, package):
    hide(package)
    for name in (package, f"{package}.something"):
        with pytest.raises(MissingExtraError, match=f"^{line(package)}$"):
            optional(name)
    with pytest.raises(MissingExtraError, match=f"^{line(package)}$"):
        check_installed(package)


@pytest.mark.parametrize("package", EXTRAS)
def test_an_installed_package_is_found(package):
    check_installed(package)


def test_what_a_package_itself_lacks_is_not_its_extra(monkeypatch, tmp_path):
    (tmp_path / "rich.py").write_text("import no_such_package_of_rich")
    for name in [name for name in sys.modules if name.split(".")[0] == "rich"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ModuleNotFoundError, match="No module named 'no_such_package_of_rich'") as caught:
        optional("rich")
    assert not isinstance(caught.value, MissingExtraError)


def picture(suffix):
    return lambda mesh, folder: surface_picture(folder / f"cube{suffix}", mesh, voxkernel.exact_kernel(mesh))


def gltf(_, folder):
    (folder / "cube.gltf").write_text("{}")
    voxkernel.as_mesh(folder / "cube.gltf")


def vdb(_, folder):
    grid = voxkernel.SparseGrid.from_dense(np.arange(512.0).reshape(8, 8, 8))
    voxkernel.write_vdb(folder / "grid.vdb", grid, compression="blosc")


def evaluated(folder, **settings):
    voxkernel.evaluate([folder], output=folder / "run", settings=EvaluateSettings(**settings))


USES = {
    "open3d, from a mesh": ("open3d", lambda mesh, _: mesh.to_open3d()),
    "open3d, rays": ("open3d", lambda mesh, _: voxkernel.visible_fraction(mesh, [9.0, 0.0, 0.0])),
    "open3d, a motion": ("open3d", lambda mesh, _: voxkernel.register(mesh, mesh)),
    "open3d, rays of an evaluation": ("open3d", lambda _, folder: evaluated(folder, visible=True)),
    "pymeshlab, repair": ("pymeshlab", lambda mesh, _: voxkernel.repair(mesh, smooth_steps=1)),
    "pymeshlab, a file": ("pymeshlab", gltf),
    "pyvista, from a mesh": ("pyvista", lambda mesh, _: mesh.to_polydata()),
    "pyvista, from a grid": ("pyvista", lambda *_: to_pyvista_image(voxkernel.SparseGrid.from_ijk([[0, 0, 0]]))),
    "pyvista, a picture": ("pyvista", picture(".png")),
    "PIL": ("PIL", picture(".png")),
    "plotly": ("plotly", picture(".html")),
    "dask": ("dask", lambda _, folder: evaluated(folder)),
    "distributed": ("distributed", lambda _, folder: evaluated(folder)),
    "pyarrow": ("pyarrow", lambda _, folder: evaluated(folder)),
    "fsspec": ("fsspec", lambda _, folder: voxkernel.write_report(folder / "page.html", folder)),
    "blosc": ("blosc", vdb),
}


@pytest.mark.parametrize("use", USES)
def test_functions_say_which_extra_they_want(hide, cube, tmp_path, use):
    package, call = USES[use]
    hide(package)
    with pytest.raises(MissingExtraError, match=f"^{line(package)}$"):
        call(cube, tmp_path)
    assert not (tmp_path / "run").exists()


COMMANDS = {
    "picture": ("pyvista", ["kernel", "cube.ply", "--picture", "cube.png"]),
    "page": ("plotly", ["kernel", "cube.ply", "--picture", "cube.html"]),
    "register": ("open3d", ["register", "cube.ply", "cube.ply"]),
    "evaluate": ("distributed", ["evaluate", "cube.ply", "-o", "run"]),
    "report": ("pyarrow", ["report", ".", "-o", "page.html"]),
    "demo": ("jinja2", ["demo"]),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_say_which_extra_they_want(hide, cube, tmp_path, monkeypatch, capsys, command):
    package, words = COMMANDS[command]
    cube.write(tmp_path / "cube.ply")
    (tmp_path / "rows").mkdir()
    monkeypatch.chdir(tmp_path)
    hide(package)
    assert main(words) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(f"voxkernel: error: {line(package)}\n", said.err)
    assert {path.name for path in tmp_path.iterdir()} == {"cube.ply", "rows"}


def test_progress_is_lines_without_rich(hide, monkeypatch):
    said = []
    terminal = types.SimpleNamespace(isatty=lambda: True, write=said.append, flush=lambda: None)
    hide("rich")
    monkeypatch.setattr(progress.sys, "stderr", terminal)
    with progress.shown(quiet=False) as show:
        show(EvaluationProgress(done=3, total=3, failed=0, reused=0, rate=1.0, remaining=0.0))
    assert len(said) == 1
    assert said[0].startswith("voxkernel: 3")
