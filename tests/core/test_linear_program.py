"""Edges, coplanar groups, linear programs and passes over planes next to twins in NumPy or SciPy."""

import numpy as np
import pytest
import shapes
from scipy.optimize import linprog

import voxkernel
from voxkernel._core import (
    N_BINS,
    coplanar_groups,
    deepest_point,
    edge_convexity,
    find_deep_point,
    halfedge_twins,
    plane_signs,
    tightest_by_direction,
)
from voxkernel.halfspaces import HalfSpaces


def test_twins_at_a_vertex_of_high_degree():
    n = 200
    twins = halfedge_twins(np.concatenate(shapes.two_fans(n)), n + 2)
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
    """Facets of a cube cut in four: six groups, each named by its first facet; explicit planes stay alone."""
    planes = planes_of(lambda: shapes.subdivided(*shapes.cube())).with_planes([[1, 0, 0], [1, 0, 0]], [5, 5])
    groups = coplanar_groups(planes.local_normals, planes.local_offsets, planes.vertices, planes.corner_ids())
    _, first, named = np.unique(planes.local_normals[:-2], axis=0, return_index=True, return_inverse=True)
    assert (groups[:-2] == first[named.ravel()]).all()
    assert groups[-2:].tolist() == [len(planes) - 2, len(planes) - 1]


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
        lambda: halfedge_twins(np.zeros((1, 3), np.int32), 3),
    ):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            bad()
