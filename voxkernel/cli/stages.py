"""What a command is doing, on stderr, once that takes longer than two seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager

__all__ = ["Stage", "stages"]

Stage = Callable[[str], AbstractContextManager[None]]

_FIRST = 2.0  # seconds until a stage is named on a terminal
_PLAIN = 10.0  # and between lines elsewhere
_ERASE = "\r\x1b[K"


def stages(*, quiet: bool, first: float = _FIRST, plain: float = _PLAIN) -> Stage:
    """Give `stage`: ``with stage("reading mesh.ply"): ...`` names what goes on if that lasts.

    On a terminal one line is written over every second and gone at the end; elsewhere a line comes every ten seconds.
    """
    if quiet:
        return _silent
    wait, again = (first, min(1.0, first)) if sys.stderr.isatty() else (plain, plain)

    @contextmanager
    def stage(name: str) -> Generator[None]:
        done = threading.Event()
        thread = threading.Thread(target=_tell, args=(name, done, wait, again), daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    return stage


@contextmanager
def _silent(name: str) -> Generator[None]:
    yield


def _tell(name: str, done: threading.Event, wait: float, again: float) -> None:
    """Name the stage and the seconds it has taken until it is done."""
    started, on_terminal, said = time.monotonic(), sys.stderr.isatty(), False
    while not done.wait(again if said else wait):
        said = True
        text = f"voxkernel: {name} ... {time.monotonic() - started:.0f} s"
        sys.stderr.write(_ERASE + text if on_terminal else text + "\n")
        sys.stderr.flush()
    if said and on_terminal:
        sys.stderr.write(_ERASE)
        sys.stderr.flush()
