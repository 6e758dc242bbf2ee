"""Facet planes and what a mesh must be for them, next to a short twin in NumPy or in integers."""

import numpy as np
import pytest
import shapes
from hypothesis import given
from hypothesis import strategies as st

from voxkernel._core import boundary_is_zero, coordinate_range, facet_planes, least_spread, mesh_planes, plane_frame


@pytest.mark.parametrize("make", [shapes.cube, shapes.spiky, shapes.torus, shapes.open_box])
def test_facet_planes(make):
    vertices, faces = make()
    n = len(faces)
    normals, offsets, areas, errors = np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)
    assert facet_planes(vertices, faces, np.zeros(3), 1.0, normals, offsets, areas, errors) == 0
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    cross = np.cross(q - p, r - p)
    length = np.linalg.norm(cross, axis=1)
    assert np.allclose(normals, cross / length[:, None], atol=1e-14)
    assert np.allclose(offsets, np.einsum("ij,ij->i", cross, p) / length, atol=1e-14)
    assert np.allclose(areas, length / 2)
    assert (errors > 0).all()
    assert (errors < 1e-12).all()


def test_facet_planes_tell_the_undecided_from_the_degenerate():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0], [0, 0, 0.0]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 1, 1]])
    errors = np.empty(3)
    assert facet_planes(vertices, faces, np.zeros(3), 1.0, np.empty((3, 3)), np.empty(3), np.empty(3), errors) == 1
    assert errors.tolist() == [-1, -2, -2]


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("make", [shapes.torus, shapes.open_box, lambda: shapes.uv_sphere(150, 200)])
def test_planes_of_a_mesh_are_what_its_parts_give(make, threads):
    vertices, faces = make()
    vertices = 3.0 * vertices + [5.0, 0.0, -1.0]
    faces = np.concatenate([faces, [[0, 0, 1]]])
    corners = np.concatenate([faces[::2], [[0, 1, 1]]])
    n = len(corners)
    normals, offsets, areas, errors = np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)
    frame = plane_frame(vertices, np.concatenate([faces, corners]))
    undecided = facet_planes(vertices, corners, frame[0], 1.0 / frame[1], normals, offsets, areas, errors)
    found = mesh_planes(vertices, faces, corners, threads)
    assert np.array_equal(found[0], frame[0])
    assert found[1:5] == frame[1:]
    for one, other in zip(found[5:9], (normals, offsets, areas * frame[1] ** 2, errors), strict=True):
        assert np.array_equal(one, other)
    closed = boundary_is_zero(faces, len(vertices))
    assert found[9:] == (undecided, np.count_nonzero(errors < 0), closed)
    assert closed == (make is not shapes.open_box)
    assert found[10] >= 1


def test_coordinate_range(rng):
    vertices = rng.normal(size=(50, 3))
    vertices[3, 1] = 0.0
    faces = rng.integers(0, 49, (60, 3))  # nobody refers to the last vertex
    low, high, smallest = coordinate_range(vertices, faces)
    used = vertices[np.unique(faces)]
    assert (low == used.min(0)).all()
    assert (high == used.max(0)).all()
    assert smallest == np.abs(used[used != 0]).min()


@pytest.mark.parametrize("shift", [0.0, 5e6])
def test_plane_frame(shift, rng):
    vertices = rng.normal(size=(50, 3)) * [1.0, 3.0, 0.1] + shift
    faces = rng.integers(0, 49, (60, 3))
    origin, scale, spans, largest, smallest = plane_frame(vertices, faces)
    used = vertices[np.unique(faces)]
    reach = np.linalg.norm(np.abs(used - origin).max(axis=0))
    assert np.allclose(origin, (used.min(0) + used.max(0)) / 2, rtol=1e-15)
    assert np.log2(scale) % 1 == 0
    assert scale / 2 < reach <= scale
    assert spans == tuple(np.ptp(used, axis=0))
    assert largest == np.abs(used).max()
    assert smallest == np.abs(used).min()
    assert not origin.flags.writeable


def test_the_scale_of_a_surface_is_the_least_power_of_two():
    """Half diagonal 1: with room for rounding, 2; a little smaller, 1. Of a single point, 1."""
    corners = np.array([[-1, 0, 0], [1, 0, 0], [0, 0, 0.0]])
    faces = np.array([[0, 1, 2]])
    assert [plane_frame(size * corners, faces)[1] for size in (1.0, 1 - 1e-9, 0.0, 2.0**-190)] == [2, 1, 1, 2.0**-189]


@pytest.mark.parametrize("step", [1, 7])
def test_least_spread_is_a_lower_bound(step, rng):
    for squeeze in (1.0, 1e-3, 0.0):
        normals = rng.normal(size=(60, 3)) * [1.0, 1.0, squeeze]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        some = normals[::step]
        values = np.linalg.eigvalsh(some.T @ some / len(some))
        found = least_spread(normals, step)
        assert found == pytest.approx(4 * values.prod(), rel=1e-9, abs=1e-15)
        assert found <= values[0] + 1e-15


@given(st.lists(st.tuples(*[st.integers(0, 5)] * 3), min_size=1, max_size=30))
def test_boundary_is_zero(rows):
    faces = np.array(rows, np.int64)
    count = {}
    for a, b, c in rows:
        for u, v in ((a, b), (b, c), (c, a)):
            if u != v:
                count[min(u, v), max(u, v)] = count.get((min(u, v), max(u, v)), 0) + (1 if u < v else -1)
    assert boundary_is_zero(faces, 6) == (not any(count.values()))


def test_boundary_is_zero_at_a_vertex_of_high_degree():
    n = 200
    fan, under = shapes.two_fans(n)
    assert boundary_is_zero(np.concatenate([fan, under]), n + 2)
    assert not boundary_is_zero(fan, n + 2)


def test_wrong_arrays_are_refused():
    vertices, faces = shapes.cube()
    with pytest.raises(TypeError, match="incompatible function arguments"):
        coordinate_range(vertices.astype(np.float32), faces)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        boundary_is_zero(np.asfortranarray(faces), len(vertices))
    normals = np.empty((len(faces), 3))
    normals.flags.writeable = False
    rest = [np.empty(len(faces)) for _ in range(3)]
    with pytest.raises(TypeError, match="incompatible function arguments"):
        facet_planes(vertices, faces, np.zeros(3), 1.0, normals, *rest)
