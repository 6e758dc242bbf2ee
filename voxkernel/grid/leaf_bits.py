"""The 512 bits of a leaf as eight uint64 words: word = x, bit = y*8 + z, lowest bit first."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["FULL", "bit_bounds", "halve", "pack", "popcount", "unpack"]

FULL = np.uint64(0xFFFFFFFFFFFFFFFF)

_ONES = np.array([bin(byte).count("1") for byte in range(256)], dtype=np.uint8)
_LOWEST = np.array([(byte & -byte).bit_length() - 1 for byte in range(256)], dtype=np.int8)
_HIGHEST = np.array([byte.bit_length() - 1 for byte in range(256)], dtype=np.int8)


def pack(blocks: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Masks (n, 8) of blocks (n, 8, 8, 8) indexed x, y, z."""
    rows = np.packbits(blocks.reshape(len(blocks), 8, 64), axis=-1, bitorder="little")
    return rows.view("<u8")[..., 0].astype(np.uint64, copy=False)


def unpack(masks: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """Blocks (n, 8, 8, 8) of masks (n, 8)."""
    rows = np.ascontiguousarray(masks, dtype="<u8").view(np.uint8).reshape(len(masks), 64)
    return np.unpackbits(rows, axis=1, bitorder="little").view(np.bool_).reshape(len(masks), 8, 8, 8)


def popcount(masks: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Number of set bits (n,) of masks (n, 8)."""
    count = getattr(np, "bitwise_count", None)
    if count is not None:
        return count(masks).sum(axis=1, dtype=np.int64)
    rows = np.ascontiguousarray(masks).view(np.uint8).reshape(len(masks), 64)
    return _ONES[rows].sum(axis=1, dtype=np.int64)


def bit_bounds(masks: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lowest and highest set x, y, z (n, 3) of masks (n, 8), none of them empty."""
    low = np.empty((len(masks), 3), dtype=np.int64)
    high = np.empty_like(low)
    slabs = masks != 0
    low[:, 0] = slabs.argmax(axis=1)
    high[:, 0] = 7 - slabs[:, ::-1].argmax(axis=1)
    plane = np.ascontiguousarray(np.bitwise_or.reduce(masks, axis=1), dtype="<u8")
    rows = plane.view(np.uint8).reshape(len(masks), 8)
    low[:, 1] = (rows != 0).argmax(axis=1)
    high[:, 1] = 7 - (rows[:, ::-1] != 0).argmax(axis=1)
    line = np.bitwise_or.reduce(rows, axis=1)
    low[:, 2] = _LOWEST[line]
    high[:, 2] = _HIGHEST[line]
    return low, high


def halve(masks: NDArray[np.uint64], octant: NDArray[np.int64], rule: Literal["any", "all"]) -> NDArray[np.uint64]:
    """Masks (n, 8) at half the resolution, each in its octant (x*4 + y*2 + z) of the parent's leaf."""
    join = np.bitwise_or if rule == "any" else np.bitwise_and
    words = join(masks[:, 0::2], masks[:, 1::2])
    words = join(words, words >> np.uint64(8)) & np.uint64(0x00FF00FF00FF00FF)
    words = (words | (words >> np.uint64(8))) & np.uint64(0x0000FFFF0000FFFF)
    words = (words | (words >> np.uint64(16))) & np.uint64(0x00000000FFFFFFFF)
    words = join(words, words >> np.uint64(1)) & np.uint64(0x5555555555555555)
    words = (words | (words >> np.uint64(1))) & np.uint64(0x3333333333333333)
    words = (words | (words >> np.uint64(2))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    x, y, z = octant >> 2, (octant >> 1) & 1, octant & 1
    words <<= (32 * y + 4 * z).astype(np.uint64)[:, None]
    parents = np.zeros((len(masks), 8), dtype=np.uint64)
    np.put_along_axis(parents, 4 * x[:, None] + np.arange(4), words, axis=1)
    return parents
