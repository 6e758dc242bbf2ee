"""The table of a run while it grows: parts on disk, few and large again from time to time."""

from __future__ import annotations

import posixpath
import time
from collections.abc import Mapping
from typing import Any

from voxkernel import run_table
from voxkernel.evaluation.worker import Outcome

__all__ = ["RunStore"]

_SECONDS = 1.0  # between two parts
_ROWS = 500  # that make a part at once
_PARTS = 48  # of one size that are made one


class RunStore:
    """Writes rows of a run; one process writes to a run at a time.

    Whatever `n_stored` counts is on disk: a part is written next to its final name and moved there, and parts are
    deleted only when their rows are in a larger one.
    """

    def __init__(self, run: str) -> None:
        self.fs, self.path = run_table.open_run(run)
        self._buffer: list[Mapping[str, Any]] = []
        self._last_write = time.monotonic()
        names = run_table.part_names(self.fs, self.path)
        self._last_name = names[-1] if names else ""
        self._levels: list[list[str]] = [[], names]
        self.n_stored = 0
        self._n_buffered = 0

    def read(self) -> Any:
        """Read the table from disk."""
        return run_table.read_parts(self.fs, run_table.part_names(self.fs, self.path))

    def add(self, outcome: Outcome) -> None:
        """Take the rows of one mesh, all of which will be in one part; pictures are written first."""
        for name, data in outcome.files.items():
            run_table.write_bytes(self.fs, posixpath.join(self.path, name), data)
        self._buffer += outcome.rows
        self._n_buffered += 1

    def add_rows(self, rows: list[Mapping[str, Any]]) -> None:
        """Take rows that are no new result."""
        self._buffer += rows

    def flush_if_due(self) -> None:
        """Write what waits when a second has passed or there is much of it."""
        if self._buffer and (time.monotonic() - self._last_write > _SECONDS or len(self._buffer) >= _ROWS):
            self.flush()

    def flush(self) -> None:
        """Write what waits."""
        if self._buffer:
            self._write(run_table.to_table(self._buffer), 0)
            self._buffer = []
        self.n_stored += self._n_buffered
        self._n_buffered = 0
        self._last_write = time.monotonic()
        level = 0
        while len(self._levels[level]) >= _PARTS:
            self._merge(level)
            level += 1

    def compact(self) -> Any:
        """Make one part of all and give the table."""
        self.flush()
        names = run_table.part_names(self.fs, self.path)
        table = run_table.read_parts(self.fs, names)
        if len(names) > 1:
            self._levels = [[], []]
            self._write(table, 1)
            run_table.remove_parts(self.fs, names)
        return table

    def _merge(self, level: int) -> None:
        names, self._levels[level] = self._levels[level], []
        if level + 1 == len(self._levels):
            self._levels.append([])
        self._write(run_table.read_parts(self.fs, names), level + 1)
        run_table.remove_parts(self.fs, names)

    def _write(self, table: Any, level: int) -> None:
        name = run_table.write_table_part(self.fs, self.path, table, after=self._last_name)
        self._last_name = name
        self._levels[level].append(name)
