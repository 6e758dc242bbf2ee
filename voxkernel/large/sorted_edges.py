"""Whether a surface is closed, decided exactly: its edges in temporary files, sorted part by part."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from voxkernel.large.chunks import Chunk
from voxkernel.large.edge_sums import position_keys
from voxkernel.large.temporary_arrays import TemporaryRows

__all__ = ["edges_cancel"]

_PARTS = 256  # files; each is sorted in memory: of a billion edges, 4 million at a time


def edges_cancel(chunks: Callable[[], Iterator[Chunk]], folder: str | os.PathLike[str] | None) -> bool:
    """Whether every edge is traversed equally often in both directions.

    An edge goes to a file by a hash of its ends, with its ends and its direction, so that all that is the same comes
    together. Vertices are their ids, or their positions where there are none.
    """
    files: dict[int, TemporaryRows] = {}
    for chunk in chunks():
        ends = _ends(chunk)
        for i, j in ((0, 1), (1, 2), (2, 0)):
            rows, where = _edges(ends[:, i], ends[:, j])
            order = np.argsort(where, kind="stable")
            cuts = np.searchsorted(where[order], np.arange(_PARTS + 1))
            for part in np.flatnonzero(np.diff(cuts)).tolist():
                if part not in files:
                    files[part] = TemporaryRows(np.uint64, rows.shape[1], folder)
                files[part].write(rows[order[cuts[part] : cuts[part + 1]]])
    return all(_cancel(np.asarray(file.rows())) for file in files.values())


def _ends(chunk: Chunk) -> NDArray[np.uint64]:
    """What names the corners, (m, 3, 1) or (m, 3, 3); 0 and -0 are equal."""
    if chunk.ids is not None:
        return chunk.ids.astype(np.uint64)[..., None]
    return (chunk.corners + 0.0).view(np.uint64)


def _edges(begin: NDArray[np.uint64], end: NDArray[np.uint64]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Both ends, the smaller one first, and 1 for an edge that ran so, -1 for one that did not; and its file."""
    is_before, is_same = np.zeros(len(begin), bool), np.ones(len(begin), bool)
    for k in range(begin.shape[1]):
        is_before |= is_same & (begin[:, k] < end[:, k])
        is_same &= begin[:, k] == end[:, k]
    begin, end, is_before = begin[~is_same], end[~is_same], is_before[~is_same]
    first, last = np.where(is_before[:, None], begin, end), np.where(is_before[:, None], end, begin)
    sign = np.where(is_before, 1, -1).astype(np.int64).view(np.uint64)
    where = position_keys(first) ^ (position_keys(last) * np.uint64(3))
    return np.column_stack([first, last, sign]), (where >> np.uint64(32)) % np.uint64(_PARTS)


def _cancel(rows: NDArray[np.uint64]) -> bool:
    if not len(rows):
        return True
    rows = rows[np.lexsort(rows[:, :-1].T)]
    is_new = np.concatenate([[True], (np.diff(rows[:, :-1].view(np.int64), axis=0) != 0).any(axis=1)])
    return not np.add.reduceat(rows[:, -1].view(np.int64), np.flatnonzero(is_new)).any()
