"""The one check of a path before anything is opened: reading a pipe or a device may never end."""

import os
import stat
from pathlib import Path
from typing import Any

__all__ = ["check_stored_file", "input_file"]


def input_file(path: str | os.PathLike[str], error: type[OSError], *, name: str = "path") -> Path:
    """The path, if it leads to an existing regular file; links are followed. Else `error`, in one line."""
    shown = os.fsdecode(path)
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        raise error(f"`{name}` must be an existing file; got '{shown}'") from None
    except (OSError, ValueError) as problem:  # no such folder, no right to look, a name too long, a null byte
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"`{name}` must be an existing file; got {shown!r}: {reason}") from None
    if stat.S_ISDIR(mode):
        raise error(f"`{name}` must be a file; got the folder '{shown}'")
    if not stat.S_ISREG(mode):
        raise error(f"`{name}` must be a regular file; got {_kind(mode)} '{shown}'")
    return Path(path)


def _kind(mode: int) -> str:
    if stat.S_ISFIFO(mode):
        return "the pipe"
    if stat.S_ISSOCK(mode):
        return "the socket"
    return "the device"


def check_stored_file(fs: Any, path: str) -> None:
    """The same for a path on any file system; one that is missing is left to the call that opens it."""
    if fs.exists(path) and not fs.isfile(path):
        raise OSError(f"'{path}' must be a regular file; got a {'folder' if fs.isdir(path) else 'pipe or a device'}")
