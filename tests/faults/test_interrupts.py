"""Ctrl-C: every long computation ends with KeyboardInterrupt in the middle of its loop, commands with exit code 130."""

import _thread
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import _core
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.surface_arguments import surface_argument
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.root_cube import cube_arrays, cube_planes, root_cube

HANG = 120  # seconds; only to end a test that does not end by itself
KILLS = {
    "kill": lambda: os.kill(os.getpid(), signal.SIGINT),
    "raise_signal": lambda: signal.raise_signal(signal.SIGINT),
    "interrupt_main": _thread.interrupt_main,
}


@pytest.fixture(scope="module")
def rough():
    """A sphere of 82k facets with noise, on which every computation here takes minutes."""
    rng = np.random.default_rng(0)
    vertices, faces = shapes.icosphere(6)
    mesh = voxkernel.as_mesh((vertices * (1.0 + 0.02 * rng.normal(size=(len(vertices), 1))), faces))
    # What is imported and prepared once is not what is interrupted here.
    voxkernel.voxel_kernel(mesh, depth=4, tolerance=0.2, domain="ball", threads=2)
    voxkernel.defect_profile(mesh, depth=3, domain="ball")
    voxkernel.violation_grid(mesh, depth=3, tolerance=0.2, domain="ball")
    voxkernel.violation(mesh, [[0.0, 0.0, 0.0]])
    return mesh


@pytest.fixture(scope="module")
def planes(rough):
    return weigh(HalfSpaces.from_mesh(rough))


def assert_interrupted(work, how="kill", after=1.0):
    """Send an interrupt from another thread while `work` runs; it must not come to its end."""
    ended = []
    timer = threading.Timer(after, KILLS[how])
    try:
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012
            timer.start()
            ended.append(work())
            timer.join()
            time.sleep(HANG)  # the interrupt is on its way
    finally:
        timer.cancel()
    assert not ended


CALLS = {
    "voxel_kernel": lambda mesh: voxkernel.voxel_kernel(mesh, depth=14, tolerance=0.2, domain="ball"),
    "voxel_kernel, two threads": lambda mesh: voxkernel.voxel_kernel(
        mesh, depth=14, tolerance=0.2, domain="ball", threads=2
    ),
    "defect_profile": lambda mesh: voxkernel.defect_profile(mesh, depth=12, domain="ball"),
    "defect_profile, two threads": lambda mesh: voxkernel.defect_profile(mesh, depth=12, domain="ball", threads=2),
    "violation_grid": lambda mesh: voxkernel.violation_grid(mesh, depth=9, tolerance=0.6, domain="ball"),
    "violation": lambda mesh: voxkernel.violation(mesh, 0.9 * np.random.default_rng(0).normal(size=(1_000_000, 3))),
    "violation, two threads": lambda mesh: voxkernel.violation(
        mesh, 0.9 * np.random.default_rng(0).normal(size=(1_000_000, 3)), threads=2
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_calls(rough, name):
    assert_interrupted(lambda: CALLS[name](rough))


def test_best_center():
    """Spheres apart from each other: no point is much better than others, so that nothing is left out early."""
    rng = np.random.default_rng(0)
    vertices, faces = shapes.icosphere(5)
    rough = [vertices * (1.0 + 0.05 * rng.normal(size=(len(vertices), 1))) for _ in range(20)]
    balls = [ball + 4.0 * rng.normal(size=3) for ball in rough]
    mesh = voxkernel.as_mesh((np.concatenate(balls), np.concatenate([faces + i * len(vertices) for i in range(20)])))
    planes = HalfSpaces.from_mesh(mesh)
    voxkernel.best_center(planes, gap=0.9, domain=_ball(planes))
    assert_interrupted(lambda: voxkernel.best_center(planes, gap=1e-15, domain=_ball(planes)))


@pytest.mark.parametrize("how", KILLS)
def test_ways_to_interrupt(rough, how):
    assert_interrupted(lambda: CALLS["voxel_kernel"](rough), how)


def _exact(planes, cube):
    arrays = cube_planes(HalfSpaces.from_planes(*_round_planes()), cube, 20)
    return lambda: _core.exact_cells(*arrays, 20, True)


def _round_planes():
    """Tangent planes of a ball of radius 0.9: at depth 20 its surface has 1e12 voxels."""
    normals = shapes.icosphere(4)[0]
    return normals, np.full(len(normals), 0.9)


def _relaxed(planes, cube):
    normals, offsets, reach, pads, weights, n = cube_arrays(planes, _ball(planes), cube, 16)
    ins, outs = planes.thresholds([0.1, 0.2])
    numbers = np.column_stack([normals, reach + pads * 2.0**17, 0.5 * normals.sum(axis=1) - offsets])
    start = np.array([0, 2]), 16, -1, np.zeros(3, np.int64)
    return lambda: _core.relaxed_cells(numbers, weights, n, 0, ins, outs, *start, 99, True)


def _ball(planes):
    return surface_argument(shapes.icosphere(2)).bounded_domain("ball")


def _least(planes, cube):
    """Planes that pass near the middle in all directions: no cell is much better than another."""
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(20_000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = normals @ np.full(3, 0.5) + 0.2 * rng.normal(size=len(normals))
    pads, weights = np.full(len(normals), 1e-14), np.full(len(normals), UNITS // len(normals))
    center, cell = np.empty(3), np.empty(4)
    in_the_cube = np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0])
    no_border = np.empty((0, 3)), np.empty(0), np.empty(0)
    search = 0, 0.0, 42, 10**12, 2  # gap, ratio, levels, cells, threads
    return lambda: _core.least_violated(
        normals, offsets, pads, weights, in_the_cube, *no_border, 1e-15, UNITS, *search, center, cell
    )


def _field(planes, cube):
    normals, offsets, reach, pads, weights, n = cube_arrays(planes, _ball(planes), cube, 9)
    return lambda: _core.violation_cells(normals, offsets, reach + pads * 2.0**10, weights, n, UNITS, float(UNITS), 9)


@pytest.mark.parametrize("prepare", [_exact, _relaxed, _least, _field])
def test_loops(planes, prepare):
    """Nothing but the loop runs when the interrupt comes."""
    cube, _ = root_cube(np.array([[-1.1, -1.1, -1.1], [1.1, 1.1, 1.1]]), np.eye(3))
    assert_interrupted(prepare(planes, cube))


def test_a_flag_stops_a_loop_of_another_thread(planes):
    """Workers do not hear signals: whoever waits for them sets the flag."""
    cube, _ = root_cube(np.array([[-1.1, -1.1, -1.1], [1.1, 1.1, 1.1]]), np.eye(3))
    normals, offsets, reach, pads, weights, n = cube_arrays(planes, _ball(planes), cube, 16)
    ins, outs = planes.thresholds([0.1])
    numbers = np.column_stack([normals, reach + pads * 2.0**17, 0.5 * normals.sum(axis=1) - offsets])
    flag, caught = _core.StopFlag(), []

    def work():
        start = np.array([0, 1]), 16, -1, np.zeros(3, np.int64)
        try:
            _core.relaxed_cells(numbers, weights, n, 0, ins, outs, *start, 99, True, flag)
        except KeyboardInterrupt:
            caught.append(True)

    worker = threading.Thread(target=work)
    worker.start()
    time.sleep(0.2)
    flag.set()
    worker.join(HANG)
    assert caught


@pytest.fixture(scope="module")
def rough_file(rough, tmp_path_factory):
    path = tmp_path_factory.mktemp("meshes") / "rough.off"
    vertices, faces = rough.to_arrays()
    rows = [f"OFF\n{len(vertices)} {len(faces)} 0\n"]
    rows += [f"{x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist()]
    rows += [f"3 {a} {b} {c}\n" for a, b, c in faces.tolist()]
    path.write_text("".join(rows))
    return path


# `python -m voxkernel.cli.main`, which also says when the command itself has begun.
COMMAND = """
import sys
from importlib import import_module
kernel, main = import_module("voxkernel.cli.kernel"), import_module("voxkernel.cli.main")
run = kernel.run
def begun(args):
    print("begun", file=sys.stderr, flush=True)
    return run(args)
kernel.run = begun
sys.exit(main.main(sys.argv[1:]))
"""


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT for one child process there")
@pytest.mark.parametrize("after", [0.3, 1.5, 4.0])
@pytest.mark.parametrize("threads", [(), ("--threads", "2")], ids=["one thread", "two threads"])
def test_command(tmp_path, rough_file, threads, after):
    options = ["--depth", "10", "--tolerance", "0.2", "--domain", "hull", *threads, "-o", str(tmp_path / "x.npz")]
    command = [sys.executable, "-c", COMMAND, "kernel", str(rough_file), *options]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    guard = threading.Timer(HANG, child.kill)
    guard.start()
    try:
        for line in child.stderr:
            if line == "begun\n":
                break
        time.sleep(after)
        child.send_signal(signal.SIGINT)
        _, err = child.communicate()
    finally:
        guard.cancel()
        child.kill()
        child.wait()
    assert child.returncode == 130, err[-2000:]
    assert "voxkernel: error: interrupted" in err
    assert not list(tmp_path.iterdir())


# As the installed script runs it; the signal comes as the named module is about to be imported.
IMPORTING = """
import os, signal, sys
from voxkernel.cli.main import main
class Interrupt:
    def find_spec(self, name, *rest):
        if name == module:
            os.kill(os.getpid(), number)
module, number = sys.argv[1], int(sys.argv[2])
sys.meta_path.insert(0, Interrupt())
sys.argv = ["voxkernel", "score", sys.argv[3]]
sys.exit(main())
"""


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT for one child process there")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "module", ["voxkernel.cli.commands", "argparse", "voxkernel.measures", "numpy", "numpy._core.multiarray"]
)
def test_while_a_command_is_imported(tmp_path, module, number):
    vertices, faces = shapes.icosphere(1)
    voxkernel.as_mesh((vertices, faces)).write(tmp_path / "ball.ply")
    words = [sys.executable, "-c", IMPORTING, module, str(int(number)), str(tmp_path / "ball.ply")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=HANG)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "voxkernel: error: interrupted\n")
