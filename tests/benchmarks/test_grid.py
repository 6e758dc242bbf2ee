"""`SparseGrid` and its files at 10M voxels and at a depth-10 kernel, beside OpenVDB and others.

pyopenvdb runs under the system's Python (`apt-get install python3-openvdb`), tinyvdb and xuvdb under the Python named
by VOXKERNEL_PEER_PYTHON, by default this one; each times itself and prints JSON.
"""

import dataclasses
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import voxkernel
from voxkernel.demo_shapes import urchin
from voxkernel.grid import SparseGrid
from voxkernel.vdb import read_vdb, write_vdb

PEER = Path(__file__).with_name("vdb_peer.py")
EDGE = 270  # of the dense box around the ball of 10.3M voxels
N_POINTS = 5_000_000
N_ROUNDS = 5


def ball(shift=0.0):
    x = np.arange(EDGE) - (EDGE - 1) / 2
    squared = (x[:, None, None] - shift) ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2
    return squared <= (EDGE / 2) ** 2, np.sqrt(squared, dtype=np.float32)


def kernels():
    """Two depth-10 kernels on the same voxels, 22M and 18M of them active."""
    first, second = (voxkernel.voxel_kernel(urchin(length=length), depth=10).inside for length in (0.75, 0.8))
    return first, dataclasses.replace(second, origin=first.origin, linear=first.linear)


@pytest.fixture(scope="module")
def cases():
    dense, distance = ball()
    values = np.where(dense, distance, np.float32(0))
    mask, other = SparseGrid.from_dense(dense), SparseGrid.from_dense(ball(shift=20.0)[0])
    one, two = kernels()
    return {
        "dense": dense,
        "values": values,
        "10M mask": (mask, other),
        "10M float": (SparseGrid.from_dense(values), other),
        "kernel": (one, two),
    }


def voxels_about(grid, n=N_POINTS):
    """Random voxels in the grid's box and 10 % around it."""
    low, high = grid.active_bbox
    margin = (high - low) // 10
    return np.random.default_rng(0).integers(low - margin, high + margin + 1, (n, 3))


@pytest.fixture(scope="module")
def folder(cases, tmp_path_factory):
    path = tmp_path_factory.mktemp("peers")
    np.save(path / "dense.npy", cases["dense"])
    np.save(path / "values.npy", cases["values"])
    for case in ("10M mask", "10M float", "kernel"):
        for grid, name in zip(cases[case], (case, f"{case} other"), strict=True):
            write_vdb(path / f"{name}.vdb", {"grid": grid})
        np.save(path / f"{case}.npy", voxels_about(cases[case][0], 200_000))
    return path


@pytest.fixture(scope="module")
def peers(folder):
    """{name: {case: seconds}} of the libraries that are there, {name: reason} of the others."""
    told, missing = {}, {}
    for name in ("pyopenvdb", "tinyvdb", "xuvdb"):
        own = os.environ.get("VOXKERNEL_PEER_PYTHON", sys.executable)
        python = shutil.which("python3", path="/usr/bin:/bin") if name == "pyopenvdb" else own
        if not python or subprocess.run([python, "-c", f"import {name}"], capture_output=True, check=False).returncode:
            missing[name] = f"{name} not found under {python}"
            continue
        words = [python, str(PEER), name, str(folder), str(N_ROUNDS)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            missing[name] = f"{name} failed: {done.stderr.strip().splitlines()[-1]}"
        else:
            told[name] = json.loads(done.stdout.splitlines()[-1])
    return told, missing


@pytest.fixture
def beside(side_by_side, peers):
    """Time ours, then put the times the others measured themselves into the same row."""
    from conftest import ROWS

    def run(case, calls):
        answer = side_by_side(case, calls, rounds=N_ROUNDS)
        told, missing = peers
        ROWS[-1]["seconds"].update({name: times[case] for name, times in told.items() if case in times})
        for reason in missing.values():
            print(f"{case}: {reason}")
        return answer

    return run


@pytest.mark.parametrize("kind", ["mask", "float"])
def test_build(beside, cases, kind):
    array = cases["dense" if kind == "mask" else "values"]
    grid = beside(f"10M {kind} build", {"voxkernel": lambda: SparseGrid.from_dense(array)})["voxkernel"][1]
    assert grid.active_voxel_count == np.count_nonzero(array)


def test_build_beside_open3d(side_by_side, cases):
    """From points, one a voxel: Open3D has no other way."""
    from voxkernel._open3d import open3d

    o3d = open3d()
    points = np.argwhere(cases["dense"])[::10] + 0.5
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    low, high = np.zeros(3), np.full(3, float(EDGE))
    rivals = {
        "voxkernel": lambda: SparseGrid.from_points(points),
        "Open3D VoxelGrid": lambda: o3d.geometry.VoxelGrid.create_from_point_cloud_within_bounds(cloud, 1.0, low, high),
    }
    answer = side_by_side(f"build from {len(points)} points", rivals, rounds=2)
    grid, theirs = answer["voxkernel"][1], answer["Open3D VoxelGrid"][1]
    assert len(theirs.get_voxels()) == grid.active_voxel_count
    queries = grid.index_to_world(voxels_about(grid, 1_000_000))
    as_open3d = o3d.utility.Vector3dVector(queries)
    grid.points_in_grid(queries)
    rivals = {
        "voxkernel": lambda: grid.points_in_grid(queries),
        "Open3D VoxelGrid": lambda: np.array(theirs.check_if_included(as_open3d)),
    }
    answer = side_by_side("1M points in it", rivals, rounds=3)
    np.testing.assert_array_equal(answer["voxkernel"][1], answer["Open3D VoxelGrid"][1])


@pytest.mark.parametrize("case", ["10M mask", "kernel"])
def test_query(beside, side_by_side, cases, case):
    grid = cases[case][0]
    voxels = voxels_about(grid)
    points = grid.index_to_world(voxels + np.random.default_rng(1).uniform(-0.5, 0.5, voxels.shape))
    some = voxels[:1_000_000]
    grid.is_active(voxels), grid.points_in_grid(points), grid.is_active(some)
    beside(f"{case} query of 1M", {"voxkernel": lambda: grid.is_active(some)})
    rivals = {"is_active": lambda: grid.is_active(voxels), "points_in_grid": lambda: grid.points_in_grid(points)}
    table = grid._table
    rivals["NumPy"] = lambda: table.is_active(voxels)
    answer = side_by_side(f"{case} query of 5M", rivals, rounds=3)
    print({name: f"{N_POINTS / seconds / 1e6:.0f}M/s" for name, (seconds, _) in answer.items()})
    np.testing.assert_array_equal(answer["is_active"][1], answer["NumPy"][1])


@pytest.mark.parametrize("case", ["10M mask", "kernel"])
def test_intersection(beside, cases, case):
    one, two = cases[case]
    answer = beside(f"{case} intersection", {"voxkernel": lambda: one.intersection(two)})
    assert answer["voxkernel"][1].active_voxel_count <= one.active_voxel_count


@pytest.mark.parametrize("case", ["10M mask", "10M float", "kernel"])
def test_files(beside, cases, folder, tmp_path, case):
    grid = cases[case][0]
    beside(f"{case} write", {"voxkernel": lambda: write_vdb(tmp_path / "a.vdb", {"grid": grid})})
    back = beside(f"{case} read", {"voxkernel": lambda: read_vdb(folder / f"{case}.vdb")})["voxkernel"][1]
    assert back["grid"] == grid
    print(f"{grid.active_voxel_count} voxels, {(folder / f'{case}.vdb').stat().st_size} bytes")
