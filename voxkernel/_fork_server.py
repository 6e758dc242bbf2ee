"""Where worker processes come from: on Linux, forks of one process that has imported what they need."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from functools import cache

from voxkernel._scratch_folder import scratch_folder

__all__ = ["ENVIRONMENT", "FEW", "OWN_WORKER", "interrupt_blocked", "start_method"]

FEW = 200  # files, of which pictures are drawn unasked
OWN_WORKER = "VOXKERNEL_WORKER"  # in the environment of worker processes that `evaluate` has started
# One thread of each library in each process, and a mark.
ENVIRONMENT: dict[str, str] = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", OWN_WORKER), "1"
)
_OF_WORKERS = ("distributed.nanny", "voxkernel.evaluation.worker")
_OF_ANALYSIS = ("scipy.spatial", "scipy.sparse.csgraph")
_OF_PICTURES = ("pyvista", "pyvista.plotting", "PIL.Image", "voxkernel.evaluation.row_pictures")


def start_method(*, for_analysis: bool, for_pictures: bool = False) -> str:
    """Say how worker processes start, "forkserver" or "spawn"; the server is started, and not waited for.

    It imports, `for_analysis` also what rows of meshes need, while this process imports what a client needs, so that
    worker processes, and those that take the place of killed ones, are there at once. It has one thread, which makes
    forks of it safe, and ends with the last of this process and its workers. A later evaluation, or a later call of
    the same one, finds it running.
    """
    if sys.platform != "linux":
        return "spawn"
    import multiprocessing
    from multiprocessing import forkserver, process

    place = process.current_process()._config  # type: ignore[attr-defined]  # only there is the folder of its socket named
    before = {name: os.environ.get(name) for name in ENVIRONMENT}, place.get("tempdir")
    multiprocessing.get_context("forkserver").set_forkserver_preload(
        [*_OF_WORKERS, *(_OF_ANALYSIS if for_analysis else ()), *(_OF_PICTURES if for_pictures else ())]
    )
    try:
        os.environ.update(ENVIRONMENT)  # NumPy takes its number of threads when it is loaded
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
