"""The relaxed kernel of a stream: the voxels of memory, whatever the chunks, and certain bounds where depth is cut."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.voxels import streamed_relaxed

MESHES = {
    "star": (shapes.star_prism(), "box"),
    "open": (shapes.open_box(), None),
    "torus": (shapes.torus(n_major=16, n_minor=8), "box"),
    "cubes": (shapes.two_boxes(), "box"),
}


def assert_same(streamed, whole):
    assert streamed.to_dict() == whole.to_dict()
    for one, other in ((streamed.inside, whole.inside), (streamed.boundary, whole.boundary)):
        np.testing.assert_array_equal(sorted_rows(one.to_ijk()), sorted_rows(other.to_ijk()))


def sorted_rows(ijk):
    return ijk[np.lexsort(ijk.T)]


@pytest.mark.parametrize("chunk", [1, 7, 1000])
@pytest.mark.parametrize("name", MESHES)
def test_the_voxels_are_those_of_memory(name, chunk):
    mesh, domain = MESHES[name]
    surface = voxkernel.stream_mesh(mesh, chunk_facets=chunk)
    for options in ({"depth": 6, "tolerance": 0.2}, {"voxel_size": 0.13, "tolerance": 0.05}):
        whole = voxkernel.voxel_kernel(mesh, domain=domain, **options)
        assert_same(voxkernel.voxel_kernel(surface, domain=domain, **options), whole)


@pytest.mark.parametrize(
    "options",
    [
        {"depth": 3, "tolerance": 0.3},
        {"depth": 7, "tolerance": 0.3},
        {"rtol": 0.1, "tolerance": 0.3},
        {"depth": 5, "margin": 0.05},
        {"depth": 6, "tolerance": 0.3, "threads": 3},
        {"depth": 4, "tolerance": 1.0},
        {"depth": 6, "tolerance": 1e-4},
    ],
)
def test_options_mean_the_same(options):
    mesh = shapes.spiky(3)
    surface = voxkernel.stream_mesh(mesh, chunk_facets=500)
    assert_same(voxkernel.voxel_kernel(surface, **options), voxkernel.voxel_kernel(mesh, **options))


@pytest.mark.parametrize("bytes_of_sums", [1, 100_000])
def test_little_memory_takes_more_passes(monkeypatch, bytes_of_sums):
    mesh, passes = shapes.spiky(2), []
    whole = voxkernel.voxel_kernel(mesh, tolerance=0.1, depth=6)
    monkeypatch.setattr(streamed_relaxed, "_BYTES", bytes_of_sums)
    monkeypatch.setattr(streamed_relaxed, "_MOST_PASSES", 10**9)
    surface = voxkernel.stream_mesh(mesh, progress=lambda state: passes.append(state.stage))
    assert_same(voxkernel.voxel_kernel(surface, tolerance=0.1, depth=6), whole)
    assert passes.count("voxels") > 10


def test_where_memory_ends_bounds_are_certain_and_the_reason_says_so(monkeypatch):
    mesh = shapes.spiky(2)
    monkeypatch.setattr(streamed_relaxed, "_BYTES", 100 * streamed_relaxed._BRICK_BYTES)
    surface = voxkernel.stream_mesh(mesh, chunk_facets=77)
    grid = voxkernel.voxel_kernel(surface, tolerance=0.1, depth=12)
    assert 6 <= grid.depth < 12
    text = f"depth 12 takes too much memory or too many passes: voxels are those of depth {grid.depth}"
    assert grid.reason == text
    fine = voxkernel.voxel_kernel(mesh, tolerance=0.1, depth=9)
    assert grid.volume_bounds[0] < fine.volume_bounds[0] < fine.volume_bounds[1] < grid.volume_bounds[1]
    same = voxkernel.voxel_kernel(mesh, tolerance=0.1, depth=grid.depth)
    assert grid.volume_bounds == same.volume_bounds
    rough = voxkernel.voxel_kernel(surface, tolerance=0.1, rtol=1e-3)
    assert rough.reason.startswith("the bounds still differ by")
    assert rough.reason.endswith(f"at depth {rough.depth}, the largest that memory allows")


def test_what_no_point_keeps_is_empty():
    surface = voxkernel.stream_mesh(shapes.torus(), chunk_facets=100)
    grid = voxkernel.voxel_kernel(surface, tolerance=0.01)
    assert grid.is_empty
    assert grid.reason == "every point of the domain violates more than 0.01 of the surface"


def test_a_closed_surface_in_one_plane_has_the_ball():
    vertices, faces = shapes.tetrahedron()
    flat = vertices * [1, 1, 0], faces
    streamed, whole = (voxkernel.voxel_kernel(s, tolerance=0.5, depth=4) for s in (voxkernel.stream_mesh(flat), flat))
    assert streamed.to_dict() == whole.to_dict()
