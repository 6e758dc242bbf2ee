"""Rational linear programs and clipping, against answers known by hand and brute force."""

from fractions import Fraction
from itertools import combinations, pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from rational_cutting import clip_polyhedron

from voxkernel.exact.rational_clipping import clip_interval, clip_polygon
from voxkernel.halfspaces.rational_program import (
    as_integers,
    deepest_rational_point,
    kernel_of_rows,
    rank_of,
    solve_rational,
)

CUBE = [((1, 0, 0), 1), ((-1, 0, 0), 1), ((0, 1, 0), 1), ((0, -1, 0), 1), ((0, 0, 1), 1), ((0, 0, -1), 1)]


def rows_of(rows):
    return [(n, Fraction(d)) for n, d in rows]


def test_cube_has_its_centre_deepest():
    best = deepest_rational_point(rows_of(CUBE), 3, unit=Fraction(100))
    assert best.clearance > 0
    # The three pairs of faces are equally tight at the centre only where the multipliers say so.
    assert all(m > 0 for m in best.multipliers.values())


def test_touching_planes_have_no_clearance():
    best = deepest_rational_point(rows_of([((1, 0, 0), 0), ((-1, 0, 0), 0)]), 3)
    assert best.clearance == 0
    assert sum(m * n for m, n in zip(best.multipliers.values(), (1, -1), strict=True)) == 0


def test_parted_planes_give_a_farkas_witness():
    best = deepest_rational_point(rows_of([((1, 0, 0), 0), ((-1, 0, 0), -1)]), 3)
    assert best.clearance < 0
    assert set(best.multipliers) == {0, 1}


def test_far_away_wedge_is_found():
    """Two nearly parallel planes meet 10**12 units away: the search has to leave its first simplex."""
    n = 10**12
    best = deepest_rational_point(rows_of([((1, n), 0), ((-1, -n + 1), -1)]), 2)
    assert best.clearance > 0
    assert abs(best.point[1]) > 0 or abs(best.point[0]) > 0
    for (a, b), d in [((1, n), 0), ((-1, -n + 1), -1)]:
        assert a * best.point[0] + b * best.point[1] < d


small = st.integers(-4, 4)


@given(st.lists(st.tuples(st.tuples(small, small), small), min_size=1, max_size=7))
def test_sign_agrees_with_brute_force(rows):
    """In the plane: a strict common point exists iff no point, pair or triple of rows forbids it."""
    rows = [(n, d) for n, d in rows if any(n)]
    assume(rows)
    best = deepest_rational_point(rows_of(rows), 2)
    assert (best.clearance > 0) == _has_interior(rows)
    worst = max(a * best.point[0] + b * best.point[1] - d for (a, b), d in rows)
    assert best.clearance < 0 or worst <= 0


def _has_interior(rows):
    """Candidates: arrangement vertices of all lines and of lines far away; midpoints of triples are interior points."""
    box = [((1, 0), 1000), ((-1, 0), 1000), ((0, 1), 1000), ((0, -1), 1000)]
    lines = rows + box
    corners = []
    for ((a, b), d), ((e, f), g) in combinations(lines, 2):
        det = a * f - b * e
        if det:
            p = Fraction(d * f - b * g, det), Fraction(a * g - d * e, det)
            if all(u * p[0] + v * p[1] <= w for (u, v), w in lines):
                corners.append(p)
    for triple in combinations(corners, 3):
        m = sum(p[0] for p in triple) / 3, sum(p[1] for p in triple) / 3
        if all(u * m[0] + v * m[1] < w for (u, v), w in rows):
            return True
    return False


def test_solve_and_rank():
    f = Fraction
    assert solve_rational([[f(2), f(1)], [f(1), f(3)]], [f(5), f(10)]) == [1, 3]
    assert solve_rational([[f(1), f(2)], [f(2), f(4)]], [f(1), f(1)]) is None
    assert rank_of([]) == 0
    assert rank_of([(0, 0, 0), (2, 4, 6), (1, 2, 3)]) == 1
    assert rank_of([(1, 0, 0), (0, 1, 0), (1, 1, 0)]) == 2
    assert as_integers([f(1, 2), f(-1, 3)]) == [3, -2]


@given(st.lists(st.tuples(small, small, small), max_size=4))
def test_kernel_of_rows_is_the_orthogonal_space(rows):
    directions = kernel_of_rows(rows)
    assert len(directions) == 3 - rank_of(rows)
    assert rank_of(directions) == len(directions)
    for row in rows:
        for w in directions:
            assert sum(a * b for a, b in zip(row, w, strict=True)) == 0


def test_clip_interval():
    found = clip_interval([((2,), Fraction(3)), ((-1,), Fraction(1)), ((1,), Fraction(9))], Fraction(100))
    assert found.vertices == [(-1,), (Fraction(3, 2),)]
    assert [r for r, _ in found.faces] == [1, 0]
    open_end = clip_interval([((1,), Fraction(0))], Fraction(100))
    assert open_end.faces[0][0] == -1


def test_clip_polygon_through_a_corner():
    """A line through two corners of the square leaves a triangle with no doubled corner."""
    square = [((1, 0), Fraction(1)), ((-1, 0), Fraction(1)), ((0, 1), Fraction(1)), ((0, -1), Fraction(1))]
    found = clip_polygon([*square, ((1, 1), Fraction(0))], Fraction(10))
    assert sorted(found.vertices) == [(-1, -1), (-1, 1), (1, -1)]
    assert {r for r, _ in found.faces} == {1, 3, 4}


@pytest.mark.parametrize(
    ("plane", "volume"),
    [(((1, 1, 1), 0), 4), (((1, 1, 1), 3), 8), (((1, 1, 1), 2), Fraction(47, 6)), (((1, 0, 0), 0), 4)],
)
def test_clip_polyhedron_of_a_cube(plane, volume):
    """The cube [-1, 1]^3 cut by one plane: half of it, a corner touched, a corner cut off, half of it."""
    found = clip_polyhedron(rows_of([*CUBE, plane]), Fraction(50))
    assert all(r >= 0 for r, _ in found.faces)
    total = Fraction(0)
    for _, ring in found.faces:
        for j, k in pairwise(ring[1:]):
            a, b, c = (found.vertices[i] for i in (ring[0], j, k))
            total += (
                a[0] * (b[1] * c[2] - b[2] * c[1])
                - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
            )
    assert total / 6 == volume
    edges = [(a, b) for _, f in found.faces for a, b in zip(f, f[1:] + f[:1], strict=True)]
    assert {(b, a) for a, b in edges} == set(edges)
