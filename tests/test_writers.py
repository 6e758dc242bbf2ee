"""Every writer takes the path first and then what is written, or is a method `object.write(path)`."""

import importlib
import inspect

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.pictures import (
    cells_picture,
    interactive_page,
    registration_picture,
    sphere_picture,
    surface_picture,
)
from voxkernel.polyhedral import PolyhedralMesh
from voxkernel.registration import prepare_surface

FACES = ("mesh", "exact", "grid", "vdb", "voxels", "measures", "spherical", "registration", "polyhedral", "pictures")
READERS = ("read_", "is_", "as_", "from_")
CUBE = shapes.cube()
TETRAHEDRON = PolyhedralMesh.from_cells(
    [([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])]
)


def public_callables():
    """Functions of the top and of the faces, and public methods of the classes there."""
    for home in (voxkernel, *(importlib.import_module(f"voxkernel.{face}") for face in FACES)):
        for name in home.__all__:
            thing = getattr(home, name)
            if inspect.isclass(thing):
                for method, value in vars(thing).items():
                    if not method.startswith("_") and inspect.isfunction(value):
                        yield method, tuple(inspect.signature(value).parameters)[1:]
            elif inspect.isfunction(thing):
                yield name, tuple(inspect.signature(thing).parameters)


WRITERS = sorted({(n, p) for n, p in public_callables() if "path" in p and not n.startswith(READERS)})


def test_the_writers_are_known():
    assert {name for name, _ in WRITERS} >= {
        "cells_picture", "interactive_page", "registration_picture", "sphere_picture", "surface_picture", "write",
        "write_npz", "write_report", "write_vdb",
    }  # fmt: skip
    assert {name for name, _ in public_callables() if name.startswith("write")} <= {name for name, _ in WRITERS}


@pytest.mark.parametrize(("name", "parameters"), WRITERS)
def test_the_path_comes_first(name, parameters):
    assert parameters[0] == "path"
    assert name == "write" or len(parameters) > 1


def old_calls(folder):
    """What these calls were before the path came first; a surface or a result is no path."""
    kernel = voxkernel.exact_kernel(CUBE)
    seen = voxkernel.spherical_map(CUBE)
    ready = prepare_surface(CUBE, margins=[0.1])
    return {
        "surface_picture": lambda: surface_picture(CUBE, kernel, folder / "a.png"),
        "interactive_page": lambda: interactive_page([("cube", CUBE, kernel)], folder / "a.html"),
        "sphere_picture": lambda: sphere_picture(seen, folder / "a.png"),
        "registration_picture": lambda: registration_picture(ready, ready, None, folder / "a.png"),
        "cells_picture": lambda: cells_picture(TETRAHEDRON, np.ones(1), folder / "a.png"),
    }


@pytest.mark.parametrize(
    "name", ["surface_picture", "interactive_page", "sphere_picture", "registration_picture", "cells_picture"]
)
def test_the_old_order_is_one_line(name, tmp_path):
    with pytest.raises(TypeError, match="`path` must be a path; got") as caught:
        old_calls(tmp_path)[name]()
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_old_order_of_a_report_is_one_line(tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(ValueError, match=r"`path` must end in \.html, .* or \.tex, or `format` be given; got 'run'"):
        voxkernel.write_report(tmp_path / "run", tmp_path / "report.html")


def test_cells_are_drawn_as_png_only(tmp_path):
    with pytest.raises(ValueError, match=r"`path` must end in \.png; got 'a\.jpg'"):
        cells_picture(tmp_path / "a.jpg", TETRAHEDRON, [1.0])
