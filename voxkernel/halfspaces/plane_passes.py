"""Passes over all planes in parts, on several threads: the same answer for any number of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import N_BINS, StopFlag, planes_reaching, tightest_by_direction
from voxkernel._threads import run_parts, stretches
from voxkernel.halfspaces.half_spaces import HalfSpaces

__all__ = ["reaching_planes", "tightest_planes"]


def tightest_planes(planes: HalfSpaces, point: NDArray[np.float64], *, threads: int = 1) -> NDArray[np.int64]:
    """List the plane nearest to a local point of each direction bin that has one; the first where several are."""

    def part(rows: slice, _: StopFlag) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        ids, slacks = np.empty(N_BINS, np.int64), np.empty(N_BINS)
        arrays = planes.local_normals[rows], planes.local_offsets[rows], planes.local_errors[rows]
        tightest_by_direction(*arrays, point, np.inf, ids, slacks)
        ids[ids >= 0] += rows.start
        return ids, slacks

    found = run_parts(part, stretches(len(planes), threads), threads)
    best, least = found[0]
    for ids, slacks in found[1:]:
        nearer = slacks < least
        best, least = np.where(nearer, ids, best), np.where(nearer, slacks, least)
    return best[best >= 0]


def reaching_planes(
    planes: HalfSpaces,
    center: NDArray[np.float64],
    corners: NDArray[np.float64],
    *,
    margin: float = 0.0,
    threads: int = 1,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """List planes not clear of local corners about a centre, how far those pass each, and what rounding may add."""

    def part(rows: slice, _: StopFlag) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        arrays = planes.local_normals[rows], planes.local_offsets[rows], planes.local_errors[rows]
        ids, excess, pads = planes_reaching(*arrays, center, corners, margin)
        return ids + rows.start, excess, pads

    found = run_parts(part, stretches(len(planes), threads), threads)
    if len(found) == 1:
        return found[0]
    ids, excess, pads = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return ids, excess, pads
