"""The tree of one grid in a .vdb file -> tiles and leaves."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.errors import GridReadError
from voxkernel.grid.leaf_bits import unpack
from voxkernel.grid.morton import REACH
from voxkernel.vdb.file_format import Source
from voxkernel.vdb.node_values import Codec, read_leaf_values, read_values, unpack_bits

__all__ = ["Tree", "read_tree"]

_NODES = {5: 7, 4: 3}  # log2 of a node's slots per axis -> log2 of the edge of a slot


class Tree(NamedTuple):
    """All of a tree's values: tiles of three sizes, active or not, and leaves."""

    tile_ijk: NDArray[np.int64]
    tile_log2: NDArray[np.int8]
    tile_values: NDArray[Any]
    tile_is_on: NDArray[np.bool_]
    leaf_ijk: NDArray[np.int64]
    leaf_mask: NDArray[np.uint64]
    leaf_values: NDArray[Any] | None
    background: Any

    @property
    def is_mask(self) -> bool:
        """Whether every value says what the masks say already: true where active, false elsewhere."""
        if self.tile_values.dtype.kind != "b" or self.background:
            return False
        if (self.tile_values != self.tile_is_on).any():
            return False
        return self.leaf_values is None or bool((self.leaf_values == self.leaf_mask).all())


class _Tiles:
    """Tiles collected node by node."""

    def __init__(self, dtype: np.dtype[Any]) -> None:
        self.ijk = [np.zeros((0, 3), np.int64)]
        self.log2 = [np.zeros(0, np.int8)]
        self.values = [np.zeros(0, dtype)]
        self.is_on = [np.zeros(0, np.bool_)]

    def add(self, ijk: NDArray[np.int64], log2: int, values: NDArray[Any], is_on: NDArray[np.bool_]) -> None:
        self.ijk.append(ijk)
        self.log2.append(np.full(len(ijk), log2, np.int8))
        self.values.append(values)
        self.is_on.append(is_on)


def read_tree(source: Source, kind: str, flags: int, block_at: int) -> Tree:
    """Topology, then buffers. `block_at` is where the file says the buffers begin, 0 if it does not say."""
    n_buffers = source.number("i", "the number of buffers")
    if n_buffers != 1:
        raise GridReadError(f"a tree must have 1 buffer; got {n_buffers}")
    value_dtype = np.dtype("<f4" if kind in ("float", "half") else "u1")
    background = source.array(value_dtype, 1, "the background")[0]
    codec = Codec.of(kind, background, flags)
    n_tiles, n_children = source.unpack("II", "the size of the root")
    tiles = _Tiles(codec.dtype)
    _read_root_tiles(source, n_tiles, value_dtype, codec, tiles)
    source.need(n_children * (12 + 2 * 4096 + 1), f"{n_children} nodes below the root")
    leaf_ijk: list[NDArray[np.int64]] = [np.zeros((0, 3), np.int64)]
    for _ in range(n_children):
        corner = _checked_corners(source.array("<i4", 3, "a node's origin").astype(np.int64)[None])[0]
        for child in _read_node(source, 5, corner, codec, tiles):
            leaves = _read_node(source, 4, child, codec, tiles)
            source.take(64 * len(leaves), "leaf masks")  # the buffers repeat them
            leaf_ijk.append(leaves)
    if block_at and source.at != block_at:
        raise GridReadError(f"the buffers of a grid must begin at byte {block_at}; the topology ends at {source.at}")
    corners = np.concatenate(leaf_ijk)
    leaf_mask, leaf_values = _read_leaves(source, kind, len(corners), codec)
    return Tree(
        np.concatenate(tiles.ijk),
        np.concatenate(tiles.log2),
        np.concatenate(tiles.values),
        np.concatenate(tiles.is_on),
        corners,
        leaf_mask,
        leaf_values,
        codec.background,
    )


def _checked_corners(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Root entries are aligned, and near enough to zero for this library."""
    if (corners & 4095).any():
        raise GridReadError(f"root entries must lie at multiples of 4096; got {corners[0].tolist()}")
    if (corners < -REACH).any() or (corners >= REACH).any():
        raise GridReadError(f"voxels must lie in {-REACH}..{REACH - 1}; got a node at {corners[0].tolist()}")
    return corners


def _read_root_tiles(source: Source, n_tiles: int, value_dtype: np.dtype[Any], codec: Codec, tiles: _Tiles) -> None:
    """Tiles of 4096^3 voxels."""
    if not n_tiles:
        return
    record = np.dtype([("ijk", "<i4", 3), ("value", value_dtype), ("is_on", "u1")])
    entries = source.array(record, n_tiles, f"{n_tiles} tiles of the root")
    values = entries["value"] != 0 if codec.dtype.kind == "b" else entries["value"]
    is_on = entries["is_on"] != 0
    kept = is_on | (values != codec.background)
    corners = _checked_corners(entries["ijk"].astype(np.int64)[kept])
    tiles.add(corners, 12, values[kept].astype(codec.dtype), is_on[kept])


def _read_node(source: Source, log2: int, corner: NDArray[np.int64], codec: Codec, tiles: _Tiles) -> NDArray[np.int64]:
    """Keep a node's tiles; return the corners of its children, which follow it in the file."""
    count, below = 1 << (3 * log2), _NODES[log2]
    has_child = unpack_bits(source.take(count // 8, "a node's child mask"))
    is_on = unpack_bits(source.take(count // 8, "a node's value mask"))
    if (has_child & is_on).any():
        raise GridReadError(f"a slot of a node must be a child or a tile; got both, at byte {source.at}")
    values = read_values(source, is_on, codec)
    kept = np.flatnonzero(~has_child & (is_on | (values != codec.background)))
    if len(kept):
        tiles.add(_slots(kept, log2, below) + corner, below, values[kept], is_on[kept])
    return _slots(np.flatnonzero(has_child), log2, below) + corner


def _slots(index: NDArray[np.int64], log2: int, below: int) -> NDArray[np.int64]:
    """Corners of a node's slots, z fastest."""
    side = (1 << log2) - 1
    return np.stack([index >> (2 * log2), (index >> log2) & side, index & side], axis=1) << below


def _read_leaves(
    source: Source, kind: str, n_leaves: int, codec: Codec
) -> tuple[NDArray[np.uint64], NDArray[Any] | None]:
    """Masks and values: (L, 512) numbers, or the bits (L, 8) of bools, or None for a mask."""
    if kind in ("float", "half"):
        return read_leaf_values(source, n_leaves, codec)
    parts: list[Any] = [("mask", "<u8", 8), ("ijk", "<i4", 3)]
    if kind == "bool":
        parts.append(("values", "<u8", 8))
    records = source.array(np.dtype(parts), n_leaves, f"{n_leaves} leaves")
    masks = np.ascontiguousarray(records["mask"], dtype=np.uint64)
    return masks, (np.ascontiguousarray(records["values"], dtype=np.uint64) if kind == "bool" else None)


def leaf_numbers(values: NDArray[Any] | None, masks: NDArray[np.uint64]) -> NDArray[np.float32]:
    """Leaf values as numbers, whatever the kind of the tree."""
    if values is not None and values.dtype == np.float32:
        return values
    return unpack(masks if values is None else values).reshape(-1, 512).astype(np.float32)
