"""Runs with more rows than a page can hold: which rows it shows, and the whole table in a file beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._output_file import whole_file
from voxkernel.report.rows import ReportRows, worst_first
from voxkernel.run_index import RunIndex

__all__ = ["MOST_ROWS", "rows_to_show", "write_whole_table"]

MOST_ROWS = 20_000  # in the table of a page
_GROUP = 25_000  # rows that are compressed at a time


def rows_to_show(rows: ReportRows, n: int) -> NDArray[np.int64]:
    """Choose rows for the table of a page: failed ones, the worst of each kind, and others evenly from first to last.

    Up to a quarter of them failed, and a quarter are the worst; given in the order of the table.
    """
    failed = np.array(rows.ids("failed"), np.int64)
    chosen = [failed[: n // 4]]
    kinds = [ids for ids in _of_each_kind(rows, failed) if len(ids)]
    for ids in kinds:
        chosen.append(np.array(worst_first(rows, ids)[: n // 4 // len(kinds)], np.int64))
    first = np.unique(np.concatenate(chosen))
    others = np.setdiff1d(np.arange(rows.n), first)
    even = np.linspace(0, len(others) - 1, min(len(others), n - len(first))).round().astype(np.int64)
    return np.union1d(first, others[even])


def _of_each_kind(rows: ReportRows, failed: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    is_object, is_cell = (np.isfinite(rows.numbers[name]) for name in ("object", "cell"))
    kinds = (~is_object & ~is_cell, is_cell & ~is_object, is_object)
    return [np.setdiff1d(np.flatnonzero(kind), failed) for kind in kinds]


def write_whole_table(page: Path, index: RunIndex) -> Path:
    """Write every row that counts to a Parquet file beside the page, one part of the run in memory at a time."""
    from voxkernel.run_table import schema

    path = page.with_name(f"{page.stem}.rows.parquet")
    writer_of = optional("pyarrow.parquet").ParquetWriter
    with whole_file(path) as stream, writer_of(stream, schema(), compression="zstd") as writer:
        for table in index.parts():
            writer.write_table(table, row_group_size=_GROUP)
            del table  # before the next one is read
            optional("pyarrow").default_memory_pool().release_unused()
    return path
