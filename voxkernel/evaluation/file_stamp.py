"""What the file system says of a file, by which one that has not changed is known without being read."""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["STAMP_COLUMNS", "FileStamp", "are_untouched", "stamp_of"]

STAMP_COLUMNS = ("file_size", "file_modified_ns", "file_changed_ns", "file_inode")
_JUST_NOW = 2_000_000_000  # nanoseconds; the coarsest clock of a file system in use ticks every two seconds
_TELLS_CHANGE = os.name == "posix"  # elsewhere `st_ctime_ns` is when the file was made
_ABSENT = (-1, -1, -1, -1)


class FileStamp(NamedTuple):
    """Size, times and inode of a file; no program can set the time of change, which every writing sets."""

    size: int
    modified_ns: int
    changed_ns: int
    inode: int


def stamp_of(path: str) -> FileStamp | None:
    """Give the stamp of a file, to be asked for before it is read; None where it would not show every change.

    So it is of URLs, folders, parts of files, systems without a time of change, and a file that changed just now: its
    clock may not tick before it changes again.
    """
    found = _stamp(path)
    return None if found == _ABSENT or found[2] > time.time_ns() - _JUST_NOW else FileStamp(*found)


def are_untouched(paths: Sequence[str], stored: Any) -> NDArray[np.bool_]:
    """Say of each file whether its stamp is the one in the columns of `stored`; none is never the same."""
    is_same = np.ones(len(paths), bool)
    if stored["file_changed_ns"].null_count == len(paths):
        return ~is_same  # rows of an earlier version: nothing to ask the file system about
    found = np.fromiter((number for path in paths for number in _stamp(path)), np.int64, 4 * len(paths)).reshape(-1, 4)
    for k, name in enumerate(STAMP_COLUMNS):
        is_same &= found[:, k] == stored[name].fill_null(-2).to_numpy()
    return is_same


def _stamp(path: str) -> tuple[int, int, int, int]:
    if not _TELLS_CHANGE or "::" in path or "://" in path:
        return _ABSENT
    try:
        about = os.stat(path)
    except (OSError, ValueError):
        return _ABSENT
    if not stat.S_ISREG(about.st_mode):
        return _ABSENT
    return about.st_size, about.st_mtime_ns, about.st_ctime_ns, about.st_ino & (1 << 63) - 1
