"""Union, intersection, difference, and other ways to make a grid of grids."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from voxkernel._checks import as_choice, read_only
from voxkernel.grid import cell_runs

if TYPE_CHECKING:
    from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["coarsened", "difference", "intersection", "prune", "to_mask", "union"]


def union(grid: SparseGrid, other: SparseGrid) -> SparseGrid:
    """Voxels active in either grid; where both are, the values of this one hold.

    Parameters
    ----------
    other : SparseGrid
        Same transform, and a mask if and only if this one is.

    Returns
    -------
    SparseGrid
        With this grid's transform, background and name; metadata and inactive tiles are dropped.

    Raises
    ------
    TypeError
        If `other` is not a SparseGrid or holds values where this one does not.
    ValueError
        If the transforms differ.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> a, b = SparseGrid.from_ijk([[0, 0, 0]]), SparseGrid.from_ijk([[0, 0, 1]])
    >>> a.union(b).to_ijk().tolist()
    [[0, 0, 0], [0, 0, 1]]
    """
    grid._check_partner(other)
    if grid.is_mask != other.is_mask:
        raise TypeError("`other` must be a mask like this grid, or hold values like it; got one of each")
    return grid._with(cell_runs.union(grid._body, other._body, grid._cells(), other._cells()), {})


def intersection(grid: SparseGrid, other: SparseGrid) -> SparseGrid:
    """Voxels active in both grids, with the values of this one.

    Parameters
    ----------
    other : SparseGrid
        Same transform; may be a mask where this one holds values, and the reverse.

    Returns
    -------
    SparseGrid
        With this grid's transform, background and name; metadata and inactive tiles are dropped.

    Raises
    ------
    TypeError
        If `other` is not a SparseGrid.
    ValueError
        If the transforms differ.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> a, b = SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]]), SparseGrid.from_ijk([[0, 0, 1]])
    >>> a.intersection(b).to_ijk().tolist()
    [[0, 0, 1]]
    """
    grid._check_partner(other)
    return grid._with(cell_runs.intersection(grid._body, other._body, grid._cells(), other._cells()), {})


def difference(grid: SparseGrid, other: SparseGrid) -> SparseGrid:
    """Voxels active in this grid and not in the other, with the values of this one.

    Parameters
    ----------
    other : SparseGrid
        Same transform; may be a mask where this one holds values, and the reverse.

    Returns
    -------
    SparseGrid
        With this grid's transform, background and name; metadata and inactive tiles are dropped.

    Raises
    ------
    TypeError
        If `other` is not a SparseGrid.
    ValueError
        If the transforms differ.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> a, b = SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]]), SparseGrid.from_ijk([[0, 0, 1]])
    >>> a.difference(b).to_ijk().tolist()
    [[0, 0, 0]]
    """
    grid._check_partner(other)
    return grid._with(cell_runs.difference(grid._body, other._body, grid._cells(), other._cells()), {})


def prune(grid: SparseGrid) -> SparseGrid:
    """Same voxels and values in the fewest tiles and leaves: the form in which equal grids have equal
    arrays.

    Returns
    -------
    SparseGrid
        Leaves without an active voxel and inactive tiles are dropped; name and metadata are kept.

    Examples
    --------
    >>> import numpy as np
    >>> from voxkernel import SparseGrid
    >>> full = np.full((8, 8), 2**64 - 1, dtype=np.uint64)
    >>> corners = np.indices((2, 2, 2)).reshape(3, 8).T * 8
    >>> SparseGrid.from_tiles_and_leaves([], [], corners, full).prune()
    SparseGrid('', 4096 active voxels, 1 tile, 0 leaves, mask)
    """
    return grid._with(cell_runs.merged(grid._body), grid.metadata)


def to_mask(grid: SparseGrid) -> SparseGrid:
    """The active voxels alone, without values.

    Returns
    -------
    SparseGrid
        A mask that shares this grid's arrays; inactive tiles are dropped, name and metadata are kept.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_ijk([[0, 0, 0]], values=[2.5], name="v").to_mask()
    SparseGrid('v', 1 active voxel, 0 tiles, 1 leaf, mask)
    """
    return grid._with(grid._body._replace(tile_values=None, leaf_values=None), grid.metadata, background=0.0)


def coarsened(grid: SparseGrid, *, rule: Literal["any", "all"] = "any") -> SparseGrid:
    """Merge blocks of 2^3 voxels into one voxel of twice the edge.

    Parameters
    ----------
    rule : {"any", "all"}, default "any"
        A coarse voxel is active if any or if all of its eight voxels are.

    Returns
    -------
    SparseGrid
        Same origin, `linear` doubled; values are the mean of the active ones. Metadata and inactive
        tiles are dropped.

    Raises
    ------
    ValueError
        If `rule` is another word.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> grid = SparseGrid.from_ijk([[0, 0, 0], [-1, 0, 0], [-2, 1, 1]])
    >>> grid.coarsened().to_ijk().tolist(), grid.coarsened().voxel_size
    ([[-1, 0, 0], [0, 0, 0]], 2.0)
    """
    as_choice("rule", rule, ("any", "all"))
    return grid._with(cell_runs.coarsen(grid._body, rule), {}, linear=read_only(grid.linear * 2.0))
