"""`voxel_kernel` of planes that touch an ellipsoid, beside a prototype that stores nothing and a dense sweep."""

import numpy as np
import pytest

import voxkernel
from voxkernel.halfspaces import HalfSpaces, planes_domain

EDGE = 2.6  # the root cube: 1.3 times the longest extent of the ellipsoid


def tangent_planes(n):
    rng = np.random.default_rng(0)
    u = rng.normal(size=(n, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    axes = np.array([1.0, 0.7, 0.5])
    normals = u / axes
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return normals, np.einsum("ij,ij->i", normals, u * axes)


def cube():
    """The root cube as a prepared domain, as the rivals take prepared arrays."""
    return planes_domain(np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, EDGE / 2))


def slabs(edge, n):
    """The points of a dense grid, (n^2, 3) at a time."""
    ticks = (np.arange(n) + 0.5) / n * edge - edge / 2
    across = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), -1).reshape(-1, 2)
    for x in ticks:
        yield np.column_stack([np.full(len(across), x), across])


def dense_sweep(normals, offsets, edge, n):
    """Werghi's method in NumPy: a point leaves the sweep at the first 64 planes that hold a violation."""
    inside = 0
    for points in slabs(edge, n):
        for first in range(0, len(offsets), 64):
            part = slice(first, first + 64)
            points = points[(points @ normals[part].T <= offsets[part]).all(axis=1)]
        inside += len(points)
    return inside * (edge / n) ** 3


def full_sweep(normals, offsets, edge, n):
    """The same with every facet tried at every point, as the paper describes it."""
    inside = 0
    for points in slabs(edge, n):
        violated = np.zeros(len(points), np.int64)
        for first in range(0, len(offsets), 64):
            part = slice(first, first + 64)
            violated += (points @ normals[part].T > offsets[part]).sum(axis=1)
        inside += int((violated == 0).sum())
    return inside * (edge / n) ** 3


@pytest.mark.parametrize("depth", [6, 7, 8, 9, 10])
@pytest.mark.parametrize("n_planes", [200, 2000])
def test_beside_prototype(side_by_side, prototype, n_planes, depth):
    normals, offsets = tangent_planes(n_planes)
    planes = HalfSpaces.from_planes(normals, offsets)
    run = prototype("relaxed_octree").run
    shifted = (offsets + normals @ np.full(3, EDGE / 2)) / EDGE
    reach, weights, stats = np.abs(normals).sum(1), np.full(n_planes, 1 / n_planes), np.zeros(3, np.int64)

    domain = cube()

    def ours():
        return voxkernel.voxel_kernel(planes, depth=depth, domain=domain)

    def theirs():
        return run(normals, shifted, weights, reach, depth, 0.0, stats)

    ours(), theirs()
    answer = side_by_side(f"{n_planes} planes, depth {depth}", {"voxel_kernel": ours, "prototype": theirs})
    grid = answer["voxel_kernel"][1]
    print(f"{grid.nbytes / 1e6:.2f} MB, {grid.inside.leaf_count} leaves, {grid.inside.tile_count} tiles")


@pytest.mark.parametrize("n_planes", [200, 2000])
def test_beside_dense_sweep(side_by_side, n_planes):
    normals, offsets = tangent_planes(n_planes)
    planes = HalfSpaces.from_planes(normals, offsets)
    domain = cube()
    rivals = {
        "voxel_kernel": lambda: voxkernel.voxel_kernel(planes, depth=7, domain=domain),
        "dense sweep, early exit": lambda: dense_sweep(normals, offsets, EDGE, 128),
        "dense sweep": lambda: full_sweep(normals, offsets, EDGE, 128),
    }
    dense_sweep(normals, offsets, EDGE, 2), full_sweep(normals, offsets, EDGE, 2), rivals["voxel_kernel"]()
    answer = side_by_side(f"{n_planes} planes, depth 7", rivals, rounds=3)
    low, high = answer["voxel_kernel"][1].volume_bounds
    assert low <= answer["dense sweep"][1] <= high
