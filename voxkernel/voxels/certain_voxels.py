"""Which points lie in voxels for certain: a point near a face is held against the voxels on both sides of it."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid import SparseGrid

__all__ = ["classify_points"]

_UNIT = 2.0**-53
_FAR = 2.0**26  # beyond every grid, and still exact as an integer


def classify_points(inside: SparseGrid, boundary: SparseGrid, xyz: NDArray[np.float64]) -> NDArray[np.int8]:
    """Give 1 where a point lies in inside voxels only, -1 where it lies in no voxel of either grid, 0 elsewhere.

    Both are certain: voxels are the closed boxes ``origin + linear @ [ijk, ijk + 1]`` of the doubles in `inside`, and a
    point is any double.
    """
    answer = np.full(len(xyz), -1, np.int8)
    answer[boundary.points_in_grid(xyz)] = 0
    answer[inside.points_in_grid(xyz)] = 1
    cells, pads = _cells_of(inside, xyz)
    # `points_in_grid` rounds on its own, within the same pad.
    low, high = np.floor(cells - 2.0 * pads[:, None]), np.floor(cells + 2.0 * pads[:, None])
    near = np.flatnonzero((low != high).any(axis=1))
    if not len(near):
        return answer
    corners = np.stack([low[near], high[near]]).astype(np.int64)
    all_inside = np.ones(len(near), np.bool_)
    any_active = np.zeros(len(near), np.bool_)
    for sides in product((0, 1), repeat=3):
        voxels = np.stack([corners[side, :, axis] for axis, side in enumerate(sides)], axis=1)
        is_inside = inside.is_active(voxels)
        all_inside &= is_inside
        any_active |= is_inside | boundary.is_active(voxels)
    answer[near] = np.where(all_inside, 1, np.where(any_active, 0, -1))
    return answer


def _cells_of(grid: SparseGrid, xyz: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions in voxels, and how far each may be off along any axis.

    The exact position s solves L s = x - o. With B, the rounded inverse of L, R = I - B L and d, x - o rounded once,

        s = B (x - o) + R s,   so   |s - fl(B d)| <= 5 u |B| |d| + |R| |s|

    for u = 2**-53: one rounding of d, three of products and sums on each path, and one for second order. fl(B L) is
    off by 3 u |B| |L|, and I - fl(B L) by one rounding more, so that 4 u (|B| |L| + 1) beside what is computed bounds
    R. The norms of R are far below 1/4 for any matrix a grid takes for the edges of a cube, so |s| is at most twice
    |fl(B d)| and its error. Coordinates are cut at 2**26, beyond every voxel, where an error does not matter.
    """
    linear = grid.linear
    inverse = np.asarray(np.linalg.inv(linear), dtype=np.float64)
    rest = np.abs(np.eye(3) - inverse @ linear) + 4.0 * _UNIT * (np.abs(inverse) @ np.abs(linear) + 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        offset = xyz - grid.origin
        cells = offset @ inverse.T
        rounding = 5.0 * _UNIT * (np.abs(offset) @ np.abs(inverse).T).max(axis=1)
    far = ~(np.abs(cells) < _FAR)
    # The sign does not matter out there, and NaN, of an offset beyond the doubles, is out there as well.
    cells[far] = _FAR
    rounding = np.where(np.isfinite(rounding), rounding, 0.0)
    size = np.abs(np.where(far, 0.0, cells)).max(axis=1)
    pads = rounding + 2.0 * float(rest.sum(axis=1).max()) * (size + rounding) + 1e-300
    pads[far.any(axis=1)] = 0.0
    return cells, pads
