"""Why half-spaces have no common point, or none inside: a few of them with exact multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import gcd

import numpy as np
from numpy.typing import NDArray

from voxkernel.errors import SolverError
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.halfspaces.rational_program import as_integers, deepest_rational_point

__all__ = ["Witness", "empty_witness", "lifted_witness", "witness_of"]


@dataclass(frozen=True, slots=True)
class Witness:
    """Half-spaces and multipliers >= 0 with sum(l n) = 0 and sum(l d) <= 0, in exact integers.

    Below zero no point satisfies all of them; at zero every common point lies on each of them.
    """

    ids: tuple[int, ...]
    multipliers: tuple[int, ...]


def empty_witness(halfspaces: HalfSpaces, ids: NDArray[np.int64]) -> Witness | None:
    """Prove in integers that a handful of half-spaces have no common point; None when they have one."""
    if not len(ids):
        return None
    planes = halfspaces.integer_planes(ids)
    multipliers = _cofactors(planes)
    if multipliers is not None:
        return Witness(tuple(int(i) for i in ids), multipliers)
    unit = Fraction(halfspaces.scale) * halfspaces.lattice_unit
    optimum = deepest_rational_point([(p[:3], Fraction(p[3])) for p in planes], 3, unit=unit)
    if optimum.clearance >= 0:
        return None
    return witness_of(ids, optimum.multipliers)


def _cofactors(planes: list[tuple[int, int, int, int]]) -> tuple[int, ...] | None:
    """Multipliers of two to four planes that have no common point, and no fewer of them; None for any other."""
    signed = _balance(planes)
    if all(v < 0 for v in signed):
        signed = [-v for v in signed]
    if not signed or not all(v > 0 for v in signed):
        return None
    if sum(m * p[3] for m, p in zip(signed, planes, strict=True)) >= 0:
        return None
    divisor = gcd(*signed)
    return tuple(v // divisor for v in signed)


def _balance(planes: list[tuple[int, int, int, int]]) -> list[int]:
    """The one combination, up to a factor, of normals that vanishes; empty where there is none, or more than one."""
    if len(planes) == 4:
        a, b, c, d = planes
        return [_determinant(b, c, d), -_determinant(a, c, d), _determinant(a, b, d), -_determinant(a, b, c)]
    if len(planes) == 3:
        a, b, c = planes
        if _determinant(a, b, c) != 0:
            return []
        for axis in range(3):
            shares = [_minor(b, c, axis), _minor(c, a, axis), _minor(a, b, axis)]
            if all(shares):
                return shares
    if len(planes) == 2:
        a, b = planes
        if not any(_minor(a, b, axis) for axis in range(3)):
            return next([-b[k], a[k]] for k in range(3) if a[k] or b[k])
    return []


def _minor(a: tuple[int, ...], b: tuple[int, ...], axis: int) -> int:
    """A coordinate of the cross product of two normals."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    return a[i] * b[j] - a[j] * b[i]


def _determinant(a: tuple[int, ...], b: tuple[int, ...], c: tuple[int, ...]) -> int:
    (ax, ay, az, *_), (bx, by, bz, *_), (cx, cy, cz, *_) = a, b, c
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)


def witness_of(ids: NDArray[np.int64], multipliers: dict[int, Fraction]) -> Witness:
    """Make the multipliers integers and name the half-spaces they belong to."""
    used = sorted(multipliers)
    return Witness(tuple(int(ids[i]) for i in used), tuple(as_integers([multipliers[i] for i in used])))


def lifted_witness(
    rows: NDArray[np.int64], planes: list[tuple[int, int, int, int]], equal: list[int]
) -> Witness:
    """Turn equalities found in a subspace into one witness in space: sum(l n) = 0 and sum(l d) = 0, all l > 0.

    A half-space is an implicit equality of a set exactly when some non-negative combination with a
    positive share of it vanishes; maximising the smallest share finds one for all at once.
    """
    combination = _positive_combination([planes[i] for i in equal])
    if combination is None:
        raise SolverError("the equalities of a flat kernel have no common witness")
    return Witness(tuple(int(rows[i]) for i in equal), tuple(as_integers(combination)))


def _positive_combination(planes: list[tuple[int, int, int, int]]) -> list[Fraction] | None:
    """Find l > 0 with sum(l * plane) = 0 for a handful of planes in 4-space."""
    n = len(planes)
    total = [Fraction(0)] * n
    for i in range(n):
        part = _combination_with(planes, i)
        if part is None:
            return None
        total = [u + v for u, v in zip(total, part, strict=True)]
    return total


def _combination_with(planes: list[tuple[int, int, int, int]], chosen: int) -> list[Fraction] | None:
    """Find l >= 0 with l[chosen] = 1 and sum(l * plane) = 0, trying sets of at most 4 other planes."""
    from itertools import combinations

    from voxkernel.halfspaces.rational_program import solve_rational

    target = [-Fraction(v) for v in planes[chosen]]
    others = [i for i in range(len(planes)) if i != chosen]
    for size in range(1, 5):
        for subset in combinations(others, size):
            # Least squares in rationals: exact solution iff the residual vanishes.
            gram = [
                [Fraction(sum(planes[i][k] * planes[j][k] for k in range(4))) for j in subset] for i in subset
            ]
            right = [sum((planes[i][k] * target[k] for k in range(4)), Fraction(0)) for i in subset]
            solution = solve_rational(gram, right)
            if solution is None or any(v < 0 for v in solution):
                continue
            if all(
                sum((v * planes[i][k] for v, i in zip(solution, subset, strict=True)), Fraction(0))
                == target[k]
                for k in range(4)
            ):
                result = [Fraction(0)] * len(planes)
                result[chosen] = Fraction(1)
                for v, i in zip(solution, subset, strict=True):
                    result[i] = v
                return result
    return None
