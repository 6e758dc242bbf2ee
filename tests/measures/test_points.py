"""Kernels as points: inside, weights add up, same points every time, flat and empty kernels."""

import numpy as np
import pytest
import shapes

from voxkernel import exact_kernel, kernel_points, voxel_kernel
from voxkernel.mesh.surface_samples import spread_samples


@pytest.mark.parametrize("seed", range(8))
def test_axes_of_inertia_may_be_a_reflection(seed):
    """Half of all rotations give such axes; the cubes inside are found all the same."""
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.box((0, 0, 0), (1, 2, 3))
    points = kernel_points(exact_kernel((shapes.moved(vertices, shapes.random_rotation(rng)), faces)), n_points=500)
    assert 0.2 * 500 < len(points.interior) < 1.5 * 500


@pytest.mark.parametrize("make", [shapes.l_prism, shapes.tetrahedron, shapes.star_prism, shapes.spiky])
def test_points_of_a_solid(make):
    kernel = exact_kernel(make())
    points = kernel_points(kernel, n_points=3000)
    solid = kernel.to_mesh()
    corners = kernel.vertices[solid.plane_corners]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    depth = points.interior @ normals.T - np.einsum("ij,ij->i", normals, corners[:, 0])
    assert depth.max() <= 1e-12
    on = points.boundary @ normals.T - np.einsum("ij,ij->i", normals, corners[:, 0])
    np.testing.assert_allclose(on.max(axis=1), 0, atol=1e-12)
    assert points.interior_weights.sum() == pytest.approx(kernel.volume)
    assert points.boundary_weights.sum() == pytest.approx(kernel.area)
    assert 0.2 * 3000 < len(points.interior) < 1.5 * 3000
    mean = points.interior_weights @ points.interior / kernel.volume
    assert np.linalg.norm(mean - kernel.centroid) < (kernel.volume / len(points.interior)) ** (1 / 3)


def test_points_of_a_grid_and_joined_voxels():
    grid = voxel_kernel(shapes.l_prism(), depth=6)
    every = kernel_points(grid, n_points=10**6)
    np.testing.assert_allclose(np.sort(every.interior, axis=0), np.sort(grid.to_points(), axis=0), atol=1e-12)
    few = kernel_points(grid, n_points=100)
    assert 0 < len(few.interior) <= 100
    assert 0 < len(few.boundary) <= 100
    low, high = grid.volume_bounds
    for points in (every, few):
        assert points.interior_weights.sum() == pytest.approx(low, rel=1e-9)
        assert points.boundary_weights.sum() == pytest.approx((high - low) / 2, rel=1e-9)
    np.testing.assert_allclose(
        few.interior_weights @ few.interior, every.interior_weights @ every.interior, atol=1e-12
    )


def test_flat_and_empty_kernels():
    flat = kernel_points(exact_kernel(shapes.s_tetromino(0.0)))
    assert not len(flat.interior)
    assert len(flat.boundary)
    for kernel in (exact_kernel(shapes.torus()), voxel_kernel(shapes.torus(), depth=4)):
        points = kernel_points(kernel)
        assert len(points.interior) == len(points.boundary) == 0
        assert len(points.to_open3d().points) == 0


def test_same_points_every_time_and_read_only():
    kernel = exact_kernel(shapes.spiky())
    one, two = kernel_points(kernel), kernel_points(kernel)
    assert one.interior.tobytes() == two.interior.tobytes()
    assert one.boundary.tobytes() == two.boundary.tobytes()
    assert not one.interior.flags.writeable
    cloud = one.to_open3d("boundary")
    np.testing.assert_array_equal(np.asarray(cloud.points), one.boundary)
    assert repr(one) == f"KernelPoints(interior={len(one.interior)}, boundary={len(one.boundary)})"


def test_bad_arguments():
    kernel = exact_kernel(shapes.cube())
    with pytest.raises(TypeError, match="`kernel` must be a KernelPolytope or a KernelGrid; got str"):
        kernel_points("x.ply")
    with pytest.raises(ValueError, match="`n_points` must be"):
        kernel_points(kernel, n_points=3)
    with pytest.raises(ValueError, match="`which` must be 'interior', 'boundary' or 'all'; got 'both'"):
        kernel_points(kernel).to_open3d("both")


@pytest.mark.parametrize("count", [10, 500, 5000])
def test_samples_lie_on_their_triangles_and_move_with_them(count, rng):
    vertices, faces = shapes.spiky(2)
    points, owners, areas = spread_samples(vertices, faces, count)
    corners = vertices[faces[owners]]
    edges = corners[:, 1:] - corners[:, :1]
    rows = zip(edges, points, corners[:, 0], strict=True)
    solved = np.stack([np.linalg.lstsq(e.T, p - c, rcond=None)[0] for e, p, c in rows])
    np.testing.assert_allclose(corners[:, 0] + np.einsum("ik,ikj->ij", solved, edges), points, atol=1e-12)
    assert solved.min() >= -1e-12
    assert solved.sum(axis=1).max() <= 1 + 1e-12
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    assert areas.sum() == pytest.approx(0.5 * np.linalg.norm(normals, axis=1).sum())
    turn = shapes.random_rotation(rng)
    moved, again, _ = spread_samples(vertices @ turn.T + 5, faces, count)
    np.testing.assert_array_equal(owners, again)
    np.testing.assert_allclose(moved, points @ turn.T + 5, atol=1e-12)
