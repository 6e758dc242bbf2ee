"""Leaves from voxel lists and dense arrays, and back; whole blocks at a time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid.cell_runs import Body, Cells
from voxkernel.grid.leaf_bits import pack, unpack
from voxkernel.grid.morton import encode

__all__ = ["Leaves", "blocks_from_dense", "dense_from_body", "expanded", "leaves_from_voxels"]

Leaves = tuple[NDArray[np.int64], NDArray[np.uint64], NDArray[np.float32] | None]
"""Sorted codes (n,), masks (n, 8) and values (n, 512) or None."""

_LEAF_CHUNK = 1 << 14  # leaves unpacked at a time: 8 MB of voxels


def leaves_from_voxels(voxels: NDArray[np.int32], values: NDArray[np.float32] | None, background: float) -> Leaves:
    """Group voxels into leaves with one sort of packed integers instead of a sort of rows."""
    if not len(voxels):
        empty = None if values is None else np.zeros((0, 512), np.float32)
        return np.zeros(0, np.int64), np.zeros((0, 8), np.uint64), empty
    leaf = voxels >> 3
    low = leaf.min(axis=0).astype(np.int64)
    extent = leaf.max(axis=0) - low + 1
    place = voxels & 7
    bit = (place[:, 0] << 6) | (place[:, 1] << 3) | place[:, 2]
    if float(extent[0]) * float(extent[1]) * float(extent[2]) < 2.0**54:
        group = ((leaf[:, 0] - low[0]) * extent[1] + (leaf[:, 1] - low[1])) * extent[2] + (leaf[:, 2] - low[2])
    else:
        group = np.unique(encode(leaf), return_inverse=True)[1].astype(np.int64)
    key = (group << 9) | bit
    if values is None:
        key.sort()
    else:
        order = np.argsort(key, kind="stable")
        key, values = key[order], values[order]
        is_kept = np.append(key[1:] != key[:-1], True)
        key, values = key[is_kept], values[is_kept]
    word_starts = np.flatnonzero(np.append(True, (key[1:] >> 6) != (key[:-1] >> 6)))
    word = key[word_starts] >> 6
    leaf_of_word = word >> 3
    is_new = np.append(True, leaf_of_word[1:] != leaf_of_word[:-1])
    row_of_word = np.cumsum(is_new) - 1
    n_leaves = int(row_of_word[-1]) + 1
    masks = np.zeros((n_leaves, 8), dtype=np.uint64)
    bits = np.uint64(1) << (key & 63).view(np.uint64)
    masks[row_of_word, word & 7] = np.bitwise_or.reduceat(bits, word_starts)
    leaf_values = None
    if values is not None:
        row = np.repeat(row_of_word, np.diff(np.append(word_starts, len(key))))
        leaf_values = np.full((n_leaves, 512), background, dtype=np.float32)
        leaf_values[row, key & 511] = values
    code = _codes_of_groups(leaf_of_word[is_new], leaf, low, extent)
    order = np.argsort(code, kind="stable")
    return code[order], masks[order], None if leaf_values is None else leaf_values[order]


def _codes_of_groups(
    group: NDArray[np.int64], leaf: NDArray[np.int32], low: NDArray[np.int64], extent: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Morton codes of the leaves that `leaves_from_voxels` numbered."""
    if float(extent[0]) * float(extent[1]) * float(extent[2]) >= 2.0**54:
        return np.unique(encode(leaf))
    rest, z = np.divmod(group, extent[2])
    x, y = np.divmod(rest, extent[1])
    return encode(np.stack([x, y, z], axis=1) + low)


def blocks_from_dense(dense: NDArray[Any], lower: NDArray[np.int32], background: np.float32) -> Leaves:
    """Leaves of a dense array, a slab of eight planes at a time."""
    is_mask = dense.dtype.kind == "b"
    low = lower.astype(np.int64)
    first, end = low >> 3, (low + dense.shape + 7) >> 3
    n_y, n_z = int(end[1] - first[1]), int(end[2] - first[2])
    ahead = low - (first << 3)
    corners = np.indices((n_y, n_z)).reshape(2, -1).T + first[1:]
    codes, masks, values = [], [], []
    for slab in range(int(first[0]), int(end[0])):
        start, stop = max(slab * 8, int(low[0])), min(slab * 8 + 8, int(low[0]) + dense.shape[0])
        box = np.full((8, n_y * 8, n_z * 8), False if is_mask else background, dtype=bool if is_mask else np.float32)
        part = dense[start - int(low[0]) : stop - int(low[0])]
        with np.errstate(over="ignore"):
            box[
                start - slab * 8 : stop - slab * 8,
                ahead[1] : ahead[1] + dense.shape[1],
                ahead[2] : ahead[2] + dense.shape[2],
            ] = part
        blocks = box.reshape(8, n_y, 8, n_z, 8).transpose(1, 3, 0, 2, 4).reshape(-1, 8, 8, 8)
        bits = blocks if is_mask else blocks != background
        used = np.flatnonzero(bits.any(axis=(1, 2, 3)))
        codes.append(encode(np.column_stack([np.full(len(used), slab), corners[used]])))
        masks.append(pack(bits[used]))
        if not is_mask:
            values.append(blocks[used].reshape(-1, 512))
    if not codes:
        empty = None if is_mask else np.zeros((0, 512), np.float32)
        return np.zeros(0, np.int64), np.zeros((0, 8), np.uint64), empty
    code = np.concatenate(codes)
    order = np.argsort(code, kind="stable")
    leaf_values = None if is_mask else np.concatenate(values)[order]
    return code[order], np.concatenate(masks)[order], leaf_values


def expanded(
    cells: Cells,
    tile_ijk: NDArray[np.int32],
    tile_log2: NDArray[np.int8],
    leaves: tuple[NDArray[Any], NDArray[Any]],
) -> NDArray[np.int32]:
    """All active voxels in the order of `cells`."""
    leaf_ijk, leaf_mask = leaves
    parts: list[NDArray[np.int32]] = []
    is_tile = cells.row < 0
    breaks = np.flatnonzero(np.diff(is_tile.astype(np.int8), prepend=2))
    for start, stop in zip(breaks, np.append(breaks, len(is_tile))[1:], strict=True):
        rows = cells.row[start:stop]
        if is_tile[start]:
            parts.extend(_tile_voxels(tile_ijk[row], int(tile_log2[row])) for row in ~rows)
        else:
            for at in range(0, len(rows), _LEAF_CHUNK):
                chunk = rows[at : at + _LEAF_CHUNK]
                owner, bit = np.nonzero(unpack(leaf_mask[chunk]).reshape(-1, 512))
                local = np.stack([bit >> 6, (bit >> 3) & 7, bit & 7], axis=1)
                parts.append((leaf_ijk[chunk][owner] + local).astype(np.int32))
    return np.concatenate(parts) if parts else np.zeros((0, 3), dtype=np.int32)


def _tile_voxels(corner: NDArray[np.int32], log2: int) -> NDArray[np.int32]:
    edge = 1 << log2
    return np.indices((edge, edge, edge), dtype=np.int32).reshape(3, -1).T + corner


def dense_from_body(
    body: Body,
    corners: tuple[NDArray[np.int32], NDArray[np.int32]],
    inactive: tuple[NDArray[np.int32], NDArray[np.int8], NDArray[np.float32]],
    low: NDArray[np.int64],
    shape: tuple[int, ...],
    background: float,
) -> NDArray[Any]:
    """Fill a box, whole leaves by one assignment and tiles by slices."""
    if body.leaf_values is None or body.tile_values is None:
        fill, kind = False, np.dtype(np.bool_)
        tile_values, blocks = np.ones(len(body.tile_log2), dtype=np.bool_), None
    else:
        fill, kind = background, np.dtype(np.float32)
        tile_values, blocks = body.tile_values, body.leaf_values
    if 0 in shape:
        return np.zeros(shape, dtype=kind)
    first, end = low >> 3, (low + shape + 7) >> 3
    n_x, n_y, n_z = (int(n) for n in end - first)
    dense = np.full((n_x, 8, n_y, 8, n_z, 8), fill, dtype=kind)
    flat = dense.reshape(n_x * 8, n_y * 8, n_z * 8)
    tile_ijk, leaf_ijk = corners
    _fill_tiles(flat, tile_ijk, body.tile_log2, tile_values, first << 3)
    _fill_tiles(flat, *inactive, first << 3)
    at = (leaf_ijk >> 3) - first
    rows = np.flatnonzero(((at >= 0) & (at < (n_x, n_y, n_z))).all(axis=1))
    for start in range(0, len(rows), _LEAF_CHUNK):
        chunk = rows[start : start + _LEAF_CHUNK]
        x, y, z = at[chunk].T
        content = unpack(body.leaf_mask[chunk]) if blocks is None else blocks[chunk].reshape(-1, 8, 8, 8)
        dense[x, :, y, :, z, :] = content
    skip = low - (first << 3)
    return np.ascontiguousarray(flat[tuple(slice(int(s), int(s) + n) for s, n in zip(skip, shape, strict=True))])


def _fill_tiles(
    flat: NDArray[Any],
    ijk: NDArray[np.int32],
    log2: NDArray[np.int8],
    values: NDArray[Any],
    low: NDArray[np.int64],
) -> None:
    start = ijk.astype(np.int64) - low
    stop = start + (np.int64(1) << log2.astype(np.int64))[:, None]
    for row in np.flatnonzero((stop > 0).all(axis=1) & (start < flat.shape).all(axis=1)):
        (x, y, z), (x1, y1, z1) = np.maximum(start[row], 0), stop[row]
        flat[x:x1, y:y1, z:z1] = values[row]
