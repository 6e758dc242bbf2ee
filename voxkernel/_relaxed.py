"""Run the relaxed octree on one or more threads and sort its cells by threshold."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._cube import RootCube, cube_planes
from voxkernel._weights import WeighedPlanes
from voxkernel.domain import Domain
from voxkernel.halfspaces import HalfSpaces

__all__ = ["RelaxedCells", "cube_arrays", "relaxed_cells_of"]

_SPLIT_LEVEL = 2
_NEVER = 99


@dataclass(frozen=True, slots=True)
class RelaxedCells:
    """The cells of one relaxed kernel: tiles and leaf masks as `SparseGrid` wants them, voxel counts."""

    tile_ijk: NDArray[np.int32]
    tile_log2: NDArray[np.int8]
    leaf_ijk: NDArray[np.int32]
    leaf_inside: NDArray[np.uint64]
    leaf_boundary: NDArray[np.uint64]
    n_inside: int
    n_boundary: int


def cube_arrays(
    planes: WeighedPlanes, domain: Domain, cube: RootCube, depth: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], int]:
    """Express domain and facets in the unit cube, the domain first.

    Returns normals, offsets, |a|_1, pads, weights (1 for the domain) and the number of domain planes.
    """
    border = HalfSpaces.from_planes(domain.normals, domain.offsets)
    parts = cube_planes(border, cube, depth), cube_planes(planes.facets, cube, depth)
    normals, offsets, reach, pads = (np.concatenate(pair) for pair in zip(*parts, strict=True))
    weights = np.concatenate([np.ones(len(border), np.int64), planes.weights])
    return normals, offsets, reach, pads, weights, len(border)


def relaxed_cells_of(
    planes: WeighedPlanes,
    domain: Domain,
    cube: RootCube,
    depth: int,
    shares: list[float],
    *,
    threads: int = 1,
    count_only: bool = False,
) -> list[RelaxedCells]:
    """Classify the cube for every share, in one traversal; the result does not depend on `threads`."""
    from voxkernel._loops.relaxed import relaxed_cells

    order = np.argsort(shares, kind="stable")
    ins, outs = planes.thresholds([shares[k] for k in order])
    normals, offsets, reach, pads, weights, n_domain = cube_arrays(planes, domain, cube, depth)
    # Half a voxel is the smallest half edge: over it the pad becomes a part of the reach.
    arrays = normals, offsets, reach + pads * 2.0 ** (depth + 1), weights, n_domain, ins, outs, depth
    root = np.zeros(3, np.int64)
    if threads == 1 or depth - 3 <= _SPLIT_LEVEL:
        parts = [relaxed_cells(*arrays, 0, root, _NEVER, count_only)]
    else:
        top = relaxed_cells(*arrays, 0, root, _SPLIT_LEVEL, count_only)

        def run(start: NDArray[np.int64]) -> tuple[Any, ...]:
            return relaxed_cells(*arrays, _SPLIT_LEVEL, start, _NEVER, count_only)

        with ThreadPoolExecutor(threads) as pool:
            parts = [top, *pool.map(run, top[7])]
    found = [_sorted_out(parts, k) for k in range(len(shares))]
    return [found[k] for k in np.argsort(order, kind="stable")]


def _sorted_out(parts: list[tuple[Any, ...]], k: int) -> RelaxedCells:
    """Collect the rows of one threshold."""
    tiles = [part[2] == k for part in parts]
    leaves = [part[4] == k for part in parts]
    tile_ijk, tile_log2 = (np.concatenate([p[j][rows] for p, rows in zip(parts, tiles, strict=True)]) for j in (0, 1))
    leaf_ijk, inside, boundary = (
        np.concatenate([p[j][rows] for p, rows in zip(parts, leaves, strict=True)]) for j in (3, 5, 6)
    )
    counts = sum(int(p[8][k]) for p in parts), sum(int(p[9][k]) for p in parts)
    return RelaxedCells(tile_ijk, tile_log2, leaf_ijk, inside, boundary, *counts)
