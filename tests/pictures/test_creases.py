"""Sharp edges part triangles, smooth ones do not; nothing else about a surface changes."""

import numpy as np
import pytest
import shapes

from voxkernel.pictures.creases import split_at_creases


def test_the_sides_of_a_cube_are_apart():
    vertices, faces = shapes.cube()
    points, triangles = split_at_creases(vertices, faces)
    assert np.array_equal(points[triangles], vertices[faces])
    assert len(points) == 24
    for corner in range(len(points)):  # all triangles at a new vertex lie in one side
        normals = np.cross(*np.moveaxis(np.diff(points[triangles[(triangles == corner).any(axis=1)]], axis=1), 1, 0))
        assert np.linalg.matrix_rank(normals) == 1


def test_a_round_surface_stays_in_one_piece():
    vertices, faces = shapes.icosphere(3)
    points, triangles = split_at_creases(vertices, faces)
    assert len(points) == len(vertices)
    assert np.array_equal(points[triangles], vertices[faces])


def test_a_cone_is_apart_at_its_rim_alone():
    """Round about its axis, sharp where it meets its base; the apex stays one vertex."""
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    rim = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(40)])
    vertices = np.concatenate([rim, [[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]]])
    ring = np.arange(40)
    side = np.column_stack([ring, (ring + 1) % 40, np.full(40, 40)])
    base = np.column_stack([(ring + 1) % 40, ring, np.full(40, 41)])
    points, triangles = split_at_creases(vertices, np.concatenate([side, base]).astype(np.int64))
    assert len(points) == len(vertices) + 40
    assert len(np.unique(triangles[:40, 2])) == 1


@pytest.mark.parametrize("flipped", [False, True])
def test_two_triangles_that_are_turned_against_each_other(flipped):
    """Their normals are opposite: that is as sharp as it gets, whatever the picture."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 3, 2] if flipped else [0, 2, 3]])
    points, _ = split_at_creases(vertices, faces)
    assert len(points) == (6 if flipped else 4)


def test_edges_of_three_triangles_and_triangles_without_area():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [2, 0, 0]], float)
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [0, 1, 5]])
    points, triangles = split_at_creases(vertices, faces)
    assert np.array_equal(points[triangles], vertices[faces])
