"""The exact octree with the half-spaces that matter is that of all of them, voxel by voxel."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._core import exact_cells
from voxkernel.halfspaces import HalfSpaces, find_feasibility
from voxkernel.relaxed.root_cube import cube_planes, root_cube
from voxkernel.voxels.exact_octree import rows_for_voxels


def rows_and_cells(planes, corners, depth, axes=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    """Rows that are kept, and the octree with those and with all."""
    cube, levels = root_cube(corners, np.array(axes, float), depth=depth)
    numbers = cube_planes(planes, cube, levels)
    local = cube.edge / planes.scale
    sizes = 2.0**-levels * local, numbers[3].max() * local
    rows = rows_for_voxels(planes, find_feasibility(planes), numbers[2], *sizes)
    return rows, *(exact_cells(*(p[ids] for p in numbers), levels, False) for ids in (rows, np.arange(len(planes))))


def assert_equal(found, expected):
    for one, two in zip(found, expected, strict=True):
        assert np.array_equal(one, two)


@pytest.mark.parametrize(("depth", "most"), [(4, 1.0), (7, 0.98), (9, 0.9)])
@pytest.mark.parametrize("seed", [0, 1])
def test_arrays_are_identical(depth, most, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.uv_sphere(30, 60)
    vertices = vertices * (1 + 0.5 * np.cos(vertices @ rng.normal(size=(3, 6)) * 3).mean(axis=1))[:, None]
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh((vertices, faces))).merged()
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0] if seed else np.eye(3)
    rows, found, expected = rows_and_cells(planes, vertices, depth, axes)
    assert len(rows) <= most * len(planes)
    assert found[-1] > 0
    assert_equal(found, expected)


@pytest.mark.parametrize("depth", [5, 7])
def test_half_spaces_beyond_the_edge_of_a_wedge(rng, depth):
    """Of a wedge as sharp as 1 in 16 and planes that cut voxels off beyond its edge, all that do are kept."""
    wedge = [[1, 0, 16], [1, 0, -16], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
    turned = np.column_stack([np.ones(2000), 0.05 * rng.normal(size=(2000, 2))])
    beyond = 0.06 + 0.9 * rng.uniform(size=2000) ** 2
    planes = HalfSpaces.from_planes(np.concatenate([wedge, turned]), np.concatenate([[0, 0, 1, 1, 1], beyond]))
    corners = np.array([[-1, -1, -1], [1, 1, 1]], float)
    rows, found, expected = rows_and_cells(planes, corners, depth)
    assert 5 < len(rows) < len(planes)
    assert_equal(found, expected)
    cube, levels = root_cube(corners, np.eye(3), depth=depth)
    alone = exact_cells(*cube_planes(planes.select(np.arange(5)), cube, levels), levels, False)
    assert alone[-1] > expected[-1]  # they do make a difference


def test_kernels_without_volume_and_few_half_spaces_are_looked_at_with_all():
    for make in (shapes.two_boxes, shapes.cube):
        vertices, faces = make()
        planes = HalfSpaces.from_mesh(voxkernel.as_mesh((vertices, faces)))
        assert len(rows_and_cells(planes, vertices, 5)[0]) == len(planes)
