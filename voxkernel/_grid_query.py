"""Which cell covers a voxel: binary search along the Morton curve, or a table where the grid is compact.

Long lists go to the compiled loops of `_loops/grid_query.py`, with the same answers.
"""

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from voxkernel._cells import Cells
from voxkernel._leaf_bits import FULL
from voxkernel._morton import REACH, count_up, decode, encode

__all__ = ["MAX_TABLE", "MIN_COMPILED", "ActiveTable", "cells_of_points", "find_rows", "points_in", "voxels_in"]

MIN_COMPILED = 100_000
"""Fewer voxels than this are answered by NumPy: loading Numba takes longer."""

MAX_TABLE = 1 << 22
"""Most entries (4 bytes each) a table may have."""


def find_rows(
    code: NDArray[np.int64], last: NDArray[np.int64], voxels: NDArray[np.integer[Any]]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Index of the run ``code ... last`` that covers each voxel, and whether there is one; O(log c) each."""
    if not len(code):
        return np.zeros(len(voxels), np.int64), np.zeros(len(voxels), np.bool_)
    found = np.logical_and.reduce((voxels >= -REACH) & (voxels < REACH), axis=1)
    at = encode(np.where(found[:, None], voxels, 0) >> 3)
    place = np.searchsorted(code, at, side="right") - 1
    found &= (place >= 0) & (at <= last[place])
    return place, found


class ActiveTable(NamedTuple):
    """Mask of every 8^3 block in the grid's bounding box: a query is two look-ups instead of a search.

    `row` points into `words`, whose last two rows stand for a full and an empty block.
    """

    low: tuple[int, int, int]
    shape: tuple[int, int, int]
    row: NDArray[np.int32]
    words: NDArray[np.uint64]

    @classmethod
    def size_of(cls, code: NDArray[np.int64], last: NDArray[np.int64]) -> int:
        """Number of entries a table would have."""
        if not len(code):
            return 0
        low, high = _bounds(code, last)
        extent = [int(n) for n in high - low + 1]
        return extent[0] * extent[1] * extent[2]

    @classmethod
    def build(
        cls,
        code: NDArray[np.int64],
        last: NDArray[np.int64],
        leaf_row: NDArray[np.int64],
        leaf_mask: NDArray[np.uint64],
    ) -> Self:
        """Table over runs; `leaf_row` is negative for tiles."""
        low, high = _bounds(code, last)
        shape = high - low + 1
        n_leaves = len(leaf_mask)
        counts = last - code + 1
        blocks = decode(np.repeat(code, counts) + count_up(counts)) - low
        row = np.full(int(shape.prod()), n_leaves + 1, dtype=np.int32)
        at = (blocks[:, 0] * shape[1] + blocks[:, 1]) * shape[2] + blocks[:, 2]
        row[at] = np.repeat(np.where(leaf_row < 0, n_leaves, leaf_row), counts)
        words = np.concatenate([leaf_mask, np.full((1, 8), FULL), np.zeros((1, 8), np.uint64)])
        x, y, z = (int(n) for n in low)
        n_x, n_y, n_z = (int(n) for n in shape)
        return cls((x, y, z), (n_x, n_y, n_z), row, words.ravel())

    def is_active(self, voxels: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
        """Look up (n, 3) voxels."""
        place = np.zeros(len(voxels), dtype=np.int64)
        outside = np.zeros(len(voxels), dtype=np.bool_)
        word = bit = place
        for axis in range(3):
            column = voxels[:, axis].astype(np.int64)
            block = (column >> 3) - self.low[axis]
            outside |= block.view(np.uint64) >= np.uint64(self.shape[axis])  # catches negative ones too
            place = place * self.shape[axis] + block
            if axis == 0:
                word = column & 7
            else:
                bit = (column & 7) if axis == 1 else (bit << 3) | (column & 7)
        place[outside] = 0
        word += self.row.take(place).astype(np.int64) << 3
        active = (self.words.take(word) >> bit.view(np.uint64)) & np.uint64(1)
        active[outside] = 0
        return active.astype(np.bool_)


def cells_of_points(
    points: NDArray[np.float64], origin: NDArray[np.float64], to_cells: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Voxels of world points: the same roundings in the same order as in the compiled loop.

    What lies out of reach becomes a voxel just beyond it.
    """
    away = points - origin
    cells = np.empty(points.shape)
    for axis in range(3):
        row = to_cells[axis]
        cells[:, axis] = away[:, 0] * row[0] + away[:, 1] * row[1] + away[:, 2] * row[2]
    np.floor(cells, out=cells)
    return np.fmin(np.fmax(cells, -REACH - 1), REACH).astype(np.int64)


def voxels_in(
    voxels: NDArray[np.integer[Any]], table: ActiveTable | None, cells: Cells, masks: NDArray[np.uint64]
) -> NDArray[np.bool_]:
    """Which voxels (n, 3) are active, by the compiled loops."""
    from voxkernel._loops.grid_query import voxels_in_runs, voxels_in_table

    if voxels.dtype not in (np.dtype(np.int32), np.dtype(np.int64)):
        voxels = voxels.astype(np.int64)
    voxels = np.ascontiguousarray(voxels)
    active = np.empty(len(voxels), dtype=np.bool_)
    if table is None:
        voxels_in_runs(voxels, REACH, *cells, masks, active)
    else:
        voxels_in_table(voxels, *table, active)
    return active


def points_in(
    points: NDArray[np.float64], origin: NDArray[np.float64], to_cells: NDArray[np.float64], table: ActiveTable
) -> NDArray[np.bool_]:
    """Which world points (n, 3) lie in active voxels, by the compiled loop."""
    from voxkernel._loops.grid_query import points_in_table

    active = np.empty(len(points), dtype=np.bool_)
    points_in_table(points, origin, to_cells, *table, active)
    return active


def _bounds(code: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lowest and highest leaf coordinate: a cell's first and last codes are its extreme corners."""
    return decode(code).min(axis=0).astype(np.int64), decode(last).max(axis=0).astype(np.int64)
