"""Relaxed kernels: verdicts against brute force, several tolerances, threads, margins, flat input."""

from itertools import pairwise

import numpy as np
import oracle
import pytest
import shapes

import voxkernel
from voxkernel import best_center, violation, voxel_kernel, voxel_kernels
from voxkernel.halfspaces import HalfSpaces

CUBE_DOMAIN = (np.r_[np.eye(3), -np.eye(3)], [3.0] * 6)


def in_domain(domain, points, pad=1e-9):
    return (points @ domain.normals.T <= domain.offsets - pad * np.abs(domain.offsets).max()).all(axis=1)


def assert_verdicts(grid, surface, points):
    """No inside voxel has a point with v > alpha, no outside voxel one with v <= alpha (in the domain)."""
    values = violation(surface, points)
    inside = in_domain(grid.domain, points)
    beyond = ~in_domain(grid.domain, points, -1e-9)
    answer = grid.classify(points)
    # A point within rounding of a voxel face may be given the answer of either voxel.
    index = grid.world_to_index(points) + 0.5
    clear = (np.abs(index - np.rint(index)) > 1e-6).all(axis=1)
    assert (values[clear & (answer == 1)] <= grid.tolerance).all()
    assert not beyond[clear & (answer == 1)].any()
    assert (values[clear & (answer == -1) & inside] > grid.tolerance).all()


def points_in(domain, rng, n):
    low, high = domain.vertices.min(axis=0), domain.vertices.max(axis=0)
    return rng.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), (n, 3))


# ---------------------------------------------------------------- by hand


def test_one_side_of_a_cube():
    """Allowed one of six sides: the cube and a column out of every side, up to the domain."""
    grid = voxel_kernel(shapes.cube(), tolerance=0.2, depth=6, domain=CUBE_DOMAIN)
    low, high = grid.volume_bounds
    volume = 1 + 3 * 3 + 3 * 2  # sides at -3..0 (3 deep) and 1..3 (2 deep)
    assert low <= volume <= high
    assert high - low < 0.6 * volume
    assert grid.classify([(0.5, 0.5, 2.5), (0.5, 0.5, -2.5), (2, 2, 0.5), (0.5, 0.5, 0.5)]).tolist() == [1, 1, -1, 1]
    assert grid.tolerance == 0.2
    assert grid.dimension == 3
    assert grid.domain.kind == "planes"


def test_hull_is_the_default_of_closed_surfaces():
    grid = voxel_kernel(shapes.cube(), tolerance=0.9, depth=4)
    assert grid.domain.kind == "hull"
    assert grid.volume_bounds[0] <= 1 <= grid.volume_bounds[1]
    assert voxel_kernel(shapes.height_field(), tolerance=0.1, depth=3).domain.kind == "ball"


def test_whole_domain_at_tolerance_one():
    grid = voxel_kernel(shapes.two_boxes(), tolerance=1.0, depth=5, domain=CUBE_DOMAIN)
    low, high = grid.volume_bounds
    assert low <= 6**3 <= high
    assert low > 0.99 * 6**3 * (30 / 32) ** 3


def test_empty():
    grid = voxel_kernel(shapes.two_boxes(), tolerance=0.05, depth=7)
    assert grid.active_voxel_count == grid.boundary.active_voxel_count == 0
    assert grid.volume_bounds == (0, 0)
    assert grid.reason == "every point of the domain violates more than 0.05 of the surface"


def test_far_from_the_origin(rng):
    vertices, faces = shapes.spiky(1)
    surface = vertices + 1e6, faces
    grid = voxel_kernel(surface, tolerance=0.1, depth=5)
    assert_verdicts(grid, surface, points_in(grid.domain, rng, 3000))


# ---------------------------------------------------------------- brute force


@pytest.mark.parametrize("frame", ["world", "principal"])
@pytest.mark.parametrize("name", ["torus", "two_boxes", "l_prism", "height_field", "notched_cube", "open_hemisphere"])
def test_verdicts(name, frame, rng):
    surface = shapes.KNOWN[name][0]()
    for grid in voxel_kernels(surface, tolerances=[0.06, 0.17, 0.3], depth=5, frame=frame):
        assert_verdicts(grid, surface, points_in(grid.domain, rng, 3000))


def test_every_voxel_centre(rng):
    """All voxels of a grid, not a sample, against the plain sweep."""
    surface = shapes.spiky(1)
    grid = voxel_kernel(surface, tolerance=0.08, depth=5)
    ijk = np.stack(np.meshgrid(*[np.arange(32)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = grid.index_to_world(ijk)
    values = oracle.violation(*surface, centres)
    inside, boundary = grid.inside.is_active(ijk), grid.boundary.is_active(ijk)
    assert not (inside & boundary).any()
    assert values[inside].max() <= 0.08
    assert not (~inside & ~boundary & in_domain(grid.domain, centres) & (values <= 0.08)).any()


def test_planes_parallel_to_columns_and_through_voxel_corners(rng):
    """Integer solids in a dyadic cube: every plane runs along voxel faces."""
    surface = shapes.plus_cross()
    domain = (np.r_[np.eye(3), -np.eye(3)], [4.0, 4, 4, 4, 4, 4])
    for grid in voxel_kernels(surface, tolerances=[0.0, 0.1, 0.2, 0.4], depth=5, domain=domain):
        assert_verdicts(grid, surface, points_in(grid.domain, rng, 3000))


# ---------------------------------------------------------------- several tolerances, threads, depth


def assert_same_grid(one, two):
    for name in ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_inside", "leaf_boundary", "origin"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    assert one.volume_bounds == two.volume_bounds
    assert one.voxel_size == two.voxel_size


def test_one_traversal_gives_what_single_ones_give():
    surface = shapes.torus()
    shares = [0.3, 0.2, 0.25, 0.2]
    together = voxel_kernels(surface, tolerances=shares, depth=6)
    assert [g.tolerance for g in together] == shares
    for share, grid in zip(shares, together, strict=True):
        assert_same_grid(grid, voxel_kernel(surface, tolerance=share, depth=6))


@pytest.mark.parametrize("depth", [3, 5, 7])
def test_threads_do_not_change_anything(depth):
    surface = shapes.spiky(2)
    one = voxel_kernels(surface, tolerances=[0.02, 0.1], depth=depth)
    two = voxel_kernels(surface, tolerances=[0.02, 0.1], depth=depth, threads=3)
    for a, b in zip(one, two, strict=True):
        assert_same_grid(a, b)


def test_bounds_tighten_with_depth():
    surface = shapes.torus()
    bounds = [voxel_kernel(surface, tolerance=0.25, depth=d).volume_bounds for d in range(3, 9)]
    for (lower, higher), (low, high) in pairwise(bounds):
        assert low >= lower * (1 - 1e-12)
        assert high <= higher * (1 + 1e-12)


def test_relative_accuracy():
    grid = voxel_kernel(shapes.torus(), tolerance=0.3, rtol=0.2)
    low, high = grid.volume_bounds
    assert high - low <= 0.2 * high
    assert grid.depth > 3


def test_margin():
    surface = shapes.torus()
    least = best_center(surface).violation_bounds[1]
    grid = voxel_kernel(surface, margin=0.05, depth=6)
    assert grid.tolerance == pytest.approx(least + 0.05)
    assert grid.active_voxel_count > 0
    # At margin 0 the star centre itself stays in: bounds allow for the rounding of the weights.
    found = best_center(surface)
    tight = voxel_kernel(surface, margin=0, depth=8)
    assert tight.classify(found.point[None])[0] >= 0
    # A star-shaped surface has v* = 0.
    assert voxel_kernel(shapes.l_prism(), margin=0.0, depth=4).classify([(0.5, 0.5, 0.5)])[0] == 1


# ---------------------------------------------------------------- defined answers for odd input


def test_a_single_facet():
    one = ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    none, all_of_it = voxel_kernels(one, tolerances=[0.5, 1.0], depth=5)
    assert none.domain.kind == "ball"
    assert none.volume_bounds[0] <= 0.5 * none.domain.volume <= none.volume_bounds[1]
    assert all_of_it.volume_bounds[0] <= none.domain.volume <= all_of_it.volume_bounds[1]


def test_all_on_one_plane_from_both_sides():
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    grid = voxel_kernels((vertices, [(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)]), tolerances=[0.4, 0.6], depth=4)
    assert grid[0].domain.kind == "ball"
    assert grid[0].active_voxel_count == 0
    assert grid[0].classify([(0.5, 0.5, 0)])[0] == 0  # the plane itself, at any depth
    assert grid[1].active_voxel_count > 0


def test_zero_weights():
    """Half-spaces of weight 0 do not count in relaxed kernels."""
    planes = HalfSpaces.from_planes([[1, 0, 0], [0, 1, 0]], [0, 0], weights=[1, 0])
    grid = voxel_kernel(planes, tolerance=0.5, depth=4, domain=CUBE_DOMAIN)
    assert grid.classify([(-1, 1, 0), (-1, -1, 0), (1, 0, 0)]).tolist() == [1, 1, -1]


def test_grid_operations_work_between_tolerances():
    small, large = voxel_kernels(shapes.torus(), tolerances=[0.3, 0.35], depth=6)
    assert small.inside.difference(large.inside).active_voxel_count == 0
    assert small.inside.intersection(large.inside).active_voxel_count == small.active_voxel_count
    assert len(large.to_mesh().faces) > 0
    assert repr(large).startswith("KernelGrid(tolerance=0.35, depth=6")


def test_real_face(data_dir, rng):
    mesh = voxkernel.as_mesh(data_dir / "faces" / "ict01_neutral.ply")
    grid = voxel_kernel(mesh, tolerance=0.03, depth=7)
    assert grid.active_voxel_count > 0
    assert_verdicts(grid, mesh, points_in(grid.domain, rng, 20_000))
