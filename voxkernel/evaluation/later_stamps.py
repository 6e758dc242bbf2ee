"""Stamps of files found equal by their hashes: small and beside the rows, so that no row is written again for them."""

from __future__ import annotations

import io
import posixpath
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel import run_table
from voxkernel._extras import optional
from voxkernel.evaluation.file_stamp import STAMP_COLUMNS, FileStamp, are_untouched

__all__ = ["LaterStamps"]

_NAME = "stamps.parquet"


class LaterStamps:
    """Of files of a run: the content a stamp was seen with, and the stamp. What cannot be read is none."""

    def __init__(self, fs: Any, run_path: str) -> None:
        self._fs, self._path = fs, posixpath.join(run_path, _NAME)
        self._table = self._read()

    def are_untouched(self, names: Sequence[str], hashes: Any, paths: Sequence[str]) -> NDArray[np.bool_]:
        """Say of each file whether it has the stamp that it had when its content was the one of `hashes`."""
        pa, compute = optional("pyarrow"), optional("pyarrow.compute")
        place = compute.index_in(pa.array(names, pa.string()), value_set=self._table["file"].combine_chunks())
        known = self._table.take(place)
        is_same = np.asarray(compute.equal(known["content_hash"], hashes).fill_null(False).to_numpy(), bool)
        at = np.flatnonzero(is_same)
        is_same[at] = are_untouched([paths[i] for i in at.tolist()], known.take(pa.array(at)))
        return is_same

    def add(self, names: Sequence[str], hashes: Sequence[str], stamps: Sequence[FileStamp]) -> None:
        """Keep stamps; those of the same files before are replaced."""
        if not names:
            return
        pa, compute = optional("pyarrow"), optional("pyarrow.compute")
        columns = [list(names), list(hashes), *map(list, zip(*stamps, strict=True))]
        fresh = pa.table(dict(zip(_schema().names, columns, strict=True)), schema=_schema())
        old = self._table.filter(compute.invert(compute.is_in(self._table["file"], value_set=fresh["file"])))
        self._table = pa.concat_tables([old, fresh])
        sink = io.BytesIO()
        optional("pyarrow.parquet").write_table(self._table, sink, compression="zstd")
        run_table.write_bytes(self._fs, self._path, sink.getvalue())

    def _read(self) -> Any:
        pa = optional("pyarrow")
        try:
            with self._fs.open(self._path, "rb") as stream:
                return optional("pyarrow.parquet").read_table(io.BytesIO(stream.read())).cast(_schema())
        except (OSError, ValueError, pa.ArrowException):
            return _schema().empty_table()


def _schema() -> Any:
    pa = optional("pyarrow")
    return pa.schema([("file", pa.string()), ("content_hash", pa.string()), *((n, pa.int64()) for n in STAMP_COLUMNS)])
