"""What a user should know of a surface: counts that are known, and silence where all is well."""

import numpy as np
import pytest
import shapes

from voxkernel import as_mesh
from voxkernel.mesh.surface_notes import count_self_intersections, surface_notes


def together(*bodies):
    """Several surfaces as one mesh."""
    starts = np.cumsum([0, *(len(v) for v, _ in bodies)])
    vertices = np.concatenate([v for v, _ in bodies])
    return vertices, np.concatenate([np.asarray(f) + n for (_, f), n in zip(bodies, starts, strict=False)])


def cube(scale=1.0, shift=0.0, turned=False):
    vertices, faces = shapes.cube()
    faces = np.asarray(faces)
    return (np.asarray(vertices) - 0.5) * scale + shift, faces[:, ::-1] if turned else faces


@pytest.mark.parametrize("shape", [shapes.cube(), shapes.height_field(n=4), shapes.torus(n_major=8, n_minor=6)])
def test_most_surfaces_have_none(shape):
    assert surface_notes(as_mesh(shape)) == ()


def test_cubes_that_cross():
    pytest.importorskip("pymeshlab")
    mesh = as_mesh(together(cube(), cube(shift=np.array([0.4, 0.3, 0.2]))))
    # three sides of each cube run into the other, two triangles each, and of those only the ones that are reached
    assert 6 <= count_self_intersections(mesh) <= 12
    crossing, bodies = surface_notes(mesh)
    assert crossing.endswith("of 24 triangles cross others: where it overlaps, its volume counts twice")
    assert bodies == "2 bodies: the kernel is that of all of them together"


def test_large_surfaces_are_not_looked_at_for_crossings():
    mesh = as_mesh(shapes.icosphere(7))
    assert surface_notes(mesh) == ("not looked at whether it runs through itself: 327,680 triangles are too many",)


def test_without_pymeshlab_they_are_not_counted(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pymeshlab", None)
    mesh = as_mesh(together(cube(), cube(shift=0.4)))
    assert count_self_intersections(mesh) is None
    assert surface_notes(mesh)[0].startswith("2 bodies")


def test_a_body_inside_another_counts_twice_and_a_cavity_does_not():
    twice = surface_notes(as_mesh(together(cube(), cube(0.5), cube(0.25))))
    assert twice[1] == "2 inside others, facing outwards as well: their volume counts twice"
    assert len(surface_notes(as_mesh(together(cube(), cube(0.5, turned=True))))) == 1
    assert len(surface_notes(as_mesh(together(cube(), cube(shift=3.0))))) == 1


def test_sides():
    assert surface_notes(as_mesh(cube(turned=True)))[0].startswith("inside out: facets point inwards; ")
    vertices, faces = shapes.cube()
    faces = np.array(faces)
    faces[0] = faces[0, ::-1]
    assert surface_notes(as_mesh((vertices, faces)))[0].startswith("neighbouring facets disagree on which side is out")
