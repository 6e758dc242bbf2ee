"""`SparseGrid` -> a linear octree: cells sorted by Morton key."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid.leaf_bits import unpack
from voxkernel.grid.morton import interleaved
from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["LinearOctree", "to_linear_octree"]


class LinearOctree(NamedTuple):
    """Cells of an octree, sorted by Morton key.

    Parameters
    ----------
    key : (n,) uint64
        Interleaved bits of ``ijk - corner`` of each cell's lower corner, x in the highest place.
    log2 : (n,) int8
        Edge of each cell is ``2**log2`` voxels; its keys are ``key ... key + 8**log2 - 1``.
    verdict : (n,) int8
        1 inside, 0 undecided; what no cell covers is outside.
    corner : (3,) int64
        Voxel of key 0.

    Examples
    --------
    >>> octree = to_linear_octree(SparseGrid.from_ijk([[0, 0, 1]]), SparseGrid.from_ijk([[0, 0, 0]]))
    >>> octree.key.tolist(), octree.verdict.tolist()
    ([0, 1], [0, 1])
    """

    key: NDArray[np.uint64]
    log2: NDArray[np.int8]
    verdict: NDArray[np.int8]
    corner: NDArray[np.int64]


def to_linear_octree(inside: SparseGrid, boundary: SparseGrid | None = None) -> LinearOctree:
    """Cells of one or two masks as a linear octree, down to single voxels.

    Parameters
    ----------
    inside : SparseGrid
        Cells of verdict 1. Values are not used.
    boundary : SparseGrid, optional
        Cells of verdict 0; must share no voxel with `inside`.

    Returns
    -------
    LinearOctree
        Tiles as they are, leaves cut into cells of 4^3, 2^3 and 1 voxel. Empty grids give no cells.

    Raises
    ------
    ValueError
        If the voxels extend over more than 2**21 along an axis.

    References
    ----------
    .. [1] I. Gargantini, An effective way to represent quadtrees, Commun. ACM 25(12), 1982,
       doi:10.1145/358728.358741.

    Examples
    --------
    >>> import numpy as np
    >>> octree = to_linear_octree(SparseGrid.from_dense(np.ones((4, 4, 6), dtype=bool)))
    >>> octree.log2.tolist()
    [2, 1, 1, 1, 1]
    """
    grids = [inside] if boundary is None else [inside, boundary]
    cells = [_octree_cells(grid) for grid in grids]
    corner = np.concatenate([c for c, _ in cells])
    log2 = np.concatenate([e for _, e in cells])
    verdict = np.repeat(np.array([1, 0], dtype=np.int8)[: len(cells)], [len(e) for _, e in cells])
    if not len(corner):
        return LinearOctree(np.zeros(0, np.uint64), log2, verdict, np.zeros(3, np.int64))
    unit = np.int64(1) << max(int(log2.max()), 3)
    low = corner.min(axis=0) // unit * unit
    local = corner - low
    if local.max() >= 1 << 21:
        raise ValueError(f"`inside` must extend over at most 2**21 voxels; got {int(local.max()) + 1}")
    key = interleaved(local).astype(np.uint64)
    order = np.argsort(key, kind="stable")
    return LinearOctree(key[order], log2[order], verdict[order], low)


def _octree_cells(grid: SparseGrid) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Tiles and the largest aligned cubes of leaves: corners and log2 of the edges."""
    corners = [grid.tile_ijk.astype(np.int64)]
    sizes = [grid.tile_log2]
    left = unpack(grid.leaf_mask)
    leaf = grid.leaf_ijk.astype(np.int64)
    for log2 in (3, 2, 1, 0):
        n, edge = 8 >> log2, 1 << log2
        blocks = left.reshape(-1, n, edge, n, edge, n, edge)
        is_full = np.asarray(blocks.all(axis=(2, 4, 6)), dtype=np.bool_)
        owner, x, y, z = np.nonzero(is_full)
        corners.append(leaf[owner] + np.stack([x, y, z], axis=1) * edge)
        sizes.append(np.full(len(owner), log2, dtype=np.int8))
        left = (blocks & ~is_full[:, :, None, :, None, :, None]).reshape(-1, 8, 8, 8)
    return np.concatenate(corners), np.concatenate(sizes)
