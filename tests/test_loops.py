"""Every compiled loop of the exact kernel next to a short twin in NumPy or in integers."""

from fractions import Fraction

import numpy as np
import pytest
import shapes
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

import voxkernel
from voxkernel._loops.convexity import edge_convexity, halfedge_twins, orientation
from voxkernel._loops.coplanar import orient3d_exact
from voxkernel._loops.linear_program import N_BINS, deepest_point, plane_signs, tightest_by_direction
from voxkernel._loops.planes import boundary_is_zero, coordinate_range, facet_planes
from voxkernel._loops.polyhedron import moments, neighbours, planes_reaching, solid_angle
from voxkernel.halfspaces import HalfSpaces

coordinates = st.one_of(
    st.integers(-8, 8).map(float), st.floats(-4, 4), st.floats(-1e-12, 1e-12), st.sampled_from([1e30, -1e-30, 0.1])
)
points = st.tuples(coordinates, coordinates, coordinates)


def integer_orientation(a, b, c, d):
    a, b, c, d = ([Fraction(v) for v in p] for p in (a, b, c, d))
    u, v, w = ([x - y for x, y in zip(p, d, strict=True)] for p in (a, b, c))
    det = (
        u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])
    )
    return (det > 0) - (det < 0)


@given(points, points, points, points)
def test_orient3d_is_exact(a, b, c, d):
    expected = integer_orientation(a, b, c, d)
    a, b, c, d = (np.array(p, dtype=float) + 0.0 for p in (a, b, c, d))
    tiny = [abs(v) for p in (a, b, c, d) for v in p if v]
    if tiny and min(tiny) < 2.0**-300:
        return  # beyond the range the predicate is used in
    assert orient3d_exact(a, b, c, d) == expected
    assert np.sign(orientation(a, b, c, d)) == -expected


@given(points, points, st.floats(-3, 3), st.floats(-3, 3))
def test_orient3d_on_nearly_flat_input(a, b, s, t):
    """d is a rounded combination of a, b and the origin: flat but for the last bits."""
    a, b = np.array(a), np.array(b)
    c = np.zeros(3)
    d = s * a + t * b
    tiny = [abs(v) for p in (a, b, d) for v in p if v]
    if tiny and (min(tiny) < 2.0**-300 or max(tiny) > 2.0**300):
        return
    assert orient3d_exact(a, b, c, d) == integer_orientation(a, b, c, d)


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
    twins = halfedge_twins(np.concatenate([fan, under]), n + 2)
    assert (twins >= 0).all()
    assert (twins[twins] == np.arange(len(twins))).all()


@pytest.mark.parametrize(
    ("make", "expected"),
    [(shapes.icosphere, 2), (shapes.cube, 1), (shapes.l_prism, 0), (shapes.torus, 0), (shapes.open_box, 0)],
)
def test_edge_convexity(make, expected):
    vertices, faces = make()
    twins = halfedge_twins(faces, len(vertices))
    assert edge_convexity(vertices, faces, twins, np.arange(len(faces)), faces) == expected


@pytest.mark.parametrize("n", [4, 40, 400])
def test_deepest_point_is_that_of_highs(n, rng):
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for shift in (1.0, -0.2):
        offsets = rng.uniform(0.5, 1, n) * shift + normals @ rng.uniform(-0.3, 0.3, 3)
        basis, multipliers, point = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
        assert deepest_point(normals, offsets, np.arange(n), n, 4.0, basis, multipliers, point, 1e-14, 500) >= 0
        bounds = [(-4, 4)] * 3 + [(None, 8)]
        rows = np.column_stack([normals, np.ones(n)])
        known = linprog([0, 0, 0, -1], A_ub=rows, b_ub=offsets, bounds=bounds).x
        assert point[3] == pytest.approx(known[3], abs=2e-7)  # HiGHS stops at 1e-7
        assert (normals @ point[:3] + point[3] - offsets).max() < 1e-12
        assert (multipliers >= 0).all()
        if (basis >= 7).all():  # the optimum is proven by its multipliers
            assert multipliers @ offsets[basis - 7] == pytest.approx(point[3], abs=1e-12)
            assert np.abs(multipliers @ normals[basis - 7]).max() < 1e-12


def planes_of(make):
    return HalfSpaces.from_mesh(voxkernel.as_mesh(make()))


@pytest.mark.parametrize("make", [shapes.spiky, shapes.torus])
def test_passes_over_all_planes(make, rng):
    planes = planes_of(make)
    arrays = planes.local_normals, planes.local_offsets, planes.local_errors
    ids, slacks = np.empty(N_BINS, np.int64), np.empty(N_BINS)
    for _ in range(5):
        point = rng.uniform(-0.5, 0.5, 3)
        smallest, certain, where = tightest_by_direction(*arrays, point, np.inf, ids, slacks)
        slack = planes.local_offsets - planes.local_normals @ point
        assert smallest == pytest.approx(slack.min(), abs=1e-15)
        assert where == slack.argmin()
        assert certain < smallest
        assert where in ids
        used = ids[ids >= 0]
        assert np.allclose(slacks[ids >= 0], slack[used], atol=1e-15)
        undecided = np.empty(len(planes), np.int64)
        count = plane_signs(*arrays, point, 0.0, undecided)
        outside = np.flatnonzero(slack <= 0)
        assert set(outside.tolist()) <= set(undecided[:count].tolist())
        assert (slack[undecided[:count]] < 1e-12).all()


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
