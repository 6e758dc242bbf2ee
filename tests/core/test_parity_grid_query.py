"""The grid queries of the compiled core against their Numba twins."""

import numpy as np
import pytest
from grids import random_grid

from voxkernel import _core
from voxkernel._grid_query import ActiveTable
from voxkernel._loops import grid_query
from voxkernel._morton import REACH
from voxkernel.grid import SparseGrid

EXTREMES = np.array([-(2**63), 2**63 - 1, -REACH - 1, -REACH, REACH - 1, REACH, -(2**31), 2**31 - 1, 0])


@pytest.mark.parametrize("seed", range(12))
def test_queries(seed):
    grid = random_grid(seed, n_cells=30) if seed % 4 else SparseGrid.from_ijk(np.zeros((0, 3), int))
    rng = np.random.default_rng(seed)
    voxels = np.concatenate([rng.integers(-50, 50, (5000, 3)), rng.choice(EXTREMES, (500, 3))])
    cells = grid._cells()
    for dtype in (np.int64, np.int32):
        v = voxels.astype(dtype)
        results = np.empty((2, len(v)), bool)
        _core.voxels_in_runs(v, REACH, *cells, grid.leaf_mask, results[0])
        grid_query.voxels_in_runs(v, REACH, *cells, grid.leaf_mask, results[1])
        assert (results[0] == results[1]).all()
        if not len(cells.code):
            continue
        table = ActiveTable.build(*cells, grid.leaf_mask)
        _core.voxels_in_table(v, *table, results[0])
        grid_query.voxels_in_table(v, *table, results[1])
        assert (results[0] == results[1]).all()
        assert results[0].any()
        points = rng.normal(scale=30, size=(5000, 3))
        points[:200] = rng.choice([1e300, -1e300, 1e12, np.inf, -np.inf, np.nan, 0.0], (200, 3))
        points[200:1000] = np.round(points[200:1000])
        to_cells = np.linalg.inv(np.eye(3) + 0.1 * rng.normal(size=(3, 3))) if seed % 2 else np.eye(3)
        results = np.empty((2, len(points)), bool)
        _core.points_in_table(points, np.full(3, 0.25), to_cells, *table, results[0])
        grid_query.points_in_table(points, np.full(3, 0.25), to_cells, *table, results[1])
        assert (results[0] == results[1]).all()
        assert results[0].any()
