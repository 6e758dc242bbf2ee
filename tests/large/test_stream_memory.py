"""Ten million facets within a limit on the address space, which the way through memory does not keep."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from streams import write_ball

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
if sys.argv[2] in ("depth", "rtol"):
    surface = voxkernel.stream_mesh(sys.argv[1], chunk_facets=1 << 14)
    grid = voxkernel.voxel_kernel(surface, **({"depth": 4} if sys.argv[2] == "depth" else {"rtol": 0.1}))
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    peak = int(status["VmHWM"].split()[0]) // 1024
    print(json.dumps({"bounds": grid.volume_bounds, "depth": grid.depth, "peak": peak}))
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


@pytest.mark.skipif(sys.platform != "linux", reason="limits and peaks are those of Linux")
@pytest.mark.parametrize("how", ["depth", "rtol"])
def test_exact_voxels_take_no_memory_for_planes_near_a_small_kernel(tmp_path, how):
    """Voxels are larger than the kernel, near which most planes pass: those that exclude no voxel are not kept."""
    path = tmp_path / "ball.ply"
    assert write_ball(path, 400, 400, 0.2) == 319_200
    done = run(path, how)
    assert done.returncode == 0, done.stderr[-500:]
    found = json.loads(done.stdout)
    kernel = json.loads(run(path, "stream").stdout)
    assert found["bounds"][0] < kernel["volume"] < found["bounds"][1]
    assert found["peak"] < kernel["peak"]  # a small chunk beside the largest there is: 50 MB and 79, before 125


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


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits and peaks are those of Linux")
def test_exact_voxels_of_ten_million_facets_within_a_gibibyte_of_addresses(tmp_path):
    path = tmp_path / "ball.ply"
    assert write_ball(path, 2237, 2237, 0.2) > 10_000_000
    for how in ("depth", "rtol"):
        done = run(path, how)
        assert done.returncode == 0, done.stderr[-500:]
        found = json.loads(done.stdout)
        print(found)
        assert found["peak"] < 250
