"""Laws of relaxed kernels on random integer meshes."""

from itertools import pairwise

import numpy as np
import pytest
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel import best_center, defect_profile, exact_kernel, violation, voxel_kernel, voxel_kernels

few = settings(max_examples=12)
seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@settings(max_examples=25)
@given(shapes.integer_meshes(), seeds, st.floats(0.0, 0.6))
def test_no_voxel_is_wrong(surface, rng, share):
    """Half-integer points: on facet planes as often as not."""
    grid = voxel_kernels(surface, tolerances=[share], depth=4, frame="principal")[0]
    low, high = surface[0].min(axis=0), surface[0].max(axis=0)
    points = np.concatenate([rng.uniform(low, high, (300, 3)), rng.integers(2 * low, 2 * high + 1, (100, 3)) / 2])
    values = violation(surface, points)
    inside = (points @ grid.domain.normals.T <= grid.domain.offsets - 1e-9 * (1 + np.abs(high - low).max())).all(axis=1)
    answer = grid.classify(points)
    index = grid.world_to_index(points) + 0.5
    clear = (np.abs(index - np.rint(index)) > 1e-6).all(axis=1)
    assert (values[clear & (answer == 1)] <= share + 1e-15).all()
    assert (values[clear & (answer == -1) & inside] > share - 1e-15).all()


@few
@given(shapes.integer_meshes())
def test_grows_with_the_tolerance(surface):
    shares = [0.0, 0.05, 0.2, 0.21, 0.5, 1.0]
    grids = voxel_kernels(surface, tolerances=shares, depth=4)
    for small, large in pairwise(grids):
        assert small.inside.difference(large.inside).active_voxel_count == 0
        assert small.volume_bounds[1] <= large.volume_bounds[1]


@few
@given(shapes.integer_meshes())
def test_tolerance_zero_is_the_exact_kernel(surface):
    relaxed = voxel_kernels(surface, tolerances=[0.0], depth=5)[0]
    kernel = exact_kernel(surface)
    low, high = relaxed.volume_bounds
    assert low <= kernel.volume * (1 + 1e-9)
    assert high >= kernel.volume * (1 - 1e-9)
    if kernel.dimension == 3:
        inner = kernel.centroid + 0.999 * (kernel.vertices - kernel.centroid)
        assert (relaxed.classify(inner) >= 0).all()
    single = voxel_kernel(surface, depth=5)
    assert single.tolerance == 0
    assert low <= single.volume_bounds[1]
    assert single.volume_bounds[0] <= high


@few
@given(shapes.integer_meshes(), seeds, st.floats(1e-3, 1e3))
def test_moves_with_the_surface(surface, rng, scale):
    vertices, faces = surface
    turn, step = shapes.random_rotation(rng), rng.normal(size=3)
    there = (vertices @ turn.T + step) * scale, faces
    here, moved = (defect_profile(s, tolerances=[0.1, 0.3, 0.6], depth=4) for s in (surface, there))
    low, high = here.volume_share_bounds.T
    moved_low, moved_high = moved.volume_share_bounds.T
    assert (low <= moved_high + 1e-9).all()
    assert (moved_low <= high + 1e-9).all()


@pytest.mark.parametrize("seed", range(3))
def test_profile_is_a_signature(seed):
    """A shape with a unique principal frame: the very same voxels after a motion, up to rounding."""
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.spiky(2)
    vertices = vertices * (3, 2, 1) + 0.2 * vertices[:, [1, 2, 0]] ** 2
    there = (vertices @ shapes.random_rotation(rng).T + rng.normal(size=3)) * 10 ** rng.uniform(-3, 3)
    here = defect_profile((vertices, faces), depth=5)
    moved = defect_profile((there, faces), depth=5)
    assert moved.volume_share_bounds == pytest.approx(here.volume_share_bounds, abs=2e-3)
    assert moved.volume_share == pytest.approx(here.volume_share, abs=2e-3)
    assert (np.diff(here.volume_share_bounds, axis=0) >= 0).all()
    other = defect_profile((vertices * (1, 1, 2), faces), depth=5)
    assert np.abs(other.volume_share - here.volume_share).max() > 0.02


@pytest.mark.parametrize("seed", range(3))
def test_center_moves_with_the_surface(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.spiky(2)
    vertices = vertices * (3, 2, 1) + 0.2 * vertices[:, [1, 2, 0]] ** 2
    turn, step, scale = shapes.random_rotation(rng), rng.normal(size=3), 10 ** rng.uniform(-3, 3)
    here, there = best_center((vertices, faces)), best_center(((vertices @ turn.T + step) * scale, faces))
    assert there.violation_bounds == pytest.approx(here.violation_bounds, abs=1e-12)
    assert there.point == pytest.approx((here.point @ turn.T + step) * scale, rel=1e-6, abs=1e-6 * scale)


@few
@given(shapes.integer_meshes(), seeds)
def test_order_of_vertices_and_faces_does_not_matter(surface, rng):
    one, two = best_center(surface), best_center(shapes.shuffled(*surface, rng))
    assert two.violation_bounds[0] <= one.violation_bounds[1] + 1e-12
    assert one.violation_bounds[0] <= two.violation_bounds[1] + 1e-12
