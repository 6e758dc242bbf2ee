"""`voxel_kernel` of planes that touch an ellipsoid, beside a prototype that stores nothing and a dense sweep."""

import numpy as np
import pytest
from numba import njit

import voxkernel
from voxkernel.domain import planes_domain
from voxkernel.halfspaces import HalfSpaces

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


@njit(cache=False)
def dense_sweep(normals, offsets, edge, n):
    """Werghi's method: every plane at every point of the grid, left early at the first violation."""
    inside = 0
    for x in range(n):
        for y in range(n):
            for z in range(n):
                u = (x + 0.5) / n * edge - edge / 2
                v = (y + 0.5) / n * edge - edge / 2
                w = (z + 0.5) / n * edge - edge / 2
                ok = True
                for i in range(offsets.shape[0]):
                    if normals[i, 0] * u + normals[i, 1] * v + normals[i, 2] * w > offsets[i]:
                        ok = False
                        break
                inside += ok
    return inside * (edge / n) ** 3


@njit(cache=False)
def full_sweep(normals, offsets, edge, n):
    """The same with every facet tried at every point, as the paper describes it."""
    inside = 0
    for x in range(n):
        for y in range(n):
            for z in range(n):
                u = (x + 0.5) / n * edge - edge / 2
                v = (y + 0.5) / n * edge - edge / 2
                w = (z + 0.5) / n * edge - edge / 2
                violated = 0
                for i in range(offsets.shape[0]):
                    violated += normals[i, 0] * u + normals[i, 1] * v + normals[i, 2] * w > offsets[i]
                inside += violated == 0
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
