"""A lock on a file that the operating system frees when its process ends, however it ends."""

from __future__ import annotations

import errno
import os
import sys
import time
from typing import IO

__all__ = ["lock_file"]

_HELD = {errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK, errno.EDEADLK}
_FAR = 2**30  # Windows keeps others from reading the bytes that are locked, so these lie beyond all text


def lock_file(path: str | os.PathLike[str], *, wait: bool = False) -> IO[bytes] | None:
    """Open a file, which is made where there is none, and lock it; None where somebody else holds it.

    The lock belongs to the file, not to its name: links and other spellings of the path lead to the same lock.
    Closing the file frees it.

    Raises
    ------
    OSError
        If the file cannot be opened, or its file system has no locks.
    """
    while True:
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
        file = os.fdopen(os.open(path, flags, 0o666), "r+b", buffering=0)
        try:
            if not _locked(file, wait):
                file.close()
                return None
            if _is_at(file, path):
                return file
        except BaseException:
            file.close()
            raise
        file.close()  # deleted or replaced while this waited: a lock on it would exclude nobody


def _is_at(file: IO[bytes], path: str | os.PathLike[str]) -> bool:
    """Whether a name still leads to the open file."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), os.stat(path))
    except FileNotFoundError:
        return False


if sys.platform == "win32":

    def _locked(file: IO[bytes], wait: bool) -> bool:
        import msvcrt

        while True:
            file.seek(_FAR)
            try:
                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
            except OSError as error:
                if error.errno not in _HELD:
                    raise
                if not wait:
                    return False
                time.sleep(0.05)
            else:
                return True
            finally:
                file.seek(0)

else:

    def _locked(file: IO[bytes], wait: bool) -> bool:
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except OSError as error:
            if error.errno not in _HELD:
                raise
            return False
        return True
