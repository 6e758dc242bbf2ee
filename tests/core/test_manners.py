"""The compiled core as a guest of Python: memory that is not there, other threads, forks, silence."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._core import StopFlag, boundary_is_zero, exact_cells
from voxkernel._threads import run_parts


def test_memory_that_is_not_there():
    nothing = np.empty((0, 3), np.int64)
    for n_vertices in (1 << 46, 1 << 57):
        with pytest.raises(MemoryError):
            boundary_is_zero(nothing, n_vertices)


def planes(n, rng):
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return normals, 0.4 + 0.5 * normals.sum(axis=1), np.abs(normals).sum(axis=1) + 1e-13, np.full(n, 1e-14)


def test_other_threads_run_meanwhile(rng):
    """A loop of some 0.2 s and more leaves the interpreter to others."""
    ticks = []
    done = threading.Event()

    def count():
        while not done.wait(1e-3):
            ticks.append(None)

    watcher = threading.Thread(target=count)
    watcher.start()
    given = planes(5000, rng)
    before = len(ticks)
    exact_cells(*given, 9, True)
    during = len(ticks) - before
    done.set()
    watcher.join()
    assert during >= 5  # it had the lock again and again, not once at each end


def test_a_flag_stops_loops_of_workers(rng):
    stop = StopFlag()
    stop.set()
    with pytest.raises(KeyboardInterrupt):
        voxkernel._core.violated_weights(
            np.ascontiguousarray(rng.normal(size=(3, 200_000))), rng.normal(size=(200_000, 3)),
            *planes(3000, rng)[:2], np.full(3000, 1e-14), np.ones(3000, np.int64), np.full((3000, 3), -1),
            np.empty((0, 3)), False, np.arange(200_000), np.zeros(200_000, np.int64), stop,
        )  # fmt: skip


def test_first_error_stops_the_other_parts():
    def work(part, stop):
        if part == 0:
            raise ZeroDivisionError
        while True:  # until the flag is seen by a loop of the core
            exact_cells(*planes(200, np.random.default_rng(0)), 5, True)
            if stopped(stop):
                return part

    def stopped(stop):
        return stop is not None and done.wait(0)

    done = threading.Event()
    threading.Timer(0.3, done.set).start()
    with pytest.raises(ZeroDivisionError):
        run_parts(work, [0, 1, 2], 3)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_threads_before_and_after_a_fork():
    code = (
        "import os, numpy as np, voxkernel as vk, shapes\n"
        "points = np.random.default_rng(0).normal(size=(40000, 3))\n"
        "mesh = vk.as_mesh(shapes.spiky(3))\n"
        "before = vk.violation(mesh, points, threads=2)\n"
        "child = os.fork()\n"
        "after = vk.violation(mesh, points, threads=2)\n"
        "assert (before == after).all()\n"
        "if not child: os._exit(0)\n"
        "raise SystemExit(os.waitpid(child, 0)[1])\n"
    )
    path = os.pathsep.join([str(Path(voxkernel.__file__).parents[1]), str(Path(shapes.__file__).parent)])
    env = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_interrupt_of_a_bare_loop(rng):
    arrays = planes(5000, rng)

    def without_end():
        while True:
            exact_cells(*arrays, 9, True)

    threading.Timer(0.1, signal.raise_signal, (signal.SIGINT,)).start()
    with pytest.raises(KeyboardInterrupt):
        without_end()
