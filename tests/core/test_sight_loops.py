"""The compiled loops of sight, beside plain NumPy, rationals and known answers."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
import shapes

from voxkernel._core import (
    SightTree,
    StopFlag,
    certify_sight,
    clearances,
    first_hits,
    nearest_points,
    pairs_see,
    points_see,
    winding_numbers,
)


def soup(rng, n=40):
    vertices = rng.normal(size=(3 * n, 3))
    return vertices, np.arange(3 * n).reshape(-1, 3)


def tree_of(mesh):
    return SightTree(np.ascontiguousarray(mesh[0], dtype=np.float64), np.ascontiguousarray(mesh[1]))


def signed(a, b, c, d):
    u, v, w = ([Fraction(float(x)) - Fraction(float(y)) for x, y in zip(p, a, strict=True)] for p in (b, c, d))
    return sum(w[i] * (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]) for i in range(3))


def is_between(triangle, start, end):
    """Whether a triangle meets the inside of a segment, in rationals; touching counts."""
    a, b, c = triangle
    one, two = signed(a, b, c, start), signed(a, b, c, end)
    if one * two >= 0:
        return False
    turns = [signed(start, end, p, q) for p, q in ((a, b), (b, c), (c, a))]
    return min(turns) >= 0 or max(turns) <= 0


def test_points_and_pairs_see_what_rationals_see(rng):
    mesh = soup(rng, 20)
    tree = tree_of(mesh)
    points = rng.normal(size=(4, 3))
    faces = rng.integers(0, 20, 90)
    spots = np.einsum("ik,ikj->ij", rng.dirichlet([1, 1, 1], 90), mesh[0][mesh[1][faces]])
    words = np.zeros((4, 2), np.uint64)
    points_see(tree, points, spots, faces, words.reshape(-1))
    bits = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little").astype(bool)
    assert not bits[:, 90:].any()
    expected = np.array([
        [
            signed(*mesh[0][mesh[1][f]], p) < 0
            and not any(g != f and is_between(mesh[0][mesh[1][g]], p, q) for g in range(20))
            for q, f in zip(spots, faces, strict=True)
        ]
        for p in points
    ])
    assert expected.any()
    assert not expected.all()
    assert np.array_equal(bits[:, :90], expected)
    seen = np.zeros(90, bool)
    for point, row in zip(points, expected, strict=True):
        pairs_see(tree, np.tile(point, (90, 1)), spots, faces, seen)
        assert np.array_equal(seen, row)


def test_bits_are_added_to_those_that_are_set():
    vertices, faces = shapes.cube()
    bottom = int(np.flatnonzero((vertices[faces][:, :, 2] == 0).all(axis=1))[0])
    spots = np.tile(vertices[faces[bottom]].mean(axis=0), (66, 1))
    words = np.array([0, 4], np.uint64)
    points_see(tree_of((vertices, faces)), np.full((1, 3), 0.5), spots, np.full(66, bottom), words)
    assert words.tolist() == [2**64 - 1, 7]


def test_rays_through_an_edge_of_two_triangles_are_not_let_through():
    """A wall of two triangles under a roof: rays parallel to an axis that meet their common edge, one, and none."""
    vertices = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 1], [3, 0, 1], [0, 3, 1]], np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]])  # what the roof hides nothing of is below it
    spots = np.array([[1, 1, 1], [0.5, 0.5, 1], [0.5, 1, 1], [0.25, 2.5, 1]])
    seen = np.ones(4, bool)
    pairs_see(SightTree(vertices, faces), spots - [0, 0, 2], spots, np.full(4, 2), seen)
    assert seen.tolist() == [False, False, False, True]
    pairs_see(SightTree(vertices, faces), spots - [0, 0, 0.5], spots, np.full(4, 2), seen)
    assert seen.all()
    pairs_see(SightTree(vertices, faces), spots - [0, 0, -2], spots, np.full(4, 2), seen)
    assert not seen.any()  # from its outer side


def test_first_hits_beside_all_triangles(rng):
    mesh = soup(rng)
    starts, along = rng.normal(size=(60, 3)), rng.normal(size=(60, 3))
    skip = rng.integers(0, 40, 60)
    at = np.empty(60)
    first_hits(tree_of(mesh), starts, along, skip, at)
    a, b, c = (mesh[0][mesh[1][:, k]] for k in range(3))
    for i in range(60):
        nearest = np.inf
        for f in range(40):
            if f == skip[i]:
                continue
            x, y, t = np.linalg.solve(np.column_stack([b[f] - a[f], c[f] - a[f], -along[i]]), starts[i] - a[f])
            if min(x, y, 1 - x - y) >= 0 and t > 0:
                nearest = min(nearest, t)
        assert at[i] == pytest.approx(nearest, rel=1e-9)
    assert np.isinf(at).any()
    assert np.isfinite(at).any()


def turned(mesh):
    return mesh[0], mesh[1][:, ::-1].copy()


@pytest.mark.parametrize(
    ("mesh", "point", "turns"),
    [
        (shapes.cube(), (0.5, 0.4, 0.3), 1),
        (shapes.cube(), (1.5, 0.4, 0.3), 0),
        (turned(shapes.cube()), (0.5, 0.4, 0.3), -1),
        (shapes.joined(shapes.box((0, 0, 0), (3, 3, 3)), shapes.box((1, 1, 1), (2, 2, 2))), (1.5, 1.4, 1.3), 2),
        (shapes.joined(shapes.box((0, 0, 0), (3, 3, 3)), turned(shapes.box((1, 1, 1), (2, 2, 2)))), (1.5, 1.4, 1.3), 0),
    ],
)
def test_winding_numbers(mesh, point, turns):
    found = np.empty(1, np.int64)
    winding_numbers(tree_of(mesh), np.array([point]), found)
    assert found.tolist() == [turns]


@pytest.mark.parametrize("side", range(6))
@pytest.mark.parametrize("size", [(1, 1, 1), (0.2, 1, 1), (1, 0.2, 1), (1, 1, 0.2)])
def test_two_of_three_rays_decide_where_one_leaves_through_a_hole(size, side):
    """Of a box without one of its sides at most one of the three rays leaves through the hole, or two do."""
    half = 0.5 * np.array(size)
    vertices, faces = shapes.box(-half, half)
    axis, sign = side % 3, 1.0 if side < 3 else -1.0
    open_box = faces[~(vertices[faces][:, :, axis] == sign * half[axis]).all(axis=1)]
    assert len(open_box) == 10
    along = np.array([[0.5390219, 0.3361527, 0.7722981], [-0.6130243, 0.7133871, 0.3396417],
                      [0.2816553, -0.8811427, 0.3798143]])  # fmt: skip
    exits = (np.abs(half / along)).argmin(axis=1)
    through = [e == axis and np.sign(d[e]) == sign for e, d in zip(exits, along, strict=True)]
    found = np.empty(1, np.int64)
    winding_numbers(SightTree(vertices, open_box), np.zeros((1, 3)), found)
    assert found[0] == (0 if sum(through) >= 2 else 1)


def nearest_of(p, a, b, c):
    """The nearest point of a triangle: of its plane if that is within, else of its edges."""
    u, v = b - a, c - a
    x, y = np.linalg.lstsq(np.column_stack([u, v]), p - a, rcond=None)[0]
    if min(x, y, 1 - x - y) >= 0:
        return a + x * u + y * v
    ends = []
    for s, e in ((a, b), (b, c), (c, a)):
        t = np.clip((p - s) @ (e - s) / ((e - s) @ (e - s)), 0, 1)
        ends.append(s + t * (e - s))
    return min(ends, key=lambda q: np.linalg.norm(q - p))


def test_nearest_points_and_clearances_beside_all_triangles(rng):
    """One triangle has seven regions of nearest points; many have a tree."""
    for n, n_points in ((1, 250), (12, 80)):
        mesh = soup(rng, n)
        points = 3.0 * rng.normal(size=(n_points, 3))
        places, sizes, below = np.empty((n_points, 3)), np.empty(n_points), np.empty(n_points)
        nearest_points(tree_of(mesh), points, places, sizes)
        clearances(tree_of(mesh), points, below)
        triangles = mesh[0][mesh[1]]
        for p, place, size, low in zip(points, places, sizes, below, strict=True):
            best = min((nearest_of(p, *t) for t in triangles), key=lambda q: np.linalg.norm(q - p))
            assert np.linalg.norm(best - p) == pytest.approx(size, rel=1e-9)
            assert np.linalg.norm(place - p) == pytest.approx(size, rel=1e-9)
            assert low <= size * (1 + 1e-12)
            assert low > 0.0 or size < 0.9  # of slivers only their height is lost


def test_clearance_above_the_middle_of_a_triangle_is_that_of_its_plane():
    below = np.empty(1)
    tree = tree_of(([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]]))
    clearances(tree, np.array([[1.0, 1.0, 0.5]]), below)
    assert below[0] == pytest.approx(0.5, rel=1e-12)


def lit(depth, order=(0, 1), guards=((1.0, 1.0, 4.0), (1.0, 1.0, -4.0)), subset=(0,)):
    """A floor of area 32, and half-way to the first guard a triangle of area 0.5, whose shadow is 4 times as large."""
    vertices = np.array([[0, 0, 0], [8, 0, 0], [0, 8, 0], [1, 1, 2], [2, 1, 2], [1, 2, 2]], np.float64)
    faces = np.array([[0, 2, 1], [3, 4, 5]])
    tree = SightTree(vertices, faces)
    ids = np.array(subset, np.int64)
    rows = np.tile(np.array(order, np.int64), len(ids))
    return certify_sight(tree, np.array(guards), ids, rows, np.full(len(ids), depth))


def test_cuts_close_in_on_a_shadow_and_stop_in_the_dark():
    shares = []
    for depth in range(9):
        faces, points, depths, weights, corners = lit(depth)
        assert (faces == 0).all()
        assert (points == 0).all()  # the other one is behind the floor
        assert (weights.reshape(-1, 3, 3).sum(axis=2) == 2 ** depths[:, None]).all()
        area = 32.0 * (0.25**depths).sum()
        assert area <= 30.0  # all but the shadow
        shares.append(area)
        centers = corners.reshape(-1, 3, 3).mean(axis=1)
        assert not ((centers[:, :2] > 1).all(axis=1) & (centers[:, :2].sum(axis=1) < 4)).any()
    assert all(a <= b for a, b in pairwise(shares))
    assert shares[8] > 29.7
    assert shares[3] == pytest.approx(30, abs=3)


def test_the_first_that_sees_a_facet_gets_it():
    under = ((1.0, 1.0, 1.0), (2.0, 2.0, 1.0))  # nothing is between these and the floor
    assert lit(6, (0, 1), under)[1].tolist() == [0]
    assert lit(6, (1, 0), under)[1].tolist() == [1]
    over = ((1.0, 1.0, 4.0), (2.0, 2.0, 1.0))
    assert lit(6, (0, 1), over)[1].tolist() == [1]  # the whole goes before parts
    assert len(lit(6, (0, 1), over, subset=())[0]) == 0


def test_each_facet_has_its_own_depth():
    mesh = shapes.l_prism()
    tree = tree_of(mesh)
    point = mesh[0].mean(axis=0)[None] + 0.01
    ids = np.arange(len(mesh[1]))
    shallow = certify_sight(tree, point, ids, np.zeros(len(ids), np.int64), np.zeros(len(ids), np.int64))
    open_ids = np.setdiff1d(ids, shallow[0])
    for face in open_ids:
        deep = np.zeros(len(ids), np.int64)
        deep[face] = 3
        found = certify_sight(tree, point, ids, np.zeros(len(ids), np.int64), deep)
        assert set(found[2][found[0] != face].tolist()) <= {0}
        assert (found[2][found[0] == face] <= 3).all()


def test_a_guard_on_the_plane_of_a_facet_does_not_see_it():
    vertices, faces = shapes.cube()
    tree = tree_of((vertices, faces))
    found = certify_sight(tree, np.array([[0.5, 0.5, 0.0]]), np.arange(12), np.zeros(12, np.int64), np.full(12, 2))
    bottom = np.flatnonzero((vertices[faces][:, :, 2] == 0).all(axis=1))
    assert sorted(set(found[0].tolist())) == sorted(set(range(12)) - set(bottom.tolist()))
    assert (found[2] == 0).all()


def test_a_flag_stops_each_loop(rng):
    """Each takes longer than the pause between two looks at the flag, and ends at the first one."""
    vertices, faces = shapes.icosphere(4)
    tree = tree_of((vertices, faces))
    stop = StopFlag()
    stop.set()
    n, m = 100_000, len(faces)
    points = rng.normal(size=(n, 3))
    near = np.ascontiguousarray(0.1 * points)
    ids = rng.integers(0, m, n)
    spots = np.ascontiguousarray(vertices[faces[ids]].mean(axis=1))
    words = np.zeros(400 * -(-n // 64), np.uint64)
    calls = [
        lambda: points_see(tree, near[:400], spots, ids, words, stop),
        lambda: pairs_see(tree, np.tile(near, (10, 1)), np.tile(spots, (10, 1)), np.tile(ids, 10),
                          np.zeros(10 * n, bool), stop),
        lambda: nearest_points(tree, points, np.empty((n, 3)), np.empty(n), stop),
        lambda: clearances(tree, points, np.empty(n), stop),
        lambda: certify_sight(tree, near[:9], ids, np.tile(np.arange(9), n), np.full(n, 3), stop),
    ]  # fmt: skip
    for call in calls:
        with pytest.raises(KeyboardInterrupt):
            call()


def test_trees_of_equal_boxes_and_of_one_triangle(rng):
    """Nothing tells equal triangles apart: they are halved."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float64)
    tree = SightTree(vertices, np.tile([[0, 1, 2]], (100, 1)))
    at = np.empty(1)
    first_hits(tree, np.array([[0.2, 0.2, 1.0]]), np.array([[0, 0, -0.5]]), np.array([7]), at)
    assert at[0] == 2.0
    one = SightTree(vertices, np.array([[0, 1, 2]]))
    first_hits(one, np.array([[0.2, 0.2, 1.0]]), np.array([[0, 0, -0.5]]), np.array([0]), at)
    assert np.isinf(at[0])
    doubling = np.concatenate([vertices * 2.0**-k for k in range(200)])  # deeper than cuts by area may go
    tree = SightTree(doubling, np.arange(600).reshape(-1, 3))
    first_hits(tree, np.array([[2.0**-150, 2.0**-150, 1.0]]), np.array([[0, 0, -1.0]]), np.array([-1]), at)
    assert at[0] == 1.0
