"""Tiles and leaves -> the tree of one grid in a .vdb file."""

import struct
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid import SparseGrid
from voxkernel.vdb.node_values import Codec, pack_bits, write_leaf_values, write_values

__all__ = ["write_tree"]

_ROOT_BITS = 27
_MAX_PIECES = 1 << 24


class _Slots(NamedTuple):
    """Tiles of one of OpenVDB's sizes, sorted as the file wants them."""

    key: NDArray[np.int64]
    values: NDArray[Any]
    is_on: NDArray[np.bool_]

    def below(self, shift: int, node: int) -> "_Slots":
        """Tiles in one node."""
        start = np.searchsorted(self.key, node << shift)
        stop = np.searchsorted(self.key, ((node + 1) << shift) - 1, side="right")
        return _Slots(self.key[start:stop], self.values[start:stop], self.is_on[start:stop])


def _keys(ijk: NDArray[np.int32]) -> NDArray[np.int64]:
    """Depth-first order of OpenVDB's tree: 36 bits for the root's child, 15 within it, 12 within that."""
    columns = np.ascontiguousarray(ijk.T, dtype=np.int64)
    key = np.zeros(len(ijk), dtype=np.int64)
    for column in columns:
        key = (key << 12) | ((column >> 12) + 2048)
    for shift, bits in ((7, 5), (3, 4)):
        for column in columns:
            key <<= bits
            key |= (column >> shift) & ((1 << bits) - 1)
    return key


def _split(
    ijk: NDArray[np.int32], log2: NDArray[np.int8], values: NDArray[Any], is_on: NDArray[np.bool_]
) -> dict[int, _Slots]:
    """Tiles of any size as OpenVDB's 8^3, 128^3 and 4096^3, each cut into the next smaller of these."""
    slots: dict[int, _Slots] = {}
    for unit, largest in ((3, 6), (7, 11), (12, 99)):
        pieces: list[NDArray[np.int32]] = [np.zeros((0, 3), np.int32)]
        rows: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
        for size in range(unit, min(largest, int(log2.max(initial=0))) + 1):
            chosen = np.flatnonzero(log2 == size)
            if not len(chosen):
                continue
            n_pieces = 8 ** (size - unit)
            if len(chosen) * n_pieces > _MAX_PIECES:
                raise ValueError(
                    f"`grids` must have fewer large tiles, as OpenVDB's largest is 4096^3; "
                    f"got {len(chosen)} of edge 2^{size}"
                )
            steps = np.indices((1 << (size - unit),) * 3, dtype=np.int32).reshape(3, -1).T << unit
            pieces.append((ijk[chosen][:, None] + steps).reshape(-1, 3))
            rows.append(np.repeat(chosen, n_pieces))
        corners, row = np.concatenate(pieces), np.concatenate(rows)
        key = _keys(corners)
        order = np.argsort(key, kind="stable")
        slots[unit] = _Slots(key[order], values[row[order]], is_on[row[order]])
    return slots


def write_tree(grid: SparseGrid, kind: str, flags: int) -> tuple[list[bytes], list[bytes]]:
    """Topology and buffers of a grid as "bool", "mask", "float" or "half"."""
    if kind == "half":
        grid = _in_half(grid)
    codec = Codec.of(kind, grid.background, flags)
    tile_values = np.ones(grid.tile_count) if grid.tile_values is None else grid.tile_values
    slots = _split(
        np.concatenate([grid.tile_ijk, grid.inactive_ijk]),
        np.concatenate([grid.tile_log2, grid.inactive_log2]),
        np.concatenate([tile_values, grid.inactive_values]).astype(codec.dtype),
        np.repeat([True, False], [grid.tile_count, len(grid.inactive_log2)]),
    )
    leaf_key = _keys(grid.leaf_ijk)
    order = np.argsort(leaf_key, kind="stable")
    masks = np.ascontiguousarray(grid.leaf_mask[order], dtype="<u8")
    topology = _topology(slots, leaf_key[order], masks, codec)
    return topology, _buffers(grid, kind, order, masks, codec)


def _in_half(grid: SparseGrid) -> SparseGrid:
    """Round all values first, so that what equals the background still does afterwards."""
    with np.errstate(over="ignore"):
        rounded = {
            name: values.astype(np.float16).astype(np.float32)
            for name in ("tile_values", "leaf_values", "inactive_values")
            if (values := getattr(grid, name)) is not None
        }
        return replace(grid, background=float(np.float16(grid.background)), **rounded)


def _topology(
    slots: dict[int, _Slots], leaf_key: NDArray[np.int64], masks: NDArray[np.uint64], codec: Codec
) -> list[bytes]:
    """Root, then its children depth first."""
    lower = np.unique(np.concatenate([leaf_key >> 12, slots[3].key >> 12]))  # the 16^3 nodes
    upper = np.unique(np.concatenate([lower >> 15, slots[7].key >> _ROOT_BITS]))  # the 32^3 nodes
    value_code = "?" if codec.dtype.kind == "b" else "f"
    parts = [struct.pack(f"<i{value_code}II", 1, codec.background.item(), len(slots[12].key), len(upper))]
    for key, value, is_on in zip(*slots[12], strict=True):
        parts.append(struct.pack(f"<3i{value_code}?", *_root_corner(int(key) >> _ROOT_BITS), value.item(), is_on))
    lower_ends = np.searchsorted(lower >> 15, upper, side="right")
    leaf_ends = np.searchsorted(leaf_key >> 12, lower, side="right").tolist()
    first = leaf_start = 0
    for node, end in zip(upper.tolist(), lower_ends.tolist(), strict=True):
        parts.append(struct.pack("<3i", *_root_corner(node)))
        tiles = slots[7].below(_ROOT_BITS, node)
        parts.append(_node(5, lower[first:end] & 32767, (tiles.key >> 12) & 32767, tiles, codec))
        for row in range(first, end):
            leaves = leaf_key[leaf_start : leaf_ends[row]]
            tiles = slots[3].below(12, int(lower[row]))
            parts.append(_node(4, leaves & 4095, tiles.key & 4095, tiles, codec))
            parts.append(masks[leaf_start : leaf_ends[row]].tobytes())
            leaf_start = leaf_ends[row]
        first = end
    return parts


def _root_corner(node: int) -> tuple[int, int, int]:
    """Voxel at which a child of the root begins."""
    return ((node >> 24) - 2048) << 12, (((node >> 12) & 4095) - 2048) << 12, ((node & 4095) - 2048) << 12


def _node(log2: int, children: NDArray[np.int64], places: NDArray[np.int64], tiles: _Slots, codec: Codec) -> bytes:
    """Masks and values of an internal node."""
    count = 1 << (3 * log2)
    masks = pack_bits(count, children) + pack_bits(count, places[tiles.is_on])
    values = np.full(count, codec.background, dtype=codec.dtype)
    values[places] = tiles.values
    is_on = np.zeros(count, dtype=np.bool_)
    is_on[places[tiles.is_on]] = True
    is_off = ~is_on
    is_off[children] = False
    return masks + write_values(values, is_on, is_off, codec)


def _buffers(
    grid: SparseGrid, kind: str, order: NDArray[np.intp], masks: NDArray[np.uint64], codec: Codec
) -> list[bytes]:
    """Leaves again, now with their values."""
    if kind in ("float", "half"):
        if grid.leaf_values is not None:
            return [write_leaf_values(masks, grid.leaf_values[order], codec)]
        chunks = np.array_split(np.arange(len(masks)), max(1, len(masks) >> 14))
        ones = [np.ones((len(chunk), 512), dtype=np.float32) for chunk in chunks]
        return [
            write_leaf_values(masks[chunk], _masked(one, masks[chunk]), codec)
            for chunk, one in zip(chunks, ones, strict=True)
        ]
    layout: list[Any] = [("mask", "<u8", 8), ("ijk", "<i4", 3)]
    if kind == "bool":
        layout.append(("values", "<u8", 8))
    records = np.zeros(len(masks), dtype=np.dtype(layout))
    records["mask"] = masks
    records["ijk"] = grid.leaf_ijk[order]
    if kind == "bool":
        records["values"] = masks
    return [records.tobytes()]


def _masked(ones: NDArray[np.float32], masks: NDArray[np.uint64]) -> NDArray[np.float32]:
    """1 where active, 0 elsewhere."""
    bits = np.unpackbits(masks.view(np.uint8), axis=1, bitorder="little")
    return ones * bits
