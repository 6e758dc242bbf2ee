"""Faces between active and inactive voxels, found 8^3 blocks at a time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid.leaf_bits import FULL, unpack
from voxkernel.grid.lookup import find_rows
from voxkernel.grid.morton import count_up, encode, last_of
from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["exposed_faces"]

_CHUNK = 1 << 13  # blocks unpacked at a time


class _Blocks(NamedTuple):
    """8^3 blocks that may have exposed faces on one side: all leaves, and the outer layer of each tile."""

    corner: NDArray[np.int64]
    mask: NDArray[np.uint64]
    beyond: NDArray[np.uint64]

    def part(self, start: int) -> "_Blocks":
        """One chunk."""
        end = start + _CHUNK
        return _Blocks(self.corner[start:end], self.mask[start:end], self.beyond[start:end])


def exposed_faces(grid: SparseGrid, axis: int, step: int) -> NDArray[np.int32]:
    """Active voxels (n, 3) whose neighbour at `step` (+1 or -1) along `axis` is not active."""
    blocks = _blocks(grid, axis, step)
    parts = [np.zeros((0, 3), dtype=np.int32)]
    for start in range(0, len(blocks.corner), _CHUNK):
        part = blocks.part(start)
        owner, x, y, z = np.nonzero(_exposed(part, axis, step))
        parts.append((part.corner[owner] + np.stack([x, y, z], axis=1)).astype(np.int32))
    return np.concatenate(parts)


def _exposed(blocks: _Blocks, axis: int, step: int) -> NDArray[np.bool_]:
    """Active and followed by an inactive voxel; the last layer looks into the block beyond."""
    own = np.moveaxis(unpack(blocks.mask), axis + 1, 1)
    beyond = np.moveaxis(unpack(blocks.beyond), axis + 1, 1)
    pair = [own[:, 1:], beyond[:, :1]] if step > 0 else [beyond[:, -1:], own[:, :-1]]
    following = np.concatenate(pair, axis=1)
    return np.moveaxis(own & ~following, 1, axis + 1)


def _blocks(grid: SparseGrid, axis: int, step: int) -> _Blocks:
    """Blocks and their neighbours; those whose neighbour is full show nothing unless they are leaves."""
    corners = [grid.leaf_ijk.astype(np.int64)]
    for log2 in np.unique(grid.tile_log2).tolist():
        corners.append(_outer_layer(grid.tile_ijk[grid.tile_log2 == log2], log2, axis, step))
    corner = np.concatenate(corners)
    mask = np.full((len(corner), 8), FULL)
    mask[: grid.leaf_count] = grid.leaf_mask
    ahead = corner.copy()
    ahead[:, axis] += 8 * step
    beyond = _masks_at(grid, ahead)
    useful = np.ones(len(corner), dtype=np.bool_)
    useful[grid.leaf_count :] = (beyond[grid.leaf_count :] != FULL).any(axis=1)
    return _Blocks(corner[useful], mask[useful], beyond[useful])


def _outer_layer(tiles: NDArray[np.int32], log2: int, axis: int, step: int) -> NDArray[np.int64]:
    """Corners of the blocks of tiles that touch one of their six sides."""
    n_blocks = 1 << (log2 - 3)
    counts = np.full(len(tiles), n_blocks * n_blocks, dtype=np.int64)
    place = count_up(counts)
    layer = np.repeat(tiles.astype(np.int64), counts, axis=0)
    layer[:, (axis + 1) % 3] += place // n_blocks * 8
    layer[:, (axis + 2) % 3] += place % n_blocks * 8
    if step > 0:
        layer[:, axis] += (n_blocks - 1) * 8
    return layer


def _masks_at(grid: SparseGrid, corner: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Masks of 8^3 blocks: of a leaf, all set in a tile, all clear elsewhere."""
    masks = np.zeros((len(corner), 8), dtype=np.uint64)
    tiles = encode(grid.tile_ijk >> 3)
    in_tile = find_rows(tiles, last_of(tiles, grid.tile_log2 - 3), corner)[1]
    masks[in_tile] = FULL
    leaves = encode(grid.leaf_ijk >> 3)
    row, in_leaf = find_rows(leaves, leaves, corner)
    masks[in_leaf] = grid.leaf_mask[row[in_leaf]]
    return masks
