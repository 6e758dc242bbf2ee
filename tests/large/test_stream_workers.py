"""Threads and Dask workers give the answer of one process, to the last bit, also when a worker is killed."""

import os
import signal
import threading
import time
from functools import partial
from operator import add

import numpy as np
import pytest
import shapes
from streams import assert_same, write_ball

import voxkernel
from voxkernel.errors import MeshError
from voxkernel.large.chunks import Chunk
from voxkernel.large.file_chunks import PlyFile
from voxkernel.large.passes import HERE, Part, Place, workers_of
from voxkernel.large.streamed_surface import StreamedSurface
from voxkernel.large.surface_reader import SurfaceReader

MESHES = {
    "star": shapes.star_prism(),
    "spiky": shapes.spiky(3),
    "open": shapes.open_box(),
    "point": shapes.notched_cube(),
    "empty": shapes.torus(),
    "convex": shapes.icosphere(2),
}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_threads_give_the_same(mesh):
    surface = voxkernel.stream_mesh(mesh, chunk_facets=7)
    assert_same(voxkernel.exact_kernel(surface, threads=3), voxkernel.exact_kernel(surface))


def numbers(n):
    return (Part(Place(i, i, i), Chunk(np.full((1, 3, 3), float(i)), None)) for i in range(n))


def listed(place, chunk):
    return [(place.number, chunk.corners[0, 0, 0])]


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("n", [0, 1, 2, 7, 64, 201])
def test_results_are_merged_in_their_order(threads, n):
    with workers_of(threads) as workers:
        found = workers.folded(numbers(n), listed, add)
    assert found == ([(i, float(i)) for i in range(n)] or None)


def small(most, one, other):
    both = one + other
    return both if len(both) <= most else None


@pytest.mark.parametrize("threads", [1, 3])
def test_a_pass_ends_when_enough_is_seen(threads):
    parts = numbers(1000)
    with workers_of(threads) as workers:
        assert workers.folded(parts, listed, partial(small, 20)) is None
    assert next(parts).place.number < 50  # the others were not asked for


def test_the_first_error_is_raised():
    vertices, faces = MESHES["star"]
    wrong = faces.copy()
    wrong[[9, 23], 1] = 99
    with pytest.raises(MeshError, match="chunk 1, facet 9"):
        voxkernel.exact_kernel(voxkernel.stream_mesh([(vertices, wrong[:5]), (vertices, wrong[5:])]), threads=2)


def test_a_scheduler_wants_a_stream():
    with pytest.raises(ValueError, match="`scheduler` must be None unless the surface is one of `stream_mesh`; got 'x"):
        voxkernel.exact_kernel(shapes.cube(), scheduler="x")


def test_no_scheduler_there():
    pytest.importorskip("distributed")
    surface = voxkernel.stream_mesh(shapes.cube())
    with pytest.raises(ValueError, match="`scheduler` must be the address of a scheduler; got 'nonsense://x'"):
        voxkernel.exact_kernel(surface, scheduler="nonsense://x")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    distributed = pytest.importorskip("distributed")
    options = {"dashboard_address": None, "silence_logs": 60, "local_directory": str(tmp_path_factory.mktemp("dask"))}
    options["scheduler_kwargs"] = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **options) as made:
        yield made


class OnceSlow(PlyFile):
    """A file whose chunk 3 takes for ever, the first time it is read."""

    mark = ""

    def chunk(self, number, size):
        if number == 3:
            try:
                with open(self.mark, "x", encoding="utf-8") as file:
                    file.write(str(os.getpid()))
            except FileExistsError:
                pass
            else:
                time.sleep(300)
        return super().chunk(number, size)


def killed_when_at_work(mark, killed):
    """Wait for a worker that says who it is, and kill it."""
    for _ in range(3000):
        if mark.exists() and (text := mark.read_text()):
            os.kill(int(text), signal.SIGKILL)
            killed.append(int(text))
            return
        time.sleep(0.02)


def kernel_though_a_worker_is_killed(cluster, path, mark, chunk_facets):
    """The kernel by two workers, one of which is killed while a chunk is in work."""
    source = OnceSlow(path)
    source.mark = str(mark)
    killed = []
    killer = threading.Thread(target=killed_when_at_work, args=(mark, killed))
    killer.start()
    surface = StreamedSurface(SurfaceReader(source, chunk_facets, None))
    kernel = voxkernel.exact_kernel(surface, scheduler=cluster.scheduler_address)
    killer.join()
    assert len(killed) == 1
    assert killed[0] != os.getpid()
    return kernel


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are killed by a signal of POSIX")
def test_workers_give_the_same_and_a_lost_one_is_made_up_for(cluster, tmp_path):
    mesh = voxkernel.as_mesh(MESHES["spiky"])
    mesh.write(tmp_path / "spiky.ply")
    kernel = kernel_though_a_worker_is_killed(cluster, tmp_path / "spiky.ply", tmp_path / "mark", 200)
    assert_same(kernel, voxkernel.exact_kernel(voxkernel.stream_mesh(tmp_path / "spiky.ply", chunk_facets=200)))
    assert_same(kernel, voxkernel.exact_kernel(mesh))


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are killed by a signal of POSIX")
def test_ten_million_facets_on_workers_of_which_one_is_killed(cluster, tmp_path):
    assert write_ball(tmp_path / "ball.ply", 2237, 2237, 0.2) > 10_000_000
    kernel = kernel_though_a_worker_is_killed(cluster, tmp_path / "ball.ply", tmp_path / "mark", 1 << 19)
    assert_same(kernel, voxkernel.exact_kernel(voxkernel.stream_mesh(tmp_path / "ball.ply")))


@pytest.mark.parametrize("name", ["open", "empty"])
def test_chunks_that_only_the_caller_has_are_sent(cluster, name):
    vertices, faces = MESHES[name]
    seen = []
    chunks = [(vertices, part) for part in np.array_split(faces, 3)]
    surface = voxkernel.stream_mesh(chunks, chunk_facets=99, progress=seen.append)
    kernel = voxkernel.exact_kernel(surface, scheduler=cluster.scheduler_address)
    assert_same(kernel, voxkernel.exact_kernel(voxkernel.stream_mesh(chunks)))
    assert max(state.done for state in seen) == len(faces)


def test_errors_of_workers_are_those_of_one_process(cluster):
    vertices, faces = MESHES["spiky"]
    hole = np.concatenate([vertices, [[0, np.nan, 0]]])
    faces = faces.copy()
    faces[731, 2] = len(vertices)
    surface = voxkernel.stream_mesh((hole, faces), chunk_facets=300)
    with pytest.raises(MeshError, match="arrays, chunk 2, facet 731: `vertices` must be finite; got NaN"):
        voxkernel.exact_kernel(surface, scheduler=cluster.scheduler_address)


def test_one_thread_is_this_one():
    with workers_of(1) as workers:
        assert workers is HERE
