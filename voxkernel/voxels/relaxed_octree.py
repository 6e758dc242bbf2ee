"""Run the relaxed octree on one or more threads and sort its cells by threshold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import StopFlag, relaxed_cells
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.halfspaces import Domain
from voxkernel.relaxed.facet_weights import WeighedPlanes
from voxkernel.relaxed.root_cube import RootCube, cube_arrays

__all__ = ["RelaxedCells", "relaxed_cells_of"]

_FEW = 50_000  # planes up to which the work is divided among 64 cells, not 8
_NEVER = 99


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RelaxedCells(Frozen):
    """The cells of one relaxed kernel: tiles and leaf masks as `SparseGrid` wants them, voxel counts."""

    tile_ijk: NDArray[np.int32]
    tile_log2: NDArray[np.int8]
    leaf_ijk: NDArray[np.int32]
    leaf_inside: NDArray[np.uint64]
    leaf_boundary: NDArray[np.uint64]
    n_inside: int
    n_boundary: int


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
    order = np.argsort(shares, kind="stable")
    ins, outs = planes.thresholds([shares[k] for k in order])
    normals, offsets, reach, pads, weights, n_domain = cube_arrays(planes, domain, cube, depth)
    # Half a voxel is the smallest half edge: over it the pad becomes a part of the reach.
    padded = reach + pads * 2.0 ** (depth + 1)
    numbers = np.column_stack([normals, padded, 0.5 * normals.sum(axis=1) - offsets])
    everything = np.array([0, len(ins)])

    def run(
        numbers: NDArray[np.float64], weights: NDArray[np.int64], n_domain: int, certain: int,
        k_range: NDArray[np.int64], level: int, start: NDArray[np.int64], stop_level: int, flag: StopFlag | None = None,
    ) -> tuple[Any, ...]:  # fmt: skip
        return relaxed_cells(
            numbers, weights, n_domain, certain, ins, outs, k_range, depth, level, start, stop_level, count_only, flag
        )

    root = np.zeros(3, np.int64)
    split = min(depth - 4, 2 if len(weights) <= _FEW else 1)
    if threads == 1 or split < 1:
        parts = [run(numbers, weights, n_domain, 0, everything, -1, root, _NEVER)]
    else:
        top = run(numbers, weights, n_domain, 0, everything, -1, root, split)
        *_, pending, listed, listed_weights = top
        jobs = [
            (listed[first:end], listed_weights[first:end], middle - first, certain, row[7:], split, row[:3], _NEVER)
            for row in pending
            for first, middle, end, certain in [row[3:7].tolist()]
        ]
        parts = [top, *run_parts(lambda job, flag: run(*job, flag), jobs, threads)]
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
    counts = sum(int(p[7][k]) for p in parts), sum(int(p[8][k]) for p in parts)
    return RelaxedCells(tile_ijk, tile_log2, leaf_ijk, inside, boundary, *counts)
