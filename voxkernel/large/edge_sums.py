"""Whether a surface is closed, from a sum over its edges that cancels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.large.chunks import Chunk

__all__ = ["EdgeSums", "position_keys"]

# Odd constants of SplitMix64 (Steele, Lea, Flood, 2014) and of MurmurHash3; two sums that have nothing in common.
_SEEDS = (0x9E3779B97F4A7C15, 0xD1B54A32D192ED03)
_FACTORS = (0xBF58476D1CE4E5B9, 0x94D049BB133111EB)

Words = NDArray[np.uint64]


class EdgeSums:
    """Signed sums of edge hashes, modulo 2**64: an edge run through one way adds its hash, the other way takes it off.

    Where every edge is traversed equally often in both directions both sums are 0, whatever the hash. Where not, they
    are 0 with a probability of about 2**-128, if the hashes are as good as random numbers.
    """

    def __init__(self) -> None:
        self._sums = [0, 0]

    def add(self, chunk: Chunk) -> None:
        """Add the edges of some triangles; vertices are their ids, or their positions where there are none."""
        for k, seed in enumerate(_SEEDS):
            keys = _of_ids(chunk.ids) if chunk.ids is not None else _of_positions(chunk.corners, seed)
            for i, j in ((0, 1), (1, 2), (2, 0)):
                begin, end = keys[:, i], keys[:, j]
                hashes = _mixed(_mixed(np.minimum(begin, end) + np.uint64(seed)) ^ np.maximum(begin, end))
                signed = np.where(begin < end, hashes, ~hashes + np.uint64(1))
                self._sums[k] += int(signed.sum(dtype=np.uint64, where=begin != end))

    def joined(self, other: EdgeSums) -> EdgeSums:
        """Those of both."""
        both = EdgeSums()
        both._sums = [a + b for a, b in zip(self._sums, other._sums, strict=True)]
        return both

    @property
    def is_zero(self) -> bool:
        """Whether all cancelled."""
        return not any(total % 2**64 for total in self._sums)


def _of_ids(ids: NDArray[np.int64]) -> Words:
    return np.asfortranarray(ids.astype(np.uint64))


def _of_positions(corners: NDArray[np.float64], seed: int) -> Words:
    """One number for equal positions; 0 and -0 are equal. Two positions with one number become one vertex."""
    return np.asfortranarray(position_keys((corners + 0.0).view(np.uint64), seed))


def position_keys(words: Words, seed: int = _SEEDS[0]) -> Words:
    """A hash of the words along the last axis."""
    keys = _mixed(words[..., 0] + np.uint64(seed))
    for k in range(1, words.shape[-1]):
        keys = _mixed(keys ^ words[..., k])
    return keys


def _mixed(words: Words) -> Words:
    """The finaliser of SplitMix64: one to one, every bit depends on every bit."""
    mixed = words ^ (words >> np.uint64(30))
    mixed *= np.uint64(_FACTORS[0])
    mixed ^= mixed >> np.uint64(27)
    mixed *= np.uint64(_FACTORS[1])
    mixed ^= mixed >> np.uint64(31)
    return mixed
