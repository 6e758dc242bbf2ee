"""A file that is read again and again: what it was like when it was opened, and whether it still is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from voxkernel.errors import MeshReadError

__all__ = ["StoredFile"]

_Item = TypeVar("_Item")


class StoredFile(NamedTuple):
    """A path, and the size and time of the file there."""

    path: Path
    size: int
    modified_ns: int

    @classmethod
    def of(cls, path: Path) -> StoredFile:
        """Look at a file that exists."""
        state = os.stat(path)
        return cls(path, state.st_size, state.st_mtime_ns)

    def mapped(self, dtype: Any, offset: int, shape: int, *, where: str) -> NDArray[Any]:
        """Map rows of it; a file of another size is refused, because what lies behind its end must not be read.

        Where a file is read on several machines its times may differ, and are not asked for.
        """
        try:
            size = os.stat(self.path).st_size
            if size != self.size:
                raise MeshReadError(f"{where}: {self._resized(size)}")
            return np.memmap(self.path, dtype, "r", offset=offset, shape=(shape,))
        except OSError as error:
            if isinstance(error, MeshReadError):
                raise
            raise MeshReadError(f"{where}: the file cannot be read any more: {error.strerror or error}") from None

    def check(self, name: str) -> None:
        """Refuse a file that is not what it was: passes over two surfaces have no answer."""
        try:
            state = os.stat(self.path)
        except OSError as error:
            raise MeshReadError(f"{name} cannot be read any more: {error.strerror or error}") from None
        if state.st_size != self.size:
            raise MeshReadError(f"{name}: {self._resized(state.st_size)}")
        if state.st_mtime_ns != self.modified_ns:
            raise MeshReadError(f"{name}: the file must not change while it is streamed; it was written again")

    def watched(self, name: str, items: Iterator[_Item]) -> Iterator[_Item]:
        """What a pass reads, between two looks at the file."""
        self.check(name)
        yield from items
        self.check(name)

    def _resized(self, size: int) -> str:
        return f"the file must not change while it is streamed; it had {self.size} bytes, now {size}"
