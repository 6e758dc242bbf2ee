"""What a command is doing, on stderr, once it has taken longer than two seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager

__all__ = ["Stage", "stages"]

Stage = Callable[[str], AbstractContextManager[Callable[[str], None]]]

_FIRST = 2.0  # seconds of a command until its stages are named on a terminal
_LEAST = 0.3  # seconds that a stage lasts which is named after that
_PLAIN = 10.0  # and between lines elsewhere
_ERASE = "\r\x1b[K"


def stages(*, quiet: bool, first: float = _FIRST, plain: float = _PLAIN) -> Stage:
    """Give `stage`: ``with stage("reading mesh.ply") as rename: ...`` names what goes on if the command lasts.

    On a terminal one line is written over every second and gone at the end; elsewhere a line comes every ten seconds of
    a stage. `rename` gives the stage another name.
    """
    if quiet:
        return _silent
    began, on_terminal = time.monotonic(), sys.stderr.isatty()

    @contextmanager
    def stage(name: str) -> Generator[Callable[[str], None]]:
        wait, again = plain, plain
        if on_terminal:
            wait, again = max(first - (time.monotonic() - began), min(_LEAST, first)), min(1.0, first)
        done, names = threading.Event(), [name]
        thread = threading.Thread(target=_tell, args=(names, done, wait, again), daemon=True)
        thread.start()

        def rename(other: str) -> None:
            names[0] = other

        try:
            yield rename
        finally:
            done.set()
            thread.join()

    return stage


@contextmanager
def _silent(name: str) -> Generator[Callable[[str], None]]:
    def rename(other: str) -> None: ...

    yield rename


def _tell(names: list[str], done: threading.Event, wait: float, again: float) -> None:
    """Say the name of the stage and the seconds it has taken until it is done."""
    started, on_terminal, said = time.monotonic(), sys.stderr.isatty(), False
    while not done.wait(again if said else wait):
        said = True
        text = f"voxkernel: {names[0]} ... {time.monotonic() - started:.0f} s"
        sys.stderr.write(_ERASE + text if on_terminal else text + "\n")
        sys.stderr.flush()
    if said and on_terminal:
        sys.stderr.write(_ERASE)
        sys.stderr.flush()
