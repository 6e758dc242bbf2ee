"""Which voxels of a long list are active: one pass, no temporaries.

The NumPy twins are `ActiveTable.is_active`, `find_rows` and `cells_of_points` of `_grid_query.py`.
"""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

_FAR = 2.0**26  # beyond every grid, and still exact as an integer


@njit(cache=NUMBA_CACHE, nogil=True, inline="always")
def _bit(x, y, z, low, shape, row, words):  # type: ignore[no-untyped-def]
    """Whether a voxel is active, without a branch: half of the queries would guess it wrong."""
    block_x, block_y, block_z = (x >> 3) - low[0], (y >> 3) - low[1], (z >> 3) - low[2]
    is_in = (
        np.int64(np.uint64(block_x) < np.uint64(shape[0]))
        & np.int64(np.uint64(block_y) < np.uint64(shape[1]))
        & np.int64(np.uint64(block_z) < np.uint64(shape[2]))
    )
    place = ((block_x * shape[1] + block_y) * shape[2] + block_z) * is_in
    word = words[(np.int64(row[place]) << 3) | (x & 7)]
    return (np.int64(word >> np.uint64(((y & 7) << 3) | (z & 7))) & is_in) != 0


@njit(cache=NUMBA_CACHE, nogil=True)
def voxels_in_table(voxels, low, shape, row, words, active):  # type: ignore[no-untyped-def]
    """Look up voxels in a table of 8^3 blocks (see `ActiveTable`)."""
    for i in range(voxels.shape[0]):
        x, y, z = np.int64(voxels[i, 0]), np.int64(voxels[i, 1]), np.int64(voxels[i, 2])
        active[i] = _bit(x, y, z, low, shape, row, words)


@njit(cache=NUMBA_CACHE, nogil=True, inline="always")
def _cell(value):  # type: ignore[no-untyped-def]
    """Voxel coordinate of a float; what is out of reach, or NaN, stays out of reach."""
    return np.int64(max(-_FAR, min(_FAR, np.floor(value))))


@njit(cache=NUMBA_CACHE, nogil=True)
def points_in_table(points, origin, to_cells, low, shape, row, words, active):  # type: ignore[no-untyped-def]
    """Look up the voxels of world points; the sums are those of `cells_of_points`, in its order."""
    a, b, c = origin[0], origin[1], origin[2]
    xu, xv, xw = to_cells[0, 0], to_cells[0, 1], to_cells[0, 2]
    yu, yv, yw = to_cells[1, 0], to_cells[1, 1], to_cells[1, 2]
    zu, zv, zw = to_cells[2, 0], to_cells[2, 1], to_cells[2, 2]
    for i in range(points.shape[0]):
        u, v, w = points[i, 0] - a, points[i, 1] - b, points[i, 2] - c
        x = _cell(u * xu + v * xv + w * xw)
        y = _cell(u * yu + v * yv + w * yw)
        z = _cell(u * zu + v * zv + w * zw)
        active[i] = _bit(x, y, z, low, shape, row, words)


@njit(cache=NUMBA_CACHE, nogil=True)
def _spread(value):  # type: ignore[no-untyped-def]
    """21 bits with two zero bits between them."""
    value = (value | (value << 32)) & 0x1F00000000FFFF
    value = (value | (value << 16)) & 0x1F0000FF0000FF
    value = (value | (value << 8)) & 0x100F00F00F00F00F
    value = (value | (value << 4)) & 0x10C30C30C30C30C3
    return (value | (value << 2)) & 0x1249249249249249


@njit(cache=NUMBA_CACHE, nogil=True)
def voxels_in_runs(voxels, reach, code, last, row, masks, active):  # type: ignore[no-untyped-def]
    """Search voxels among runs of Morton codes; `row` is a leaf's row in `masks` or negative for a tile."""
    n = code.shape[0]
    blocks = reach >> 3
    for i in range(voxels.shape[0]):
        x, y, z = np.int64(voxels[i, 0]), np.int64(voxels[i, 1]), np.int64(voxels[i, 2])
        active[i] = False
        if not (-reach <= x < reach and -reach <= y < reach and -reach <= z < reach):
            continue
        at = _spread((x >> 3) + blocks) << 2 | _spread((y >> 3) + blocks) << 1 | _spread((z >> 3) + blocks)
        first, length = 0, n
        while length > 1:  # the last run that begins at or before the voxel
            half = length >> 1
            first += half if code[first + half] <= at else 0
            length -= half
        if n == 0 or not code[first] <= at <= last[first]:
            continue
        leaf = row[first]
        if leaf < 0:
            active[i] = True
        else:
            bit = np.uint64(((y & 7) << 3) | (z & 7))
            active[i] = (masks[leaf, x & 7] >> bit) & np.uint64(1) != 0
