"""The grid queries of the compiled core beside twins in NumPy: the same answer for every voxel and every point."""

import dataclasses

import numpy as np
import pytest
from grids import random_frame, random_grid

from voxkernel import _core
from voxkernel.grid import SparseGrid, query
from voxkernel.grid.lookup import ActiveTable, find_rows, points_in, voxels_in
from voxkernel.grid.morton import REACH

SEEDS = range(8)
EXTREMES = [-(2**63), 2**63 - 1, -REACH - 1, -REACH, REACH - 1, REACH, -(2**24), 2**26, 2**31, 0]


def active_by_search(grid, voxels):
    """Runs found by NumPy's binary search, bits read one by one."""
    code, last, row = grid._cells()
    place, found = find_rows(code, last, voxels)
    active = found.copy()
    for i in np.flatnonzero(found):
        leaf = row[place[i]]
        if leaf >= 0:
            x, y, z = (int(v) & 7 for v in voxels[i])
            active[i] = int(grid.leaf_mask[leaf, x]) >> (8 * y + z) & 1
    return active


def cells_of_points(points, origin, to_cells):
    """Voxels of world points with each sum from left to right; what is out of reach becomes one just beyond it."""
    away = points - origin
    cells = [away[:, 0] * row[0] + away[:, 1] * row[1] + away[:, 2] * row[2] for row in to_cells]
    return np.fmin(np.fmax(np.floor(np.stack(cells, axis=1)), -REACH - 1), REACH).astype(np.int64)


def compact_grid(seed):
    """A grid whose box a table can hold."""
    rng = np.random.default_rng(seed)
    ijk = rng.integers(-40, 60, (3000, 3))
    ball = SparseGrid.from_dense(np.ones((40, 24, 33), bool), lower=rng.integers(-60, 60, 3))
    grid = SparseGrid.from_ijk(ijk).union(ball)
    return dataclasses.replace(grid, **random_frame(seed))


def table_of(grid):
    index = grid._cells()
    return ActiveTable.build(*index, grid.leaf_mask)


def probes(grid, seed, n=3000):
    rng = np.random.default_rng(seed)
    low, high = grid.active_bbox
    near = rng.integers(low - 20, high + 21, (n, 3))
    return np.concatenate([near, rng.choice(EXTREMES, (200, 3)), grid.to_ijk(max_voxels=10**9)[:500]])


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
@pytest.mark.parametrize("is_compact", [True, False])
@pytest.mark.parametrize("seed", SEEDS)
def test_voxels(seed, is_compact, dtype):
    grid = compact_grid(seed) if is_compact else random_grid(seed, n_cells=30)
    with np.errstate(invalid="ignore"):  # the extremes wrap around
        voxels = probes(grid, seed).astype(dtype)
    expected = active_by_search(grid, voxels)
    assert expected.any()
    assert not expected.all()
    for table in (table_of(grid), None):
        np.testing.assert_array_equal(voxels_in(voxels, table, grid._cells(), grid.leaf_mask), expected)


@pytest.mark.parametrize("seed", SEEDS)
def test_corners_of_tiles_and_leaves(seed):
    grid = random_grid(seed, n_cells=30)
    low, _ = grid.active_bbox
    corners = np.concatenate([grid.tile_ijk, grid.leaf_ijk, low[None]])
    voxels = np.concatenate([corners, corners - 1, corners + 3, corners + 7, corners + 8])
    expected = active_by_search(grid, voxels)
    np.testing.assert_array_equal(voxels_in(voxels, None, grid._cells(), grid.leaf_mask), expected)
    np.testing.assert_array_equal(grid.is_active(voxels), expected)


@pytest.mark.parametrize("seed", SEEDS)
def test_points_round_like_their_twin(seed):
    """Points on voxel faces too, where one rounding more would move them to the neighbour."""
    grid = compact_grid(seed)
    to_cells = np.linalg.inv(grid.linear)
    rng = np.random.default_rng(seed)
    at = probes(grid, seed)[:2500] + rng.choice([-0.5, 0.0, 0.5, 0.3], (2500, 3))
    far = rng.choice([1e300, -1e300, 1e12, 0.0, 2.0**31, -(2.0**31)], (100, 3))
    points = np.concatenate([grid.index_to_world(at), far])
    with np.errstate(over="ignore", invalid="ignore"):
        expected = active_by_search(grid, cells_of_points(points, grid.origin, to_cells))
    assert expected.any()
    for table in (table_of(grid), None):
        found = points_in(points, grid.origin, to_cells, table, grid._cells(), grid.leaf_mask)
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(grid.points_in_grid(points), expected)


def test_points_at_infinity_are_in_no_voxel():
    grid = compact_grid(0)
    points = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [0, -np.inf, 0], [np.nan] * 3])
    for table in (table_of(grid), None):
        assert not points_in(points, np.zeros(3), np.eye(3), table, grid._cells(), grid.leaf_mask).any()


def test_empty_grid_and_odd_arrays():
    grid = SparseGrid.from_ijk(np.zeros((0, 3), int))
    assert not voxels_in(np.zeros((3, 3), np.int64), None, grid._cells(), grid.leaf_mask).any()
    assert not grid.points_in_grid(np.zeros((2, 3))).any()
    full = compact_grid(0)
    voxels = probes(full, 0)[:3000]
    expected = active_by_search(full, voxels)
    for odd in (np.asfortranarray(voxels), voxels[::-1][::-1], voxels.astype(">i8"), voxels.astype(np.int16)):
        np.testing.assert_array_equal(voxels_in(odd, table_of(full), full._cells(), full.leaf_mask), expected)


def test_a_long_list_about_a_compact_grid_makes_a_table(monkeypatch):
    grid = compact_grid(1)
    rng = np.random.default_rng(1)
    low, high = grid.active_bbox
    voxels = rng.integers(low, high + 1, (3000, 3))
    points = grid.index_to_world(voxels + rng.uniform(-0.5, 0.5, (3000, 3)))
    expected = grid.is_active(voxels), grid.points_in_grid(points)
    assert grid._table is None
    monkeypatch.setattr(query, "_MIN_TABLE_QUERIES", 1000)
    np.testing.assert_array_equal(grid.is_active(voxels), expected[0])
    assert grid._table is not None
    np.testing.assert_array_equal(grid.points_in_grid(points), expected[1])


def test_bindings_take_nothing_by_halves():
    grid = compact_grid(0)
    table, cells = table_of(grid), grid._cells()
    voxels, active = np.zeros((4, 3), np.int64), np.zeros(4, bool)
    for odd in (voxels.astype(float), voxels.astype(np.int16), voxels[:, :2], np.asfortranarray(voxels), [[0, 0, 0]]):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            _core.voxels_in_table(odd, *table, active)
        with pytest.raises(TypeError, match="incompatible function arguments"):
            _core.voxels_in_runs(odd, REACH, *cells, grid.leaf_mask, active)
    active.flags.writeable = False
    with pytest.raises(TypeError, match="incompatible function arguments"):
        _core.voxels_in_table(voxels, *table, active)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        _core.points_in_table(voxels.astype(float), np.zeros(3), np.eye(3), *table, active)
