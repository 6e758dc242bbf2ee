"""Ten million facets within a limit on the address space, which the way through memory does not keep."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import voxkernel

LIMIT = 1 << 30

# In a process of its own: the limit holds from before the first import, and the peak is that of the kernel alone.
KERNEL = """
import json, resource, sys, time
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]),) * 2)
import voxkernel
begin = time.process_time()
surface = voxkernel.stream_mesh(sys.argv[1]) if sys.argv[2] != "memory" else sys.argv[1]
if sys.argv[2] == "relaxed":
    grid = voxkernel.voxel_kernel(surface, tolerance=0.01, depth=7, domain="box")
    seconds = time.process_time() - begin
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    peak = int(status["VmHWM"].split()[0]) // 1024
    print(json.dumps({"bounds": grid.volume_bounds, "depth": grid.depth, "cpu": seconds, "peak": peak}))
    raise SystemExit
kernel = voxkernel.exact_kernel(surface)
seconds = time.process_time() - begin
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps({
    "dimension": kernel.dimension, "volume": kernel.volume, "facets": kernel.face_facets.tolist(), "cpu": seconds,
    "witness": kernel.certificate.facet_ids, "planes": len(kernel.certificate.halfspaces),
    "peak": int(status["VmHWM"].split()[0]) // 1024, "address_space": int(status["VmPeak"].split()[0]) // 1024,
}))
"""


def write_ball(path, n_rings, n_sectors, bump, *, bend=0.0, chunk=64):
    """A ball of radius 1 + bump cos 8a cos 8b, with a spike at each pole, bent by `bend` z^2.

    About 2 n_rings n_sectors facets, made a few rings at a time.
    """
    inner = n_rings - 1
    n_vertices, n_faces = 2 + inner * n_sectors, 2 * n_sectors * inner
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {n_vertices}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    b = 2 * np.pi * np.arange(n_sectors) / n_sectors
    around = np.arange(n_sectors), (np.arange(n_sectors) + 1) % n_sectors
    row = np.dtype([("n", "u1"), ("v", "<i4", (3,))])
    with open(path, "wb") as file:
        file.write(head.encode())
        tip = 1 + bump  # beyond the ball, so that the kernel is small
        np.array([[bend * tip**2, 0, tip], [bend * tip**2, 0, -tip]], np.float64).tofile(file)
        for first in range(1, n_rings, chunk):
            a = np.pi * np.arange(first, min(n_rings, first + chunk))[:, None] / n_rings
            r = 1 + bump * np.sin(a) * np.cos(8 * a) * np.cos(8 * b)
            x, y, z = r * np.sin(a) * np.cos(b), r * np.sin(a) * np.sin(b), r * np.cos(a)
            np.stack([x + bend * z**2, y, z], -1).tofile(file)
        for ring in range(n_rings):
            upper, lower = (2 + (ring + k - 1) * n_sectors + np.array(around) for k in range(2))
            if ring == 0:
                faces = np.stack([0 * lower[0], *lower], 1)
            elif ring == inner:
                faces = np.stack([0 * upper[0] + 1, upper[1], upper[0]], 1)
            else:
                faces = np.concatenate([
                    np.stack([upper[0], lower[0], lower[1]], 1), np.stack([upper[0], lower[1], upper[1]], 1)
                ])  # fmt: skip
            rows = np.empty(len(faces), row)
            rows["n"], rows["v"] = 3, faces
            rows.tofile(file)
    return n_faces


def run(path, how, limit=LIMIT):
    path_of_package = str(Path(voxkernel.__file__).parents[1])
    env = {**os.environ, "PYTHONPATH": path_of_package, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", KERNEL, str(path), how, str(limit)]
    return subprocess.run(command, capture_output=True, text=True, env=env, timeout=600, check=False)


def test_the_ball_is_closed_and_has_a_kernel(tmp_path):
    n = write_ball(tmp_path / "ball.ply", 40, 48, 0.2, chunk=7)
    found = [json.loads(run(tmp_path / "ball.ply", how, 1 << 34).stdout) for how in ("stream", "memory")]
    assert n == 2 * 48 * 39
    assert found[0]["dimension"] == 3
    assert found[0]["facets"] == found[1]["facets"]
    assert found[0]["volume"] == found[1]["volume"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits and peaks are those of Linux")
def test_ten_million_facets_within_a_gibibyte_of_addresses(tmp_path):
    path = tmp_path / "ball.ply"
    n = write_ball(path, 2237, 2237, 0.2)
    assert n > 10_000_000
    done = run(path, "stream")
    assert done.returncode == 0, done.stderr[-500:]
    streamed, failed = json.loads(done.stdout), run(path, "memory")
    assert failed.returncode != 0
    assert "MemoryError" in failed.stderr
    whole = json.loads(run(path, "memory", 1 << 34).stdout)
    print({k: v for k, v in streamed.items() if k != "facets"}, {k: v for k, v in whole.items() if k != "facets"})
    assert streamed["facets"] == whole["facets"]
    assert streamed["volume"] == whole["volume"]
    assert streamed["peak"] < 500


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits and peaks are those of Linux")
def test_relaxed_voxels_of_ten_million_facets_within_a_gibibyte_of_addresses(tmp_path):
    path = tmp_path / "ball.ply"
    assert write_ball(path, 2237, 2237, 0.2) > 10_000_000
    done = run(path, "relaxed")
    assert done.returncode == 0, done.stderr[-500:]
    found = json.loads(done.stdout)
    print(found)
    assert found["depth"] == 7
    assert found["peak"] < 500
    low, high = found["bounds"]
    # A surface of the same formula with a hundredth of the facets has about the same kernel.
    write_ball(path, 224, 224, 0.2)
    few = voxkernel.voxel_kernel(path, tolerance=0.01, depth=7, domain="box").volume_bounds
    assert max(low, few[0]) < min(high, few[1])
