"""Convexity of closed surfaces, decided exactly from their edges."""

import numpy as np
import pytest
import shapes
from hypothesis import given, settings

from voxkernel.exact.convexity import edge_convexity_of, is_locally_convex
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh, as_mesh


def is_convex(surface):
    mesh = as_mesh(surface)
    return is_locally_convex(mesh, HalfSpaces.from_mesh(mesh))


def edges_of(vertices, faces):
    return edge_convexity_of(vertices, faces, np.arange(len(faces)), faces)


@settings(max_examples=50)
@given(shapes.convex_meshes())
def test_hulls_are_convex_and_dents_are_not(surface):
    vertices, faces = surface
    assert is_convex(surface)
    # push the middle of a facet to the middle of the solid
    dented, split = shapes.with_split_facet(vertices, faces, 0)
    dented[-1] = vertices.mean(axis=0)
    assert not is_convex((dented, split))


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (shapes.tetrahedron, 2),
        (shapes.octahedron, 2),
        (shapes.cube, 1),
        (lambda: shapes.subdivided(*shapes.octahedron()), 1),
        (shapes.l_prism, 0),
        (shapes.open_box, 0),
        (shapes.inside_out_cube, 0),
        (shapes.cube_with_flipped_face, 0),
        (shapes.three_faces_on_an_edge, 0),
    ],
)
def test_classes_of_edges(make, expected):
    assert edges_of(*make()) == expected


@pytest.mark.parametrize(("step", "expected"), [(-1, 2), (0, 1), (1, 0)])
def test_one_unit_in_the_last_place_decides(step, expected):
    """The top of a pyramid over a square, one corner of it one double too low or too high."""
    height = float(np.nextafter(0.1, np.inf * step)) if step else 0.1
    vertices, faces = shapes.mesh(
        [(0, 0, 0.1), (1, 0, 0.1), (1, 1, 0.1), (0, 1, height), (0.3, 0.3, -1)],
        [(0, 1, 2), (0, 2, 3), (1, 0, 4), (2, 1, 4), (3, 2, 4), (0, 3, 4)],
    )
    assert edges_of(vertices, faces) == expected


def test_planar_polygons_count_with_one_plane():
    vertices, polygons = shapes.truncated_octahedron()
    assert is_convex(TriangleMesh.from_polygons(vertices, polygons))
    vertices, polygons = shapes.notched_cube_polygons(0.25)
    assert not is_convex(TriangleMesh.from_polygons(vertices, polygons))


@pytest.mark.parametrize("factor", [1e-95, 1e95])
def test_sizes_beyond_the_exact_predicate_are_not_called_convex(factor):
    vertices, faces = shapes.octahedron()
    assert edges_of(vertices * factor, faces) == 0


def test_a_surface_with_a_facet_without_area_is_not_called_convex():
    vertices, faces = shapes.tetrahedron()
    assert not is_convex((vertices, np.concatenate([faces, [[0, 0, 1]]])))
