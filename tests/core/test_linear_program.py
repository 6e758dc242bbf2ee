"""Edges, coplanar groups, linear programs and passes over planes next to twins in NumPy or SciPy."""

import math

import numpy as np
import pytest
import shapes
from scipy.optimize import linprog

import voxkernel
from voxkernel._core import (
    N_BINS,
    deepest_point,
    edge_convexity,
    find_deep_point,
    plane_signs,
    tightest_by_direction,
)
from voxkernel.halfspaces import HalfSpaces


def convexity_of(vertices, faces, least=1):
    return edge_convexity(vertices, faces, np.arange(len(faces)), faces, least)


@pytest.mark.parametrize(
    ("make", "expected"),
    [(shapes.icosphere, 2), (shapes.cube, 1), (shapes.l_prism, 0), (shapes.torus, 0), (shapes.open_box, 0)],
)
def test_edge_convexity(make, expected):
    vertices, faces = make()
    assert convexity_of(vertices, faces) == expected
    assert convexity_of(vertices, faces, 2) == (2 if expected == 2 else 0)


def test_edges_at_vertices_of_high_degree(rng):
    """Two fans about an axis, a double pyramid over a circle: strictly convex; turned over, or with a hole, not."""
    n = 200
    turn = 2 * np.pi * np.arange(n) / n
    circle = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    vertices = np.concatenate([[[0, 0, 0.7]], circle, [[0, 0, -0.5]]])
    faces = np.concatenate(shapes.two_fans(n))
    surfaces = faces, rng.permutation(faces), faces[:, ::-1].copy(), faces[1:]
    assert [convexity_of(vertices, f) for f in surfaces] == [2, 2, 0, 0]


@pytest.mark.parametrize("n", [4, 40, 400])
def test_deepest_point_is_that_of_highs(n, rng):
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for shift in (1.0, -0.2):
        offsets = rng.uniform(0.5, 1, n) * shift + normals @ rng.uniform(-0.3, 0.3, 3)
        basis, multipliers, point = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
        assert deepest_point(normals, offsets, np.arange(n), 4.0, basis, multipliers, point, 1e-14, 500) >= 0
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
        undecided = plane_signs(*arrays, point, 0.0)
        outside = np.flatnonzero(slack <= 0)
        assert set(outside.tolist()) <= set(undecided.tolist())
        assert (slack[undecided] < 1e-12).all()


def test_coplanar_groups_are_planes():
    """Facets of a cube cut in four: six groups, each named by its first facet; explicit planes join theirs."""
    planes = planes_of(lambda: shapes.subdivided(*shapes.cube()))
    side = planes.offsets[0], planes.normals[0]  # axis-aligned: as exact as the facet
    planes = planes.with_planes([[1, 2, 0], [-2, -4, 0], [2, 4, 0], 3 * side[1]], [5, -10, 10, 3 * side[0]])
    groups = planes.coplanar_groups()
    _, first, named = np.unique(planes.local_normals[:-4], axis=0, return_index=True, return_inverse=True)
    assert (groups[:-4] == first[named.ravel()]).all()
    n = len(planes)
    assert groups[-4:].tolist() == [n - 4, n - 3, n - 4, 0]
    # The planes of facets of a cone go through the origin, whatever their corners say.
    cone = planes.recession_cone().with_planes([3 * side[1]], [7.0]).coplanar_groups()
    assert (cone[:-5] == groups[:-4]).all()
    assert cone[-1] == n  # though the same plane is that of a facet before they were moved


@pytest.mark.parametrize("count", [1, 5, 30, 48])
def test_first_of_planes(count, rng):
    """The heads of the groups of some rows, which are those of the rows alone."""
    planes = planes_of(lambda: shapes.subdivided(*shapes.cube()))
    rows = np.sort(rng.permutation(len(planes))[:count])
    groups = planes.select(rows).coplanar_groups()
    assert planes.first_of_planes(rows).tolist() == rows[groups == np.arange(count)].tolist()


def exact_groups(planes):
    """The first half-space of each oriented plane, by integers without common divisor."""
    first = {}
    rows = enumerate(planes.integer_planes(range(len(planes))))
    return [first.setdefault(tuple(v // math.gcd(*p) for v in p), i) for i, p in rows]


@pytest.mark.parametrize("size", [1.0, 2.0**-190])
def test_no_coplanar_pair_is_missed_among_many_near_ones(rng, size):
    """Facets on 300 planes that differ in the last bits, some turned over, slender, or written as n, d."""
    unit = 2.0**-45
    tilts = rng.integers(-2, 3, (300, 3)) * unit
    ids = rng.integers(0, 300, 3000)
    xy = rng.integers(-64, 65, (3000, 3, 2)) / 64.0
    xy[::7, 2] = xy[::7, 1] + [[2.0**-7, 0]]  # slender
    z = tilts[ids, 0][:, None] * xy[..., 0] + tilts[ids, 1][:, None] * xy[..., 1] + (1 + tilts[ids, 2])[:, None]
    vertices = np.concatenate([xy, z[..., None]], axis=2).reshape(-1, 3) * size
    mesh = voxkernel.as_mesh((vertices, np.arange(9000).reshape(-1, 3)))
    planes = HalfSpaces.from_mesh(mesh)
    if size == 1.0:
        planes = planes.with_planes(np.column_stack([-tilts[:, :2], np.ones(300)]), 1 + tilts[:, 2])
    groups = planes.coplanar_groups()
    assert groups.tolist() == exact_groups(planes)
    assert len(np.unique(groups)) <= 2 * 125


def test_planes_whose_numbers_are_multiples_of_the_prime_are_grouped_too():
    """A facet in the plane z = 0 whose edges have the minor 2**30 2**31 - 1, the prime, among others there."""
    vertices = np.array([[0, 0, 0], [2.0**30, 1, 0], [1, 2.0**31, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    odd, plain, back, other = [0, 1, 2], [0, 3, 4], [0, 4, 3], [0, 3, 5]
    for faces in ([odd, plain, back, other, odd], [other, back, plain, odd, odd], [odd, odd], [back, odd, other]):
        planes = planes_of(lambda faces=faces: (vertices, faces))
        assert planes.coplanar_groups().tolist() == exact_groups(planes)


@pytest.mark.parametrize(("make", "is_solid"), [(shapes.cube, True), (shapes.spiky, True), (shapes.two_boxes, False)])
def test_a_deep_point_or_a_claim_that_there_is_none(make, is_solid):
    planes = planes_of(make)
    _, opposing, gap, depth, point, nearest, _ = find_deep_point(
        planes.local_normals, planes.local_offsets, planes.local_errors
    )
    slack = planes.local_offsets - planes.local_normals @ point
    assert (depth > 0, gap > 0, len(opposing) > 0, len(nearest) > 0) == (is_solid, *[not is_solid] * 3)
    if is_solid:
        assert depth == pytest.approx(slack.min(), abs=1e-15)


def test_arguments_of_the_wrong_kind():
    normals, offsets = np.eye(3), np.ones(3)
    fixed = np.zeros(4)
    fixed.flags.writeable = False
    basis, rows = np.array([1, 3, 5, 6]), np.arange(3)
    for bad in (
        lambda: deepest_point(normals, offsets, rows, 4.0, basis, np.zeros(4), fixed, 1e-14, 10),
        lambda: deepest_point(normals, offsets, rows.astype(np.int32), 4.0, basis, np.zeros(4), np.zeros(4), 0.0, 10),
        lambda: tightest_by_direction(normals, offsets, offsets, np.zeros(3), 1.0, np.zeros(3, np.int64), np.zeros(3)),
        lambda: plane_signs(normals.T, offsets, offsets, np.zeros(3), 0.0),
        lambda: plane_signs(normals.astype(np.float32), offsets, offsets, np.zeros(3), 0.0),
        lambda: edge_convexity(normals, np.zeros((1, 3), np.int32), rows, np.zeros((1, 3), np.int64)),
    ):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            bad()
