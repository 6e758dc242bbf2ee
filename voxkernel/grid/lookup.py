"""Which cell covers a voxel: binary search along the Morton curve, or a table where the grid is compact."""

from typing import Any, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import points_in_runs, points_in_table, voxels_in_runs, voxels_in_table
from voxkernel.grid.cell_runs import Cells
from voxkernel.grid.leaf_bits import FULL
from voxkernel.grid.morton import REACH, count_up, decode, encode

__all__ = ["MAX_TABLE", "ActiveTable", "find_rows", "points_in", "voxels_in"]

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
        return cls((x, y, z), (n_x, n_y, n_z), read_only(row), read_only(words.ravel()))


def voxels_in(
    voxels: NDArray[np.integer[Any]], table: ActiveTable | None, cells: Cells, masks: NDArray[np.uint64]
) -> NDArray[np.bool_]:
    """Which voxels (n, 3) are active."""
    if voxels.dtype not in (np.dtype(np.int32), np.dtype(np.int64)):
        voxels = voxels.astype(np.int64)
    given = cast("NDArray[np.int64]", np.ascontiguousarray(voxels))  # or int32: the core takes both
    active = np.empty(len(voxels), dtype=np.bool_)
    if table is None:
        voxels_in_runs(given, REACH, *cells, masks, active)
    else:
        voxels_in_table(given, *table, active)
    return active


def points_in(
    points: NDArray[np.float64],
    origin: NDArray[np.float64],
    to_cells: NDArray[np.float64],
    table: ActiveTable | None,
    cells: Cells,
    masks: NDArray[np.uint64],
) -> NDArray[np.bool_]:
    """Which world points (n, 3) lie in active voxels; `to_cells` turns and scales them after `origin` is taken off."""
    active = np.empty(len(points), dtype=np.bool_)
    if table is None:
        points_in_runs(points, origin, to_cells, REACH, *cells, masks, active)
    else:
        points_in_table(points, origin, to_cells, *table, active)
    return active


def _bounds(code: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lowest and highest leaf coordinate: a cell's first and last codes are its extreme corners."""
    return decode(code).min(axis=0).astype(np.int64), decode(last).max(axis=0).astype(np.int64)
