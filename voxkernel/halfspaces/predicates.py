"""Exact signs of facet planes at a point: a floating-point filter, then integers."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import plane_signs
from voxkernel.halfspaces.half_spaces import HalfSpaces

__all__ = ["exact_slacks", "planes_not_clear", "touched_and_violated"]

_UNIT = 2.0**-53
# Beyond this no rounded sign is trusted: squares leave the range of doubles.
_FAR = 2.0**500


def exact_slacks(
    halfspaces: HalfSpaces, ids: NDArray[Any] | Sequence[int], point: Sequence[Fraction | int]
) -> list[Fraction]:
    """Compute `d - n . y` exactly for a lattice point; only the sign has a meaning across planes."""
    x, y, z = point
    return [Fraction(d - (a * x + b * y + c * z)) for a, b, c, d in halfspaces.integer_planes(ids)]


def planes_not_clear(halfspaces: HalfSpaces, point: Sequence[Fraction | int]) -> NDArray[np.int64]:
    """List the planes that the filter cannot place strictly clear of an exact lattice point.

    One pass over all planes. A plane that is not listed has the point strictly inside.
    """
    local = halfspaces.from_lattice(point)
    if not np.abs(local).max() < _FAR:
        return np.arange(len(halfspaces))
    rounding = 2 * _UNIT * float(np.linalg.norm(local)) + 1e-300
    return plane_signs(
        halfspaces.local_normals, halfspaces.local_offsets, halfspaces.local_errors, local, rounding
    )


def touched_and_violated(
    halfspaces: HalfSpaces, point: Sequence[Fraction | int], *, limit: int = 4096
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Split the planes that are not clear of an exact lattice point into touched and violated ones.

    At most `limit` planes are decided exactly, the worst ones first by their rounded slack, so that
    a far-off point is not paid for with an integer test of every plane; when planes are left out,
    at least one violated plane is returned.
    """
    ids = planes_not_clear(halfspaces, point)
    local = halfspaces.from_lattice(point)
    if len(ids) > limit and np.abs(local).max() < _FAR:
        slack = halfspaces.local_offsets[ids] - halfspaces.local_normals[ids] @ local
        certain = slack < -(halfspaces.local_errors[ids] * (np.linalg.norm(local) + 1) + 1e-12)
        if certain.any():
            order = np.argsort(slack[certain])[:limit]
            return np.empty(0, np.int64), ids[certain][order]
    slacks = exact_slacks(halfspaces, ids, point)
    touched = np.array([i for i, s in zip(ids, slacks, strict=True) if s == 0], np.int64)
    violated = np.array([i for i, s in zip(ids, slacks, strict=True) if s < 0], np.int64)
    return touched, violated
