"""The compiled queries beside their NumPy twins: the same answer for every voxel and every point."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from grids import random_frame, random_grid

from voxkernel import grid as grid_module
from voxkernel._grid_query import MIN_COMPILED, ActiveTable, cells_of_points, points_in, voxels_in
from voxkernel._morton import REACH
from voxkernel.grid import SparseGrid

SEEDS = range(8)
EXTREMES = [-(2**63), 2**63 - 1, -REACH - 1, -REACH, REACH - 1, REACH, -(2**24), 2**26, 2**31, 0]


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
@pytest.mark.parametrize("seed", SEEDS)
def test_table_loop_is_its_twin(seed, dtype):
    grid = compact_grid(seed)
    table = table_of(grid)
    with np.errstate(all="ignore"):  # the extremes wrap around, with and without compilation
        voxels = probes(grid, seed).astype(dtype)
        compiled = voxels_in(voxels, table, grid._cells(), grid.leaf_mask)
        np.testing.assert_array_equal(compiled, table.is_active(voxels))
    np.testing.assert_array_equal(compiled, grid._is_active(voxels))
    assert compiled.any()
    assert not compiled.all()


@pytest.mark.parametrize("seed", SEEDS)
def test_search_loop_is_its_twin(seed):
    grid = random_grid(seed, n_cells=30)
    low, _ = grid.active_bbox
    inside = np.concatenate([grid.tile_ijk, grid.leaf_ijk, low[None]])
    voxels = np.concatenate([inside, inside - 1, inside + 3, np.random.default_rng(seed).choice(EXTREMES, (200, 3))])
    compiled = voxels_in(voxels, None, grid._cells(), grid.leaf_mask)
    np.testing.assert_array_equal(compiled, grid._is_active(voxels))
    assert compiled.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_point_loop_rounds_like_its_twin(seed):
    """Points on voxel faces too, where one rounding more would move them to the neighbour."""
    grid = compact_grid(seed)
    table, to_cells = table_of(grid), np.linalg.inv(grid.linear)
    rng = np.random.default_rng(seed)
    at = probes(grid, seed)[:2500] + rng.choice([-0.5, 0.0, 0.5, 0.3], (2500, 3))
    near = grid.index_to_world(at)
    far = rng.choice([1e300, -1e300, 1e12, 0.0], (100, 3))
    with np.errstate(all="ignore"):
        points = np.concatenate([near, far])
        compiled = points_in(points, grid.origin, to_cells, table)
        expected = table.is_active(cells_of_points(points, grid.origin, to_cells))
    np.testing.assert_array_equal(compiled, expected)
    assert compiled.any()


def test_empty_grid_and_odd_arrays():
    grid = SparseGrid.from_ijk(np.zeros((0, 3), int))
    assert not voxels_in(np.zeros((3, 3), np.int64), None, grid._cells(), grid.leaf_mask).any()
    full = compact_grid(0)
    voxels = probes(full, 0)[:3000]
    expected = full._is_active(voxels)
    for odd in (np.asfortranarray(voxels), voxels[::-1][::-1], voxels.astype(">i8"), voxels.astype(np.int16)):
        np.testing.assert_array_equal(voxels_in(odd, table_of(full), full._cells(), full.leaf_mask), expected)


@pytest.mark.parametrize("is_compact", [True, False])
def test_grid_hands_long_lists_to_the_loops(monkeypatch, is_compact):
    grid = compact_grid(1) if is_compact else random_grid(1, n_cells=30)
    rng = np.random.default_rng(1)
    low, high = grid.active_bbox
    voxels = rng.integers(low, high + 1, (2000, 3))
    points = grid.index_to_world(voxels + rng.uniform(-0.5, 0.5, (2000, 3)))
    expected = grid.is_active(voxels), grid.points_in_grid(points)
    used = []
    monkeypatch.setattr(grid_module, "MIN_COMPILED", 1000)
    for name in ("voxels_in", "points_in"):
        call = getattr(grid_module, name)
        monkeypatch.setattr(grid_module, name, lambda *a, call=call, name=name: used.append(name) or call(*a))
    if is_compact:
        grid_module._set(grid, "_table", table_of(grid))
    np.testing.assert_array_equal(grid.is_active(voxels), expected[0])
    np.testing.assert_array_equal(grid.points_in_grid(points), expected[1])
    assert used == (["voxels_in", "points_in"] if is_compact else ["voxels_in", "voxels_in"])


def test_short_lists_load_no_numba():
    code = (
        "import sys, numpy as np; from voxkernel.grid import SparseGrid\n"
        "g = SparseGrid.from_ijk(np.indices((9, 9, 9)).reshape(3, -1).T)\n"
        f"v = np.zeros(({MIN_COMPILED - 1}, 3), int)\n"
        "assert g.is_active(v).all() and g.points_in_grid(v + 0.5).all()\n"
        "print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
