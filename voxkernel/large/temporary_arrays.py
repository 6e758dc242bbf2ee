"""Rows of numbers in a temporary file without a name, which is gone when it is closed, however that comes about."""

from __future__ import annotations

import os
import tempfile
import weakref
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

__all__ = ["TemporaryRows"]


class TemporaryRows:
    """Rows that are written one after the other and then mapped into memory."""

    def __init__(self, dtype: DTypeLike, width: int, folder: str | os.PathLike[str] | None) -> None:
        # On Linux the file never has a name; elsewhere the system removes it as it is closed.
        self._file: Any = tempfile.TemporaryFile(dir=folder)
        weakref.finalize(self, self._file.close)
        self._dtype, self._width = np.dtype(dtype), width
        self.n = 0

    def write(self, rows: NDArray[Any]) -> None:
        """Append rows."""
        self._file.write(np.ascontiguousarray(rows, self._dtype).reshape(-1).view(np.uint8).data)
        self.n += rows.size // self._width

    def rows(self) -> NDArray[Any]:
        """All of them, mapped, read-only; they outlast the file."""
        if not self.n:
            return np.empty((0, self._width), self._dtype)
        self._file.flush()
        return np.memmap(self._file, self._dtype, "r", shape=(self.n, self._width))
