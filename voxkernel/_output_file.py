"""Files that are there completely or not at all."""

from __future__ import annotations

import os
import re
import uuid
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

__all__ = ["is_unfinished", "whole_file"]

_UNFINISHED = re.compile(r"\.[0-9a-f]{32}\.tmp")


@contextmanager
def whole_file(path: str | os.PathLike[str], *, durable: bool = False) -> Generator[IO[bytes]]:
    """Open a new file beside `path` that takes its place in one step at the end, or goes where anything is raised.

    A reader never sees half a file, and what was there stays until then. `durable` waits for the disk, so that this
    holds when the machine stops, too.
    """
    beside = Path(path).with_name(f".{uuid.uuid4().hex}.tmp")
    try:
        with beside.open("xb") as stream:
            yield stream
            if durable:
                stream.flush()
                os.fsync(stream.fileno())
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def is_unfinished(name: str) -> bool:
    """Whether a file is one that `whole_file` left behind when its process was killed."""
    return _UNFINISHED.fullmatch(name) is not None
