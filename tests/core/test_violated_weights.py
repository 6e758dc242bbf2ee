"""What points violate, and which facets turn their back to a point, next to fractions."""

from fractions import Fraction

import numpy as np
import pytest
import shapes
from hypothesis import given
from hypothesis import strategies as st

import voxkernel
from voxkernel._core import faces_away, violated_weights
from voxkernel.halfspaces import HalfSpaces
from voxkernel.relaxed.facet_weights import weigh


def side(a, b, c, p):
    """Sign of the point above the triangle, exact."""
    a, b, c, p = ([Fraction(float(v)) for v in q] for q in (a, b, c, p))
    u, v, w = ([x - y for x, y in zip(q, a, strict=True)] for q in (b, c, p))
    det = (u[1] * v[2] - u[2] * v[1]) * w[0] + (u[2] * v[0] - u[0] * v[2]) * w[1] + (u[0] * v[1] - u[1] * v[0]) * w[2]
    return (det > 0) - (det < 0)


def run(planes, points, by_expansions=True, order=None, sums=None):
    facets = planes.facets
    order = np.arange(len(points)) if order is None else order
    sums = np.full(len(points), -1) if sums is None else sums
    pairs = violated_weights(
        np.ascontiguousarray(facets.to_local(points).T), points, facets.local_normals, facets.local_offsets,
        facets.local_errors, planes.weights, facets.corner_ids(), facets.vertices, by_expansions, order, sums,
    )  # fmt: skip
    return pairs, order, sums


@pytest.fixture(scope="module")
def cube():
    return weigh(HalfSpaces.from_mesh(voxkernel.as_mesh(shapes.cube())))


def expected_sums(planes, points):
    v, ids = planes.facets.vertices, planes.facets.corner_ids()
    return [
        sum(int(w) for w, (a, b, c) in zip(planes.weights, ids, strict=True) if side(v[a], v[b], v[c], p) > 0)
        for p in points
    ]


@pytest.mark.parametrize("make", [shapes.cube, shapes.star_prism, lambda: shapes.spiky(1)])
def test_sums_are_exact(make, rng):
    """Corners, points of facets and points one bit beside them: on a plane is not beyond it."""
    mesh = voxkernel.as_mesh(make())
    planes, v = weigh(HalfSpaces.from_mesh(mesh)), mesh.vertices
    middles = v[mesh.faces].mean(axis=1)
    near = np.concatenate([v, middles, np.nextafter(middles, 9.0), rng.normal(size=(60, 3))])
    near = np.ascontiguousarray(near[:: 1 + len(near) // 60])
    pairs, order, sums = run(planes, near)
    assert len(pairs) == 0
    assert sorted(order) == list(range(len(near)))
    assert sums.tolist() == expected_sums(planes, near)


def test_open_pairs_are_the_planes_within_rounding(cube):
    """Without expansions a sign on a plane is left to the caller; what is certain is added up all the same."""
    points = np.array([[1.0, 0.5, 0.5], [2.0, 0.5, 0.5], [0.5, 0.5, 0.5]])
    pairs, _, sums = run(cube, points, by_expansions=False)
    normals = cube.facets.normals
    assert [(p, normals[i].tolist()) for p, i in pairs] == [(0, [1.0, 0.0, 0.0])]
    assert sums.tolist() == expected_sums(cube, points)


def test_only_the_points_of_the_order(cube):
    points = np.array([[2.0, 0.5, 0.5]] * 5)
    _, _, sums = run(cube, points, order=np.array([3, 1]))
    assert (sums >= 0).tolist() == [False, True, False, True, False]


def test_many_points_and_no_points(cube, rng):
    """Enough points to be divided many times, repeated ones among them."""
    points = np.concatenate([rng.integers(-2, 4, (3000, 3)) / 2.0, np.zeros((100, 3))])
    _, _, sums = run(cube, points)
    distinct, back = np.unique(points, axis=0, return_inverse=True)
    assert (sums == np.array(expected_sums(cube, distinct))[back.ravel()]).all()
    assert run(cube, np.empty((0, 3)))[2].size == 0


@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=4, max_size=4))
def test_faces_away(points):
    a, b, c, p = (np.array(q, float) for q in points)
    away = faces_away(np.array([a, b, c]), np.array([[0, 1, 2], [0, 2, 1]]), p)
    assert away.dtype == bool
    assert away.tolist() == [side(a, b, c, p) > 0, side(a, c, b, p) > 0]


def test_no_faces():
    assert faces_away(np.zeros((3, 3)), np.empty((0, 3), np.int64), np.zeros(3)).shape == (0,)


def test_arrays_are_not_converted(cube):
    points = np.zeros((4, 3))
    locked = np.zeros(4, np.int64)
    locked.flags.writeable = False
    for wrong in ({"sums": locked}, {"order": locked}, {"sums": np.zeros(4)}, {"order": np.arange(8)[::2]}):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            run(cube, points, **wrong)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        faces_away(np.zeros((3, 3)), np.zeros((1, 3), np.int32), np.zeros(3))


def test_few_points_and_more_planes_than_a_block(rng):
    """Of few points planes are taken a block at a time: the sums are those of many points at once."""
    mesh = voxkernel.as_mesh(shapes.spiky(6))
    assert len(mesh.faces) > 2 * 8192
    planes, v = weigh(HalfSpaces.from_mesh(mesh)), mesh.vertices
    middles = v[mesh.faces[:: len(mesh.faces) // 20]].mean(axis=1)
    points = np.ascontiguousarray(np.concatenate([v[:20], middles, rng.normal(size=(20, 3))]))
    many = run(planes, points)[2]
    for n in (1, 2, 12):
        few = [run(planes, points[first : first + n])[2] for first in range(0, len(points), n)]
        np.testing.assert_array_equal(np.concatenate(few), many)
    pairs = run(planes, points[:1], by_expansions=False)[0]
    assert len(pairs) > 0
    assert {tuple(pair) for pair in pairs} <= {(0, row) for row in range(len(planes.weights))}
    at_corner = (planes.facets.corner_ids() == 0).any(axis=1)
    assert set(np.flatnonzero(at_corner)) <= set(pairs[:, 1])
