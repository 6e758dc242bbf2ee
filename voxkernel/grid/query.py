"""Which voxels are active and what their values are, as answers to lists of voxels or points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points
from voxkernel.grid.array_checks import integers
from voxkernel.grid.blocks import dense_from_body, expanded
from voxkernel.grid.lookup import MAX_TABLE, ActiveTable, find_rows, points_in, voxels_in
from voxkernel.grid.morton import encode, last_of

if TYPE_CHECKING:
    from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["is_active", "points_in_grid", "to_dense", "to_ijk", "values_at"]

_MIN_TABLE_QUERIES = 1 << 16


def is_active(grid: SparseGrid, ijk: ArrayLike) -> NDArray[np.bool_]:
    """Tell which voxels are active.

    Parameters
    ----------
    ijk : (n, 3) int
        Voxel coordinates; any integers, those beyond +-2**23 are not active.

    Returns
    -------
    (n,) bool
        Empty for n = 0.

    Raises
    ------
    TypeError, ValueError
        If `ijk` is not an integer (n, 3) array.

    Notes
    -----
    O(n log c) for c tiles and leaves. A long list about a compact grid is answered from a table of its
    8^3 blocks, made once: at most 16 MB, and never longer than the list.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_ijk([[-3, 0, 5]]).is_active([[-3, 0, 5], [3, 0, 5]])
    array([ True, False])
    """
    voxels = integers("ijk", ijk)
    return voxels_in(voxels, _table_for(grid, len(voxels)), grid._cells(), grid.leaf_mask)


def _table_for(grid: SparseGrid, n_queries: int) -> ActiveTable | None:
    """The faster way to ask this often: a table, made once, unless it is longer than the list."""
    if grid._table is None and n_queries >= _MIN_TABLE_QUERIES:
        index = grid._cells()
        if 0 < ActiveTable.size_of(index.code, index.last) <= min(n_queries, MAX_TABLE):
            object.__setattr__(grid, "_table", ActiveTable.build(*index, grid.leaf_mask))
    return grid._table


def _rows(grid: SparseGrid, voxels: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Row of the leaf (or ``~row`` of the tile) that covers each voxel, and whether there is one."""
    index = grid._cells()
    place, found = find_rows(index.code, index.last, voxels)
    return (index.row[place] if len(index.row) else place), found


def values_at(grid: SparseGrid, ijk: ArrayLike) -> NDArray[np.float32]:
    """Values of voxels, active or not.

    Parameters
    ----------
    ijk : (n, 3) int
        Voxel coordinates.

    Returns
    -------
    (n,) float32
        `background` where nothing is stored; 1 and 0 in a mask.

    Raises
    ------
    TypeError, ValueError
        If `ijk` is not an integer (n, 3) array.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> grid = SparseGrid.from_ijk([[0, 0, 0]], values=[2.5], background=-1)
    >>> grid.values_at([[0, 0, 0], [0, 0, 1], [99, 0, 0]])
    array([ 2.5, -1. , -1. ], dtype=float32)
    """
    if grid.tile_values is None or grid.leaf_values is None:
        return is_active(grid, ijk).astype(np.float32)
    voxels = integers("ijk", ijk)
    values = np.full(len(voxels), grid.background, dtype=np.float32)
    rows, found = _rows(grid, voxels)
    is_leaf, is_tile = found & (rows >= 0), found & (rows < 0)
    at = voxels[is_leaf] & 7
    values[is_leaf] = grid.leaf_values[rows[is_leaf], at[:, 0] * 64 + at[:, 1] * 8 + at[:, 2]]
    values[is_tile] = grid.tile_values[~rows[is_tile]]
    if len(grid.inactive_log2):
        code = encode(grid.inactive_ijk >> 3)
        place, found = find_rows(code, last_of(code, grid.inactive_log2 - 3), voxels)
        values[found] = grid.inactive_values[place[found]]
    return values


def to_ijk(grid: SparseGrid, *, max_voxels: int = 50_000_000) -> NDArray[np.int32]:
    """List the active voxels.

    Parameters
    ----------
    max_voxels : int, default 50 million
        Refuse to expand more than this (12 bytes each).

    Returns
    -------
    (n, 3) int32
        In Morton order of the tiles and leaves, lexicographic within each; (0, 3) for an empty grid.

    Raises
    ------
    ValueError
        If there are more than `max_voxels` active voxels.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_ijk([[1, 0, 0], [0, 0, 7]]).to_ijk().tolist()
    [[0, 0, 7], [1, 0, 0]]
    """
    count = grid.active_voxel_count
    if count > max_voxels:
        raise ValueError(f"`max_voxels` must be at least the {count} active voxels to list them; got {max_voxels}")
    return expanded(grid._cells(), grid.tile_ijk, grid.tile_log2, (grid.leaf_ijk, grid.leaf_mask))


def to_dense(grid: SparseGrid, bbox: ArrayLike | None = None, *, max_voxels: int = 1 << 30) -> NDArray[Any]:
    """Dense array of a box of voxels.

    Parameters
    ----------
    bbox : (2, 3) int, optional
        Lowest and highest voxel, inclusive; default `active_bbox`.
    max_voxels : int, default 2**30
        Refuse to make a larger array.

    Returns
    -------
    (nx, ny, nz) bool or float32
        Activity of a mask, values of a float grid (`background` where nothing is stored). (0, 0, 0) for
        an empty grid without `bbox`.

    Raises
    ------
    ValueError
        If `bbox` is not an integer (2, 3) array with low <= high + 1, or larger than `max_voxels`.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_ijk([[0, 0, 0], [0, 0, 2]]).to_dense().astype(int).tolist()
    [[[1, 0, 1]]]
    """
    if bbox is None:
        bbox = grid.active_bbox
    box = np.array([[0, 0, 0], [-1, -1, -1]]) if bbox is None else integers("bbox", bbox)
    if box.shape != (2, 3):
        raise ValueError(f"`bbox` must have shape (2, 3); got {box.shape}")
    low, high = (tuple(int(c) for c in row) for row in box)
    shape = tuple(h - m + 1 for m, h in zip(low, high, strict=True))
    if min(shape) < 0:
        raise ValueError(f"`bbox` must have low <= high + 1; got {box.tolist()}")
    if shape[0] * shape[1] * shape[2] > max_voxels:
        raise ValueError(f"`max_voxels` must be at least {shape[0] * shape[1] * shape[2]} for this `bbox`")
    off = (grid.inactive_ijk, grid.inactive_log2, grid.inactive_values)
    corners = (grid.tile_ijk, grid.leaf_ijk)
    return dense_from_body(grid._body, corners, off, np.array(low), shape, grid.background)


def points_in_grid(grid: SparseGrid, xyz: ArrayLike) -> NDArray[np.bool_]:
    """Tell which world points lie in an active voxel.

    Parameters
    ----------
    xyz : (n, 3) float64
        World points. A point on a shared face belongs to the voxel above it.

    Returns
    -------
    (n,) bool
        Empty for n = 0.

    Raises
    ------
    TypeError, ValueError
        If `xyz` is not finite real (n, 3).

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.5).points_in_grid([[0.4, 0, 0], [0.5, 0, 0]])
    array([ True, False])
    """
    points = as_points("xyz", xyz)
    to_cells = np.asarray(np.linalg.inv(grid.linear), dtype=np.float64)
    return points_in(
        points, grid.origin, to_cells, _table_for(grid, len(points)), grid._cells(), grid.leaf_mask
    )
