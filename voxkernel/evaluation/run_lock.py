"""One process writes to a run at a time: the lock of a run folder, and who holds it."""

from __future__ import annotations

import errno
import json
import os
import platform
import warnings
from collections.abc import Generator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from voxkernel._file_lock import lock_file
from voxkernel._plain import json_text
from voxkernel.run_table import is_local

__all__ = ["locked_run"]

_NAME = ".lock"
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}


@contextmanager
def locked_run(fs: Any, run_path: str) -> Generator[bool]:
    """Keep other processes from writing to a run; gives whether they are kept from it.

    A run that is no folder of this machine (object stores) has no lock. The file stays, as deleting it would let
    two processes hold one lock each.

    Raises
    ------
    BlockingIOError
        If another process, or another call in this one, writes to the run.
    OSError
        If nothing can be written to the folder.
    """
    if not is_local(fs):
        yield False
        return
    file = _taken(run_path)
    if file is None:
        yield False
        return
    with file:
        with suppress(OSError):  # on a full disk, say: the lock holds without a name on it
            _sign(file)
        try:
            yield True
        finally:
            with suppress(OSError):
                file.truncate(0)


def _taken(run_path: str) -> IO[bytes] | None:
    """Take the lock; None, with a warning, where the file system has none."""
    path = Path(run_path) / _NAME
    try:
        os.makedirs(run_path, exist_ok=True)
        file = lock_file(path)
    except OSError as error:
        reason = error.strerror or error
        if error.errno in _NO_LOCKS:
            text = f"'{run_path}' is on a file system without locks ({reason}): no other process may write to this run"
            warnings.warn(text, RuntimeWarning, stacklevel=4)
            return None
        raise type(error)(f"`output` must be a folder that can be written to; got '{run_path}' ({reason})") from error
    if file is None:
        held = f"`output` must not be in use by another evaluation; got '{run_path}', in use by {_owner(path)}"
        raise BlockingIOError(held)
    return file


def _sign(file: IO[bytes]) -> None:
    """Write who holds the lock."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    owner = {"pid": os.getpid(), "host": platform.node(), "started": started}
    file.truncate(0)
    file.write(json_text(owner).encode())


def _owner(path: Path) -> str:
    """Say who holds the lock, as far as its file tells."""
    try:
        owner = json.loads(path.read_bytes())
        return f"process {owner['pid']:d} on {owner['host']!s}, started {owner['started']!s}"
    except (OSError, ValueError, KeyError, TypeError):  # between taking the lock and signing it
        return "a process that has not given its name"
