"""Morton codes of 8^3 leaves: every octree cell is one run of consecutive codes.

A leaf coordinate is a voxel coordinate divided by 8, rounded down. Its three coordinates (21 bits each,
shifted to be non-negative) are interleaved, x in the highest place. A cell of edge 8 * 2**level is then
exactly the codes ``code ... code + 8**level - 1``, which turns questions about nested cells into searches in
a sorted list. Ends of runs are stored inclusive: the code after the last one would not fit into an int64.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "MAX_LOG2", "REACH", "Cut", "count_up", "decode", "decompose", "encode", "interleaved", "last_of", "parent_of",
]  # fmt: skip

REACH = 1 << 23
"""Voxel coordinates lie in [-REACH, REACH)."""

MAX_LOG2 = 23
"""Edge of the largest tile, as a power of two; eight of them fill the whole range."""

_LEAF_REACH = REACH >> 3
_LOW = np.int64(2047)


def _spread_table() -> NDArray[np.int64]:
    """Every 11-bit number with two zero bits between its bits: cheaper than five rounds of shifts."""
    numbers = np.arange(2048, dtype=np.int64)
    spread = np.zeros(2048, dtype=np.int64)
    for bit in range(11):
        spread |= ((numbers >> bit) & 1) << (3 * bit)
    return spread


def _gather_table() -> NDArray[np.int64]:
    """The 4 bits of each axis of every 12-bit code, at bits 0 (x), 21 (y) and 42 (z)."""
    codes = np.arange(4096, dtype=np.int64)
    packed = np.zeros(4096, dtype=np.int64)
    for bit in range(4):
        for axis in range(3):
            packed |= ((codes >> (3 * bit + 2 - axis)) & 1) << (21 * axis + bit)
    return packed


_SPREAD = _spread_table()
_GATHER = _gather_table()


def encode(leaf: NDArray[np.signedinteger]) -> NDArray[np.int64]:
    """Codes (n,) of leaf coordinates (n, 3), each in [-2**20, 2**20)."""
    return interleaved(leaf, _LEAF_REACH)


def interleaved(ijk: NDArray[np.signedinteger], shift: int = 0) -> NDArray[np.int64]:
    """Interleave the bits of ``ijk + shift`` (n, 3), each in [0, 2**21), x in the highest place."""
    code = np.zeros(len(ijk), dtype=np.int64)
    for axis in range(3):
        shifted = ijk[:, axis].astype(np.int64) + shift
        spread = _SPREAD[shifted >> 11]
        spread <<= 33
        spread |= _SPREAD[shifted & _LOW]
        spread <<= 2 - axis
        code |= spread
    return code


def decode(code: NDArray[np.int64]) -> NDArray[np.int32]:
    """Leaf coordinates (n, 3) of codes (n,): the inverse of `encode`."""
    packed = _GATHER[code & 4095]
    for place in range(1, 6):
        packed |= _GATHER[(code >> (12 * place)) & 4095] << (4 * place)
    leaf = np.empty((len(code), 3), dtype=np.int32)
    for axis in range(3):
        leaf[:, axis] = ((packed >> (21 * axis)) & 0x1FFFFF) - _LEAF_REACH
    return leaf


def last_of(code: NDArray[np.int64], level: NDArray[np.integer]) -> NDArray[np.int64]:
    """Last code of the cells that start at `code` and have edge 8 * 2**level."""
    return code + ((np.int64(1) << (3 * level.astype(np.int64))) - 1)


def parent_of(code: NDArray[np.int64]) -> NDArray[np.int64]:
    """Codes of leaves twice as large in a grid of half the resolution; keeps the order.

    Half of a shifted coordinate is shifted by half as much; the missing part is added in the two highest
    places.
    """
    half = code >> 3
    octant = half >> 57
    return (half & ((np.int64(1) << 57) - 1)) | ((7 - octant) << 57) | (octant << 60)


def count_up(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """``0 ... counts[0]-1, 0 ... counts[1]-1, ...``: the place of each item within its group."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total, dtype=np.int64) - np.repeat(ends - counts, counts)


class Cut(NamedTuple):
    """Octree cells: first code, level, and the run each was cut from."""

    code: NDArray[np.int64]
    level: NDArray[np.int8]
    owner: NDArray[np.int64]


def decompose(code: NDArray[np.int64], last: NDArray[np.int64]) -> Cut:
    """Cut runs of codes into the fewest octree cells, at most 14 per run and level, unsorted."""
    low, high = code.astype(np.uint64), last.astype(np.uint64) + np.uint64(1)
    owner = np.arange(len(code), dtype=np.int64)
    pieces: list[Cut] = []
    top = MAX_LOG2 - 3
    for level in range(top + 1):
        if not len(low):
            break
        width, up = np.uint64(3 * level), np.uint64(3 * level + 3)
        first = ((low + (np.uint64(1) << up) - np.uint64(1)) >> up) << up
        end = (high >> up) << up
        ends_here = (first >= end) | (level == top)
        rises = ~ends_here
        begins = np.concatenate([low, end[rises]])
        stops = np.concatenate([np.where(ends_here, high, first), high[rises]])
        counts = ((stops - begins) >> width).astype(np.int64)
        codes = np.repeat(begins.astype(np.int64), counts) + (count_up(counts) << (3 * level))
        owners = np.repeat(np.concatenate([owner, owner[rises]]), counts)
        pieces.append(Cut(codes, np.full(len(codes), level, dtype=np.int8), owners))
        low, high, owner = first[rises], end[rises], owner[rises]
    if not pieces:
        return Cut(np.zeros(0, np.int64), np.zeros(0, np.int8), np.zeros(0, np.int64))
    return Cut(*(np.concatenate(column) for column in zip(*pieces, strict=True)))
