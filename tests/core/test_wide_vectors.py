"""Passes on wide vectors and the plain ones of other processors: the same bits."""

import os
import subprocess
import sys
from pathlib import Path

import label_shapes
import numpy as np
from grids import random_grid
from test_octree_cells import least_of_cube, many_planes, reach_of, run_relaxed, unit_planes

from voxkernel import star_polyhedra_kernels
from voxkernel._core import (
    best_voxel,
    exact_cells,
    facet_planes,
    plane_signs,
    points_in_table,
    squared_depths,
    violation_cells,
)
from voxkernel.grid.lookup import ActiveTable
from voxkernel.labels.ray_sets import golden_rays

SUMMARY = """
import sys
sys.path.insert(0, sys.argv[1])
import hashlib
from test_wide_vectors import labels, octrees, planes, queries, stars
for found in (labels, octrees, planes, queries, stars):
    print(hashlib.sha256(found()).hexdigest())
"""


def labels():
    """Best voxels of solid and flat objects, some too long to keep the steps of segments; what was looked at."""
    rng, found = np.random.default_rng(6), []
    for shape in ((14, 15, 16), (1, 40, 90), (2, 5, 700), (30, 30, 20)):
        crop = np.pad(label_shapes.blobs(rng, shape, 0.6), 1)
        depths = np.empty(crop.shape)
        squared_depths(crop, shape[0] == 1, np.ones(3), depths)
        found += [best_voxel(crop, shape[0] == 1, depths, 0, always, 10**7) for always in (0, 6000)]
    return np.array(found).tobytes()


def octrees():
    """All bits of the answers on 1,200 planes."""
    rows = many_planes(1200)
    normals, offsets = unit_planes(rows)
    reach, pads, weights = reach_of(normals), np.full(len(rows), 1e-14), np.arange(1, len(rows) + 1)
    bounds = np.array([weights.sum() // 9, weights.sum() // 4])
    arrays = [*exact_cells(normals, offsets + 0.3, reach, pads, 6, False)]
    arrays += run_relaxed(rows, weights, 40, 6, bounds, bounds)
    arrays += violation_cells(normals, offsets, reach * (1 + 1e-13), weights, 40, bounds[1], 7.0, 5)
    center, cell = np.full(3, np.nan), np.full(4, np.nan)
    best = least_of_cube(normals, offsets, pads, weights, 40, 1e-15, weights.sum(), 9, 0.0, 6, 9999, center, cell)
    # More than a list of planes holds at first.
    many = np.random.default_rng(8).normal(size=(6000, 3))
    many /= np.linalg.norm(many, axis=1, keepdims=True)
    more, last = np.full(3, np.nan), np.full(4, np.nan)
    search = 1e-15, 6000, 9, 0.0, 6, 999, more, last
    beside = many @ np.full(3, 0.45) + np.linspace(-0.2, 0.4, 6000), np.full(6000, 1e-14), np.ones(6000, np.int64)
    best += least_of_cube(many, *beside, 40, *search)
    return b"".join(np.asarray(a).tobytes() for a in (*arrays, *best, center, cell, more, last))


def planes():
    """Facets round, slender, without area and too small to compute, in every place of four; signs at a few points."""
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(4000, 3))
    corners = rng.integers(0, len(vertices), (9003, 3))
    corners[::7, 2] = corners[::7, 0]
    vertices[3000:3500] = vertices[:500] + 1e-9 * rng.normal(size=(500, 3))
    corners[5::11, 1] = 3000 + corners[5::11, 0] % 500
    corners[6::11, 0] = corners[6::11, 1] % 500
    vertices[3500:] *= 1e-80
    corners[3::13] = rng.integers(3500, 4000, corners[3::13].shape)
    n = len(corners)
    arrays = normals, offsets, _, errors = np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)
    undecided = facet_planes(vertices, corners, np.array([0.1, 0.2, 0.3]), 0.7, *arrays)
    assert undecided > 100
    assert {-2.0, -1.0} < set(errors)
    signs = [plane_signs(normals, offsets, errors, x, 1e-9) for x in (np.zeros(3), *rng.normal(size=(3, 3)))]
    signs += [plane_signs(normals, offsets + 9.0, errors, np.ones(3), slack) for slack in (0.0, 9.0)]
    assert len({len(listed) for listed in signs}) > 3
    return b"".join(np.asarray(a).tobytes() for a in (undecided, *arrays, *signs))


def queries():
    """Points within, far from and nowhere near a grid."""
    grid = random_grid(5, n_cells=60)
    table = ActiveTable.build(*grid._cells(), grid.leaf_mask)
    rng = np.random.default_rng(4)
    points = rng.normal(scale=30, size=(10007, 3))
    points[::9] = rng.choice([1e300, -1e300, 1e12, np.inf, -np.inf, np.nan, 0.0], points[::9].shape)
    points[1::9] = np.round(points[1::9])
    active = np.empty(len(points), bool)
    found = b""
    for to_cells in (np.eye(3), np.linalg.inv(np.eye(3) + 0.1 * rng.normal(size=(3, 3)))):
        points_in_table(points, np.full(3, 0.25), to_cells, *table, active)
        assert 100 < active.sum() < 9000
        found += active.tobytes()
    return found


def stars():
    """Kernels of a few star polyhedra."""
    distances = 1.0 + 0.2 * np.random.default_rng(6).random((20, 96))
    kernels = star_polyhedra_kernels(np.zeros((20, 3)), distances, golden_rays(96))
    assert kernels.n_general == 0
    return kernels.volume.tobytes() + kernels.low.tobytes()


def test_plain_and_wide_passes_agree():
    """What processors without wide vectors run gives the same bits; it is chosen once, when the core is loaded."""
    here = Path(__file__).parent
    paths = os.pathsep.join([str(here.parent), *sys.path])
    answers = {
        subprocess.run(
            [sys.executable, "-c", SUMMARY, str(here)], capture_output=True, text=True, check=True, timeout=600,
            env={**os.environ, "PYTHONPATH": paths, "VOXKERNEL_AVX2": wide},
        ).stdout
        for wide in "01"
    }  # fmt: skip
    assert len(answers) == 1
