"""Linear programs in at most four unknowns, solved in rational arithmetic."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, isqrt, lcm

from voxkernel.errors import SolverError

__all__ = ["Optimum", "as_integers", "deepest_rational_point", "kernel_of_rows", "rank_of", "solve_rational"]

Row = tuple[Sequence[int], Fraction]  # normal . z <= bound
_BLAND_AFTER = 40
_MAX_STEPS = 4000


@dataclass(frozen=True, slots=True)
class Optimum:
    """Where `normal . z + t |normal| <= bound` has its largest t.

    `multipliers` are >= 0, one per row, with sum(l * normal) = 0; where t < 0 they also give
    sum(l * bound) < 0: no point satisfies the rows whose multiplier is positive.
    """

    clearance: Fraction  # only its sign has a meaning: normals are scaled by integers near their length
    point: tuple[Fraction, ...]
    multipliers: dict[int, Fraction]


def deepest_rational_point(rows: Sequence[Row], dimension: int, *, unit: Fraction | None = None) -> Optimum:
    """Maximise the clearance of `rows` over z in Q^dimension, up to one `unit` of length.

    The search starts inside a large simplex. Where the answer leans on that simplex it is asked again
    in a larger one, and at last in one so large (Hadamard's bound) that no vertex of the problem
    lies outside it, so that an optimum that leans on it cannot be negative.
    """
    if unit is None:
        unit = Fraction(1)
    bits = max(
        max((abs(v).bit_length() for normal, _ in rows for v in normal), default=1),
        max((abs(b.numerator).bit_length() + b.denominator.bit_length() for _, b in rows), default=1),
    )
    last = 1 << (2 * (dimension + 2) * (bits + 8))
    for size in (16, 2**40, 2**120, 2**400, last):
        reach = unit * min(size, last)
        optimum, leans = _search(rows, dimension, unit, reach)
        if optimum.clearance > 0 or not leans:
            return optimum
    return optimum


def _search(rows: Sequence[Row], dimension: int, unit: Fraction, reach: Fraction) -> tuple[Optimum, bool]:
    """Run a dual simplex in rationals inside a simplex of size `reach`; say whether the optimum leans on it."""
    size = dimension + 1
    lengths = [isqrt(sum(v * v for v in normal)) + 1 for normal, _ in rows]
    normals: list[tuple[int, ...]] = [tuple(-int(j == k) for j in range(dimension)) for k in range(dimension)]
    normals.append((1,) * dimension)
    scales = [1] * size
    bounds = [reach] * size
    normals.append((0,) * dimension)
    scales.append(1)
    bounds.append(unit)
    for (normal, bound), length in zip(rows, lengths, strict=True):
        normals.append(tuple(normal))
        scales.append(length)
        bounds.append(Fraction(bound))
    target = [Fraction(0)] * dimension + [Fraction(1)]
    basis = list(range(size))
    for step in range(_MAX_STEPS):
        columns = [[*map(Fraction, normals[j]), Fraction(scales[j])] for j in basis]
        primal = solve_rational(columns, [bounds[j] for j in basis])
        dual = solve_rational(_transposed(columns), target)
        if primal is None or dual is None:
            raise SolverError("the exact linear program met a singular basis")
        *z, t = primal
        entering, worst = -1, Fraction(0)
        for i in range(len(normals)):
            excess = (
                sum((n * v for n, v in zip(normals[i], z, strict=True) if n), Fraction(0))
                + scales[i] * t
                - bounds[i]
            )
            if excess > 0:
                excess /= scales[i]
                if excess > worst:
                    entering, worst = i, excess
                    if step > _BLAND_AFTER:
                        break
        if entering < 0:
            first = size + 1
            used = {j: m for j, m in zip(basis, dual, strict=True) if m > 0}
            optimum = Optimum(t, tuple(z), {j - first: m for j, m in used.items() if j >= first})
            return optimum, any(j < size for j in used)
        change = solve_rational(
            _transposed(columns), [*map(Fraction, normals[entering]), Fraction(scales[entering])]
        )
        if change is None:
            raise SolverError("the exact linear program met a singular basis")
        candidates = [(v / c, basis[j], j) for j, (v, c) in enumerate(zip(dual, change, strict=True)) if c > 0]
        if not candidates:
            raise SolverError("the exact linear program is unbounded in its dual")
        basis[min(candidates)[2]] = entering
    raise SolverError(f"the exact linear program did not end after {_MAX_STEPS} steps")


def kernel_of_rows(rows: Sequence[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Return integer vectors that span the directions orthogonal to all `rows` in 3D."""
    independent = _independent_rows(rows)
    if not independent:
        return [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    if len(independent) == 1:
        a = independent[0]
        axis = min(range(3), key=lambda k: abs(a[k]))
        unit = tuple(int(k == axis) for k in range(3))
        first = _primitive(_cross(a, unit))
        return [first, _primitive(_cross(a, first))]
    if len(independent) == 2:
        return [_primitive(_cross(independent[0], independent[1]))]
    return []


def rank_of(rows: Iterable[Sequence[int]]) -> int:
    """Return the rank of integer vectors in 3D."""
    return len(_independent_rows(rows))


def solve_rational(matrix: Sequence[Sequence[Fraction]], right: Sequence[Fraction]) -> list[Fraction] | None:
    """Solve a square rational system by elimination; None when singular."""
    n = len(right)
    rows = [[*line, value] for line, value in zip(matrix, right, strict=True)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if rows[i][k] != 0), None)
        if pivot is None:
            return None
        rows[k], rows[pivot] = rows[pivot], rows[k]
        head = rows[k]
        for i in range(n):
            if i != k and rows[i][k] != 0:
                f = rows[i][k] / head[k]
                rows[i] = [u - f * v if v else u for u, v in zip(rows[i], head, strict=True)]
    return [rows[k][n] / rows[k][k] for k in range(n)]


def as_integers(values: Sequence[Fraction]) -> list[int]:
    """Scale rationals by a positive factor to integers without common divisor."""
    denominator = lcm(*(v.denominator for v in values)) if values else 1
    integers = [int(v * denominator) for v in values]
    divisor = gcd(*integers) if integers else 1
    return [v // divisor for v in integers] if divisor else integers


def _transposed(matrix: list[list[Fraction]]) -> list[list[Fraction]]:
    return [list(column) for column in zip(*matrix, strict=True)]


def _cross(a: Sequence[int], b: Sequence[int]) -> tuple[int, int, int]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _primitive(a: Sequence[int]) -> tuple[int, int, int]:
    divisor = gcd(*a) or 1
    return a[0] // divisor, a[1] // divisor, a[2] // divisor


def _independent_rows(rows: Iterable[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Pick up to three linearly independent rows."""
    chosen: list[tuple[int, int, int]] = []
    for row in rows:
        r = (row[0], row[1], row[2])
        if not chosen:
            if any(r):
                chosen.append(r)
        elif len(chosen) == 1:
            if any(_cross(chosen[0], r)):
                chosen.append(r)
        else:
            normal = _cross(chosen[0], chosen[1])
            if sum(u * v for u, v in zip(normal, r, strict=True)):
                chosen.append(r)
                break
    return chosen
