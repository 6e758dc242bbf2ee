"""Passes over all planes on several threads: the same answer for any number of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import N_BINS, planes_reaching, tightest_by_direction
from voxkernel.halfspaces.half_spaces import HalfSpaces

__all__ = ["largest_heights", "reaching_planes", "tightest_planes"]

_MOST = 1 << 17  # products held at a time


def tightest_planes(planes: HalfSpaces, point: NDArray[np.float64], *, threads: int = 1) -> NDArray[np.int64]:
    """List the plane nearest to a local point of each direction bin that has one; the first where several are."""
    ids, slacks = np.empty(N_BINS, np.int64), np.empty(N_BINS)
    arrays = planes.local_normals, planes.local_offsets, planes.local_errors
    tightest_by_direction(*arrays, point, np.inf, ids, slacks, threads)
    return ids[ids >= 0]


def reaching_planes(
    planes: HalfSpaces,
    center: NDArray[np.float64],
    corners: NDArray[np.float64],
    *,
    margin: float = 0.0,
    among: NDArray[np.bool_] | None = None,
    threads: int = 1,
) -> NDArray[np.int64]:
    """List planes, of all or of those where the mask `among` is true, not clear of local corners about a centre."""
    chosen = np.empty(0, np.bool_) if among is None else among
    arrays = planes.local_normals, planes.local_offsets, planes.local_errors
    return planes_reaching(*arrays, center, corners, margin, chosen, threads)


def largest_heights(planes: HalfSpaces, ids: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the largest n . x - d over local points of each of some half-spaces, a block of them at a time."""
    found = np.empty(len(ids))
    step = max(1, _MOST // max(1, len(points)))
    for first in range(0, len(ids), step):
        rows = ids[first : first + step]
        products = planes.local_normals[rows] @ points.T
        found[first : first + step] = products.max(axis=1) - planes.local_offsets[rows]
    return found
