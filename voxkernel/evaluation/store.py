"""The table of a run while it grows: parts on disk, few and large again from time to time."""

from __future__ import annotations

import posixpath
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel import run_table
from voxkernel.evaluation.worker import Outcome
from voxkernel.run_index import RunIndex, open_index

__all__ = ["RunStore"]

_SECONDS = 1.0  # between two parts
_ROWS = 2000  # that make a part at once
_PARTS = 48  # of one size that are made one
_LARGE = 100_000  # rows of a part that is not made larger
_STALE = 0.2  # share of replaced rows from which large parts are written again
_AT_ONCE = 5000  # rows that are dictionaries at a time


class RunStore:
    """Writes rows of a run; one process writes to a run at a time.

    Whatever `n_stored` counts is on disk: a part is written next to its final name and moved there, and parts are
    deleted only when their rows are in a larger one. Neighbours are made one, under a name of their age, until one is
    large: then it stays as it is.
    """

    def __init__(self, run: str) -> None:
        self.fs, self.path = run_table.open_run(run)
        self._buffer: list[Mapping[str, Any]] = []
        self._last_write = time.monotonic()
        names = run_table.part_names(self.fs, self.path)
        self._last_name = names[-1] if names else ""
        self._small: list[str] = []  # parts as they were written, the newest of all
        self._medium: dict[str, int] = {}  # those before them, and their rows
        self.n_stored = 0
        self._n_buffered = 0

    def add(self, outcome: Outcome) -> None:
        """Take the rows of one mesh, all of which will be in one part; pictures are written first."""
        for name, data in outcome.files.items():
            run_table.write_bytes(self.fs, posixpath.join(self.path, name), data)
        self._buffer += outcome.rows
        self._n_buffered += outcome.units

    def replace(self, index: RunIndex, places: NDArray[np.int64], labels: Sequence[str | None]) -> None:
        """Give rows other labels; they are no new result."""
        for k in range(0, len(places), _AT_ONCE):
            rows = index.rows(places[k : k + _AT_ONCE]).to_pylist()
            own = labels[k : k + _AT_ONCE]
            self._buffer += [{**row, "label": label} for row, label in zip(rows, own, strict=True)]
            self.flush()

    def flush_if_due(self) -> None:
        """Write what waits when a second has passed or there is much of it."""
        if self._buffer and (time.monotonic() - self._last_write > _SECONDS or len(self._buffer) >= _ROWS):
            self.flush()

    def flush(self) -> None:
        """Write what waits."""
        if self._buffer:
            table = run_table.to_table(self._buffer)
            self._last_name = run_table.write_table_part(self.fs, self.path, table, after=self._last_name)
            self._small.append(self._last_name)
            self._buffer = []
        self.n_stored += self._n_buffered
        self._n_buffered = 0
        self._last_write = time.monotonic()
        if len(self._small) >= _PARTS:
            self._merge(self._small)
            self._small = []
            if len(self._medium) >= _PARTS or sum(self._medium.values()) >= _LARGE:
                names, self._medium = list(self._medium), {}
                self._merge(names)

    def compact(self, columns: Sequence[str] = ()) -> RunIndex:
        """Make few parts of many, without what has been replaced, and index them, marks and all.

        The index has more columns than the keys. A small run becomes one part. Of a large one, parts that are large
        stay, unless much of them was replaced.
        """
        self.flush()
        index = open_index(self.fs, self.path, columns, with_marks=True)
        names, sizes = index.names, index.part_sizes()
        is_stale = index.n_stale > _STALE * sum(n for n, _ in sizes)
        self._small, self._medium = [], {}
        groups = [g for g in _groups(sizes) if len(g) > 1 or (is_stale and sizes[g[0]][0] > sizes[g[0]][1])]
        if groups:
            with closing(index):
                for group in groups:
                    self._replaced([names[k] for k in group], index.rows(index.places_of(group)))
            index = open_index(self.fs, self.path, columns, with_marks=True)
        for name, (n, _) in list(zip(index.names, index.part_sizes(), strict=True))[-1:]:
            if n < _LARGE:  # it goes on growing
                self._medium[name] = n
        return index

    def _merge(self, names: Sequence[str]) -> None:
        """Make one part of the newest ones; it is not touched again in this run if it is large."""
        table = run_table.read_parts(self.fs, names)
        made = self._replaced(names, table)
        if len(table) < _LARGE:
            self._medium[made] = len(table)

    def _replaced(self, names: Sequence[str], table: Any) -> str:
        """Write what counts of neighbouring parts as one of their age, and delete them."""
        made = run_table.write_table_part(self.fs, self.path, table, like=names[-1])
        run_table.remove_parts(self.fs, names)
        return made


def _groups(sizes: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Divide parts into neighbours that are to be one; large ones are alone."""
    groups: list[list[int]] = []
    n_rows = _LARGE
    for k, (n, _) in enumerate(sizes):
        if n_rows >= _LARGE or n >= _LARGE:
            groups.append([])
            n_rows = 0
        groups[-1].append(k)
        n_rows += n
    return groups
