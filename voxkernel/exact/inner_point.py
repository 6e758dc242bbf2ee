"""A point strictly inside half-spaces as a sum of doubles, exactly."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.errors import SolverError
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.predicates import touched_and_violated

__all__ = ["InnerPoint", "inner_point"]

_UNIT = 2.0**-53


class InnerPoint(NamedTuple):
    """The sum of the rows of `terms`, world coordinates; `local` is it rounded, off by at most `error` there."""

    terms: NDArray[np.float64]
    local: NDArray[np.float64]
    error: float


def inner_point(planes: HalfSpaces, inside: Feasibility) -> InnerPoint:
    """Give the point of a solid intersection as doubles.

    A point that floating point has proven is a double of the local frame. One from rational arithmetic is rounded to
    as many doubles as it takes to stay strictly inside.
    """
    assert inside.local_point is not None
    if inside.exact_point is None:
        terms = np.array([planes.origin, inside.local_point * planes.scale])
        return InnerPoint(terms, inside.local_point, 0.0)
    rest = planes.lattice_to_world(inside.exact_point)
    rows: list[list[float]] = []
    while True:
        row = [float(v) for v in rest]
        rows.append(row)
        rest = (rest[0] - Fraction(row[0]), rest[1] - Fraction(row[1]), rest[2] - Fraction(row[2]))
        x, y, z = (sum((Fraction(v) for v in column), Fraction(0)) for column in zip(*rows, strict=True))
        lattice = planes.world_to_lattice((x, y, z))
        touched, violated = touched_and_violated(planes, lattice)
        if not len(touched) and not len(violated):
            local = planes.from_lattice(lattice)
            return InnerPoint(np.array(rows), local, 4.0 * _UNIT * (1.0 + float(np.abs(local).sum())))
        if not any(row):  # what is left is below the smallest double
            raise SolverError("the solid is too thin: no sum of doubles lies strictly inside")
