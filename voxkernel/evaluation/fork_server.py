"""Where worker processes come from: on Linux, forks of one process that has imported what they need."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from functools import cache

from voxkernel.evaluation.scratch_folder import scratch_folder

__all__ = ["interrupt_blocked", "start_method"]

_OF_WORKERS = ["voxkernel.evaluation.worker", "distributed.nanny"]
_OF_ANALYSIS = ["scipy.spatial", "scipy.sparse.csgraph"]


def start_method(environment: Mapping[str, str], *, for_analysis: bool) -> str:
    """Say how worker processes start, "forkserver" or "spawn"; the server is started, and not waited for.

    It imports, `for_analysis` also what rows of meshes need, while this process imports what a client needs, so that
    worker processes, and those that take the place of killed ones, are there at once. It has one thread, which makes
    forks of it safe, and ends with the last of this process and its workers. A later evaluation finds it running.
    """
    if sys.platform != "linux":
        return "spawn"
    import multiprocessing
    from multiprocessing import forkserver, process

    place = process.current_process()._config  # type: ignore[attr-defined]  # only there is the folder of its socket named
    before = {name: os.environ.get(name) for name in environment}, place.get("tempdir")
    multiprocessing.get_context("forkserver").set_forkserver_preload(
        [*_OF_WORKERS, *(_OF_ANALYSIS if for_analysis else [])]
    )
    try:
        os.environ.update(environment)  # NumPy takes its number of threads when it is loaded
        place["tempdir"] = _socket_folder()
        with interrupt_blocked():
            forkserver.ensure_running()
    finally:
        for name, value in before[0].items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})
        place["tempdir"] = before[1]
    return "forkserver"


@cache
def _socket_folder() -> str:
    """A folder for the socket of the server, one for this process: removed at its end, or later if it is killed."""
    stack = ExitStack()
    folder = stack.enter_context(scratch_folder())
    atexit.register(stack.close)
    return folder


@contextmanager
def interrupt_blocked() -> Generator[None]:
    """Keep Ctrl-C from threads made inside, and so from the processes they start: this one ends them in order."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # else the first process starts it, which lets the signal through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
