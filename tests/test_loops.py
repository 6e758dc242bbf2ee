"""Every compiled loop of the exact kernel next to a short twin in NumPy or in integers."""


import numpy as np
import pytest
import shapes
from hypothesis import given
from hypothesis import strategies as st

import voxkernel
from voxkernel._loops.octree import exact_cells
from voxkernel._loops.planes import boundary_is_zero, coordinate_range, facet_planes



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


def test_coordinate_range(rng):
    vertices = rng.normal(size=(50, 3))
    vertices[3, 1] = 0.0
    low, high, smallest = coordinate_range(vertices)
    assert (low == vertices.min(0)).all()
    assert (high == vertices.max(0)).all()
    assert smallest == np.abs(vertices[vertices != 0]).min()


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
    ring = np.arange(1, n + 1)
    fan = np.column_stack([np.zeros(n, np.int64), ring, np.roll(ring, -1)])
    under = np.column_stack([np.full(n, n + 1), np.roll(ring, -1), ring])
    assert boundary_is_zero(np.concatenate([fan, under]), n + 2)
    assert not boundary_is_zero(fan, n + 2)


def test_moments_and_reach_of_a_box():
    kernel = voxkernel.exact_kernel(shapes.box((-1, -1, -1), (1, 2, 3)))
    volume, first, second, area = moments(kernel.vertices, kernel.face_starts, kernel.face_vertices)
    assert volume == pytest.approx(24)
    assert first / volume == pytest.approx([0, 0.5, 1])
    assert np.diag(second) == pytest.approx([24 / 3, 24 * (9 / 12 + 0.25), 24 * (16 / 12 + 1)])
    assert area == pytest.approx(2 * (6 + 8 + 12))
    first_of, joined = neighbours(kernel.face_starts, kernel.face_vertices, 8)
    assert np.diff(first_of).tolist() == [3] * 8
    normals = np.array([[1, 0, 0], [0, 0, 1], [0.6, 0.8, 0]])
    keep = np.empty(3, np.int64)
    for offsets in (np.array([1.1, 2.9, 9]), np.array([0.9, 3.1, 2.1])):
        count, worst = planes_reaching(
            normals, offsets, np.zeros(3), kernel.vertices, first_of, joined,
            np.array([0, 0.5, 1]), np.array([1, 1.5, 2]), 0.0, keep,
        )  # fmt: skip
        excess = (normals @ kernel.vertices.T).max(axis=1) - offsets
        assert keep[:count].tolist() == np.flatnonzero(excess >= 0).tolist()
        assert worst == pytest.approx(excess.max())


def test_solid_angle_of_closed_and_open_surfaces():
    vertices, faces = shapes.spiky()
    assert solid_angle(vertices, faces.ravel()) == pytest.approx(4 * np.pi)
    assert solid_angle(vertices + 50, faces.ravel()) == pytest.approx(0, abs=1e-9)
    octant = np.eye(3)
    assert solid_angle(octant, np.array([0, 1, 2])) == pytest.approx(np.pi / 2)


@given(
    st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3), st.integers(-3, 3), st.integers(1, 9)), max_size=5),
    st.integers(3, 4),
)
def test_octree_voxels_against_integers(rows, depth):
    """Planes a . u <= d / 8 over the unit cube: every voxel inside, outside or undecided as its corners say."""
    rows = [r for r in rows if any(r[:3])]
    n = len(rows)
    normals, offsets = np.array([r[:3] for r in rows], float).reshape(n, 3), np.array([r[3] / 8 for r in rows])
    lengths = np.linalg.norm(normals, axis=1)
    normals, offsets = normals / lengths[:, None], offsets / lengths
    arrays = exact_cells(normals, offsets, np.abs(normals).sum(1), np.full(n, 1e-14), depth, False)
    tile_ijk, tile_log2, leaf_ijk, leaf_inside, leaf_boundary, n_inside, n_boundary = arrays
    size = 2**depth
    verdict = np.full((size,) * 3, -1)
    for (x, y, z), log2 in zip(tile_ijk, tile_log2, strict=True):
        e = 2 ** int(log2)
        verdict[x : x + e, y : y + e, z : z + e] = 1
    for (x, y, z), ins, bou in zip(leaf_ijk, leaf_inside, leaf_boundary, strict=True):
        for masks, value in ((ins, 1), (bou, 0)):
            bits = np.unpackbits(np.ascontiguousarray(masks).view(np.uint8), bitorder="little").reshape(8, 8, 8)
            verdict[x : x + 8, y : y + 8, z : z + 8][bits == 1] = value
    assert (verdict == 1).sum() == n_inside
    assert (verdict == 0).sum() == n_boundary
    grid = np.stack(np.meshgrid(*[np.arange(size + 1)] * 3, indexing="ij"), -1)
    inside = np.ones((size,) * 3, bool)
    outside = np.zeros((size,) * 3, bool)
    for a, b, c, d in rows:
        side = 8 * (grid @ np.array([a, b, c])) - d * size  # sign of a . u - d / 8 at every corner, in integers
        corners = np.stack([side[i : i + size, j : j + size, k : k + size] for i, j, k in np.ndindex(2, 2, 2)])
        inside &= corners.max(0) <= 0
        outside |= corners.min(0) > 0
    assert inside[verdict == 1].all()
    touching = np.zeros((size,) * 3, bool)  # a corner exactly on a plane may stay undecided
    for a, b, c, d in rows:
        side = 8 * (grid @ np.array([a, b, c])) - d * size
        corners = np.stack([side[i : i + size, j : j + size, k : k + size] for i, j, k in np.ndindex(2, 2, 2)])
        touching |= (corners == 0).any(0)
    assert not (inside & (verdict == -1)).any()
    assert (verdict[inside & ~touching] == 1).all()
    assert (verdict[outside] < 1).all()
    assert (verdict[outside & ~touching] == -1).all()
