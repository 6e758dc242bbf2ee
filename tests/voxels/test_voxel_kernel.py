"""`voxel_kernel` of exact kernels: known solids, options, errors."""

from itertools import pairwise

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import exact_kernel, voxel_kernel
from voxkernel.halfspaces import HalfSpaces

BOUNDED = [name for name, (_, known) in shapes.KNOWN.items() if known.bounded]


@pytest.mark.parametrize("name", BOUNDED)
def test_bounds_bracket_the_known_volume(name):
    make, known = shapes.KNOWN[name]
    grid = voxel_kernel(make(), depth=5)
    low, high = grid.volume_bounds
    assert low <= known.volume <= high
    assert grid.dimension == known.dimension
    assert (grid.reason == "the kernel is empty") == (known.dimension < 0)
    assert low <= grid.volume <= high
    if known.dimension >= 0:
        assert grid.classify(exact_kernel(make()).deepest_point[None])[0] >= 0


@pytest.mark.parametrize("name", ["l_prism", "star_prism", "crossing_boxes"])
def test_voxels_tell_the_truth(name, rng):
    surface = shapes.KNOWN[name][0]()
    grid = voxel_kernel(surface, depth=5)
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh(surface))
    low, high = surface[0].min(axis=0), surface[0].max(axis=0)
    points = rng.uniform(low, high, (4000, 3))
    excess = (points @ planes.normals.T - planes.offsets).max(axis=1)
    answer = grid.classify(points)
    assert (excess[answer == 1] <= 1e-12).all()
    assert (excess[answer == -1] >= -1e-12).all()
    assert (np.abs(excess[answer == 0]) <= 1.8 * grid.voxel_size).all()


def test_bounds_tighten_with_depth():
    surface = shapes.star_prism()
    bounds = [voxel_kernel(surface, depth=d).volume_bounds for d in range(3, 9)]
    for (lower, higher), (low, high) in pairwise(bounds):
        assert low >= lower
        assert high <= higher
    assert bounds[-1][1] - bounds[-1][0] < 0.1 * shapes.STAR_PRISM.volume


def test_steps():
    surface = shapes.l_prism()
    by_size = voxel_kernel(surface, voxel_size=0.1)
    assert by_size.voxel_size == pytest.approx(0.1)
    close = voxel_kernel(surface, rtol=0.1)
    low, high = close.volume_bounds
    assert high - low <= 0.1 * high
    assert low <= 1 <= high
    assert voxel_kernel(surface, rtol=1e-9).reason.startswith("the bounds still differ by")
    assert voxel_kernel(shapes.saw_prism(), rtol=0.1).reason == "a kernel without volume has no relative accuracy"
    assert voxel_kernel(surface).depth == 7


def test_principal_frame_and_exports():
    surface = shapes.star_prism()
    grid = voxel_kernel(surface, depth=5, frame="principal")
    assert grid.axes @ grid.axes.T == pytest.approx(np.eye(3))
    assert len(grid.to_points()) == grid.active_voxel_count
    assert len(grid.to_points(which="boundary")) == grid.boundary.active_voxel_count
    assert grid.to_mesh().facts().volume == pytest.approx(grid.volume_bounds[0], rel=1e-9)
    assert grid.world_to_index(grid.index_to_world([[1, 2, 3]])) == pytest.approx(np.array([[1, 2, 3]]), abs=1e-9)
    assert grid.nbytes > 0
    assert repr(grid).startswith("KernelGrid(depth=5")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"depth": 5, "rtol": 0.1}, "`depth`, `voxel_size` and `rtol` must not be given together"),
        ({"depth": 2}, r"`depth` must be in 3\.\.20; got 2"),
        ({"voxel_size": 1e-9}, "`voxel_size` must be at least"),
        ({"rtol": 0.0}, "`rtol` must be > 0; got 0"),
        ({"frame": "own"}, "`frame` must be one of 'world', 'principal'; got 'own'"),
        ({"tolerance": -0.1}, "`tolerance` must be >= 0"),
        ({"tolerance": 1.5}, "`tolerance` must be at most 1, the whole surface; got 1.5"),
        ({"tolerance": 0.1, "margin": 0.1}, "`margin` must not be given together with `tolerance`; got both"),
        ({"margin": -0.1}, "`margin` must be >= 0"),
        ({"threads": 0}, r"`threads` must be in 1\.\.256; got 0"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(ValueError, match=message):
        voxel_kernel(shapes.cube(), **options)


def test_half_spaces():
    planes = HalfSpaces.from_planes(np.r_[np.eye(3), -np.eye(3)], [1, 1, 1, 0, 0, 0])
    grid = voxel_kernel(planes, depth=4)
    assert grid.volume_bounds[0] <= 1 <= grid.volume_bounds[1]
    with pytest.raises(ValueError, match="`frame` must be 'world' for half-spaces"):
        voxel_kernel(planes, frame="principal")
    with pytest.raises(ValueError, match="`domain` must be given for half-spaces; got None"):
        voxel_kernel(planes, tolerance=0.2)
