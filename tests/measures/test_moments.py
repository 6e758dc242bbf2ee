"""Moments of kernels: closed forms, polytope against grid, rigid motion, flat and empty kernels."""

import numpy as np
import pytest
import shapes
from hypothesis import given
from hypothesis import strategies as st

from voxkernel import exact_kernel, kernel_moments, voxel_kernel
from voxkernel.grid import SparseGrid
from voxkernel.measures.moments import _of_simplices, moments_of


def brute(points, weights, voxel):
    """Moments of cubes about their centres, one by one."""
    mean = weights @ points / weights.sum()
    offset = points - mean
    return mean, (offset * weights[:, None]).T @ offset / weights.sum() + np.eye(3) * voxel**2 / 12


def test_box_in_closed_form():
    # The kernel of a convex solid is the solid; a box of edges a has variances a^2 / 12.
    moments = kernel_moments(exact_kernel(shapes.box((1, 2, 3), (7, 5, 4))))
    assert (moments.dimension, moments.mass) == (3, pytest.approx(18))
    np.testing.assert_allclose(moments.centroid, [4, 3.5, 3.5], rtol=1e-14)
    np.testing.assert_allclose(moments.spread, np.array([6, 3, 1]) / np.sqrt(12), rtol=1e-12)
    np.testing.assert_allclose(np.abs(moments.axes), np.eye(3), atol=1e-12)
    assert np.linalg.det(moments.axes) == pytest.approx(1)
    np.testing.assert_allclose(moments.axis_gaps, [1 - 1 / 2, 1 - 1 / 3], rtol=1e-12)
    assert not moments.centroid.flags.writeable
    assert repr(moments).startswith("KernelMoments(dimension=3, mass=18, spread=(1.73205,")


@pytest.mark.parametrize("frame", ["world", "principal"])
def test_grid_moments_are_those_of_its_voxels(frame):
    grid = voxel_kernel(shapes.spiky(1), depth=7, frame=frame)
    inside, border = grid.to_points(), grid.to_points(which="boundary")
    assert grid.inside.tile_count
    assert len(inside)
    assert len(border)
    weights = np.concatenate([np.ones(len(inside)), np.full(len(border), 0.5)])
    mean, covariance = brute(np.concatenate([inside, border]), weights, grid.voxel_size)
    moments = kernel_moments(grid)
    np.testing.assert_allclose(moments.centroid, mean, atol=1e-12)
    np.testing.assert_allclose(moments.covariance, covariance, atol=1e-12)
    assert moments.mass == pytest.approx(weights.sum() * grid.voxel_size**3, rel=1e-12)


def test_far_from_the_origin_nothing_cancels():
    ijk = np.array([[2**20 + x, 2**20 + y, -(2**20) + z] for x in range(9) for y in range(3) for z in range(2)])
    moments = moments_of(((SparseGrid.from_ijk(ijk, voxel_size=0.5), 1.0),))
    np.testing.assert_allclose(moments.spread**2, np.array([9, 3, 2]) ** 2 * 0.25 / 12, rtol=1e-9)
    np.testing.assert_allclose(moments.centroid, (ijk.mean(axis=0) + 0.5) * 0.5, rtol=1e-15)


def test_grid_tends_to_the_polytope():
    mesh = shapes.l_prism()
    exact = kernel_moments(exact_kernel(mesh))
    errors = [np.abs(kernel_moments(voxel_kernel(mesh, depth=d)).covariance - exact.covariance).max() for d in (4, 7)]
    assert errors[1] < 0.02
    assert errors[1] <= errors[0]


def test_flat_segment_point_and_empty():
    square = kernel_moments(exact_kernel(shapes.s_tetromino(0.0)))
    kernel = exact_kernel(shapes.s_tetromino(0.0))
    assert square.dimension == kernel.dimension < 3
    assert square.spread[-1] == pytest.approx(0, abs=1e-12)
    empty = kernel_moments(exact_kernel(shapes.torus()))
    assert empty.is_empty
    assert empty.mass == 0
    assert np.isnan(empty.centroid).all()
    assert kernel_moments(voxel_kernel(shapes.torus(), depth=4)).is_empty


def test_flat_polygon_has_the_moments_of_its_area():
    # A rectangle 2 x 1 has variances 4/12 and 1/12, a segment of length 6 has 3.
    square = np.array([[[0, 0, 0], [2, 0, 0], [2, 1, 0]], [[0, 0, 0], [2, 1, 0], [0, 1, 0]]], dtype=float)
    moments = _of_simplices(square, 2)
    assert moments.mass == pytest.approx(2)
    np.testing.assert_allclose(moments.spread**2, [4 / 12, 1 / 12, 0], atol=1e-15)
    segment = _of_simplices(np.array([[[1, 0, 0], [1, 0, 6.0]]]), 1)
    np.testing.assert_allclose(segment.spread**2, [3, 0, 0], atol=1e-15)


@given(seed=st.integers(0, 10**6))
def test_moments_move_with_the_surface(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.spiky(1)
    turn, shift = shapes.random_rotation(rng), rng.normal(size=3)
    one = kernel_moments(exact_kernel((vertices, faces)))
    two = kernel_moments(exact_kernel((vertices @ turn.T + shift, faces)))
    np.testing.assert_allclose(two.centroid, turn @ one.centroid + shift, atol=1e-9)
    np.testing.assert_allclose(two.covariance, turn @ one.covariance @ turn.T, atol=1e-9)
    np.testing.assert_allclose(two.spread, one.spread, atol=1e-9)


def test_other_types_are_refused():
    with pytest.raises(TypeError, match=r"`kernel` must be a KernelPolytope or a KernelGrid; got int"):
        kernel_moments(3)
