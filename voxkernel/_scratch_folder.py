"""The temporary folder of an evaluation, and those that killed evaluations have left."""

from __future__ import annotations

import os
import platform
import shutil
import stat
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from voxkernel._file_lock import lock_file

__all__ = ["scratch_folder"]

_PREFIX = "voxkernel-run-"
_MARK = ".owner"  # locked while the owner lives


@contextmanager
def scratch_folder() -> Generator[str]:
    """Give a temporary folder; first remove those whose owners were killed.

    Only a folder that such a call has made is ever removed: one with its mark, of this user and this machine,
    whose mark nobody holds locked. The mark is signed after it is locked, so that a folder just made is left alone.
    """
    _remove_abandoned()
    folder = tempfile.mkdtemp(prefix=_PREFIX)
    mark = None
    try:
        with suppress(OSError):  # no locks here: then nobody can tell that the folder is abandoned, and it stays
            mark = lock_file(Path(folder) / _MARK, wait=True)
            if mark is not None:
                mark.write(_signature())
        yield folder
    finally:
        if mark is not None:
            mark.close()
        _remove(folder)


def _signature() -> bytes:
    return f"temporary folder of voxkernel evaluate on {platform.node()}\n".encode()


def _remove_abandoned() -> None:
    try:
        entries = list(os.scandir(tempfile.gettempdir()))
    except OSError:
        return
    for entry in entries:
        if entry.name.startswith(_PREFIX) and entry.is_dir(follow_symlinks=False) and _is_abandoned(entry.path):
            _remove(entry.path)


def _is_abandoned(folder: str) -> bool:
    """Whether a folder was made here by a process that is gone."""
    path = Path(folder) / _MARK
    try:
        found = path.lstat()
        if not stat.S_ISREG(found.st_mode) or (hasattr(os, "getuid") and found.st_uid != os.getuid()):
            return False
        if path.read_bytes() != _signature():
            return False
        mark = lock_file(path)
    except OSError:
        return False
    if mark is None:
        return False
    mark.close()
    return True


def _remove(folder: str) -> None:
    """Remove a folder, its mark last: what cannot be removed now is known the next time."""
    try:
        entries = [entry for entry in os.scandir(folder) if entry.name != _MARK]
    except OSError:
        return
    for entry in entries:
        if entry.is_dir(follow_symlinks=False):
            shutil.rmtree(entry.path, ignore_errors=True)
        else:
            with suppress(OSError):
                os.unlink(entry.path)
    with suppress(OSError):
        if os.listdir(folder) in ([], [_MARK]):
            (Path(folder) / _MARK).unlink(missing_ok=True)
            os.rmdir(folder)
