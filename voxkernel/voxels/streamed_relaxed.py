"""The relaxed kernel of a streamed surface: what its chunks violate of open cells is added up, no list is kept."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import StopFlag, add_open_weights
from voxkernel._threads import run_parts
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.large.streamed_feasibility import find_streamed_feasibility
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.best_center import GAP, center_of_planes
from voxkernel.relaxed.facet_weights import WeighedPlanes
from voxkernel.relaxed.root_cube import MIN_DEPTH, RootCube, cube_planes, root_cube
from voxkernel.relaxed.streamed_center import streamed_center
from voxkernel.relaxed.streamed_violation import StreamedWeights, relaxed_region
from voxkernel.voxels.kernel_grid import KernelGrid
from voxkernel.voxels.relaxed_octree import RelaxedCells
from voxkernel.voxels.voxel_kernels import RTOL_MAX_DEPTH, Step, still_apart, wrap_relaxed

__all__ = ["relaxed_kernel_of_stream", "streamed_cells"]

_BRICK = 3  # a brick has 2**3 voxels an edge
_VOXELS = 8**_BRICK
_BRICK_BYTES = 2 * 8 * _VOXELS
_BYTES = 1 << 28  # for the sums of a pass
_MOST_PASSES = 16  # for the bricks of one depth
_LEVELS = 3  # looked at in one pass, at most: without the lists of the level above, all of their cells are
_BLOCK = 1 << 12  # bricks that become masks at a time

Numbers = tuple[NDArray[np.float64], NDArray[np.int64]]


def relaxed_kernel_of_stream(
    reader: SurfaceReader, share: float, above_least: bool, domain: Any, step: Step, threads: int
) -> KernelGrid:
    """Compute the relaxed kernel of a tolerance, or of a margin above the least violation.

    Notes
    -----
    A pass adds up what every chunk violates of the cells that are still open, for certain and at most, and of some
    levels below them. Sums of integers are those of the octree in memory, and so are the cells.
    """
    if above_least:
        least = streamed_center(reader, domain, "area", GAP, 0.0, center_of_planes).violation_bounds[1]
        share = min(1.0, least + share)
    region = relaxed_region(reader, domain)
    depth, voxel_size, rtol = step
    weights = StreamedWeights(reader, "area")
    dimension = find_streamed_feasibility(weights.planes.in_domain(region)).dimension
    cube, levels = root_cube(region.vertices, np.eye(3), depth=depth, voxel_size=voxel_size)
    octree = _Octree(weights, region, cube, levels if rtol is None else RTOL_MAX_DEPTH, share, threads)
    reason = ""
    if rtol is None:
        reached, cells = octree.cells_at(levels)
        if reached < levels:
            reason = f"depth {levels} takes too much memory or too many passes: voxels are those of depth {reached}"
    else:
        reached, cells = octree.cells_at(MIN_DEPTH)
        while (apart := cells.n_boundary / max(1, cells.n_inside + cells.n_boundary)) > rtol:
            before = reached
            if reached < RTOL_MAX_DEPTH:
                reached, cells = octree.cells_at(reached + 1)
            if reached == before:
                text = f"the bounds still differ by {apart:.2g} at depth {reached}, the largest that memory allows"
                reason = still_apart(apart) if reached == RTOL_MAX_DEPTH else text
                break
    return wrap_relaxed(cells, share, cube, reached, dimension, region, reason)


def streamed_cells(
    weights: StreamedWeights, region: Domain, cube: RootCube, depth: int, share: float
) -> RelaxedCells:
    """Classify a cube for a share, as `relaxed_cells_of`; of few levels: these do not run out of memory or passes."""
    reached, cells = _Octree(weights, region, cube, depth, share, 1).cells_at(depth)
    if reached < depth:
        raise ValueError(f"`depth` must be so small that a few passes do; got {depth}, and {reached} was reached")
    return cells


class _Cells(NamedTuple):
    """Cells of one level by their codes."""

    level: int
    codes: NDArray[np.int64]


class _Octree:
    """The cells that are still open, and those that were settled on the way down."""

    def __init__(
        self, weights: StreamedWeights, region: Domain, cube: RootCube, depth: int, share: float, threads: int
    ) -> None:
        self._weights, self._cube, self._depth, self._threads = weights, cube, depth, threads
        slack = weights.slack
        ins, outs = WeighedPlanes(weights.planes.given, np.empty(0, np.int64), np.empty(0), slack).thresholds([share])
        self._in, self._out = int(ins[0]), int(outs[0])
        border = HalfSpaces.from_planes(region.normals, region.offsets)
        self._border = self._numbers(border), np.ones(len(border), np.int64)
        self._open = _Cells(0, np.zeros(1, np.int64))
        self._is_fresh = True  # the root was not looked at
        self._tiles: list[_Cells] = []

    def cells_at(self, depth: int) -> tuple[int, RelaxedCells]:
        """Go down to a depth, or as deep as memory and the number of passes allow: the depth, and the cells."""
        last = depth - _BRICK
        while self._open.level < last and len(self._open.codes) and self._n_passes() <= max(1, _MOST_PASSES // 4):
            below = min(_LEVELS, last - self._open.level)
            while below > 1 and 16 * len(self._open.codes) * _n_down(below) > _BYTES:
                below -= 1
            self._descend(below)
        if self._open.level == 0 and self._is_fresh:
            self._descend(0)
        reached = depth if not len(self._open.codes) else self._open.level + _BRICK
        return reached, self._with_bricks(reached)

    def _n_passes(self) -> int:
        return -(-_BRICK_BYTES * len(self._open.codes) // _BYTES)

    def _numbers(self, planes: HalfSpaces) -> NDArray[np.float64]:
        """Normal, reach and value at the centre, as `relaxed_cells_of` makes them."""
        normals, offsets, reach, pads = cube_planes(planes, self._cube, self._depth)
        padded = reach + pads * 2.0 ** (self._depth + 1)
        return np.column_stack([normals, padded, 0.5 * normals.sum(axis=1) - offsets])

    def _add(self, planes: Numbers, cells: _Cells, below: int, sums: NDArray[np.int64], bricks: NDArray[np.int64]):
        """Add what some planes violate; threads have cells of their own."""

        def add(part: slice, stop: StopFlag) -> None:
            flat = sums[part].reshape(-1), bricks[part].reshape(-1)
            add_open_weights(*planes, cells.level, cells.codes[part], below, *flat, stop)

        n = len(cells.codes)
        step = -(-n // self._threads)
        run_parts(add, [slice(first, min(n, first + step)) for first in range(0, n, step)], self._threads)

    def _pass(self, cells: _Cells, below: int, *, bricks: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        n = len(cells.codes)
        sums = np.zeros((n, _n_down(below), 2), np.int64)
        fine = np.zeros((n if bricks else 0, 2, _VOXELS), np.int64)
        for weighed in self._weights.chunks("voxels"):
            self._add((self._numbers(weighed.facets), weighed.weights), cells, below, sums, fine)
        return sums, fine

    def _descend(self, below: int) -> None:
        """One pass: settle cells on the next levels, keep those that stay open."""
        cells = self._open
        sums, _ = self._pass(cells, below, bricks=False)
        border = np.zeros_like(sums)
        self._add(self._border, cells, below, border, np.empty((0, 2, _VOXELS), np.int64))
        rows, local = np.arange(len(cells.codes)), np.zeros(len(cells.codes), np.int64)
        for k in range(below + 1):
            if k:
                rows, local = np.repeat(rows, 8), (8 * local[:, None] + np.arange(8)).reshape(-1)
            if k or self._is_fresh:
                at = rows, (_n_down(k - 1) if k else 0) + local
                (certain, possible), (beyond, crossed) = sums[at].T, border[at].T
                is_inside = (beyond == 0) & (crossed == 0) & (certain <= self._out) & (possible <= self._in)
                codes = (cells.codes[rows] << 3 * k) + local
                self._tiles.append(_Cells(cells.level + k, codes[is_inside]))
                is_open = (beyond == 0) & (certain <= self._out) & ~is_inside
                rows, local = rows[is_open], local[is_open]
        self._open = _Cells(cells.level + below, (cells.codes[rows] << 3 * below) + local)
        self._is_fresh = False

    def _with_bricks(self, depth: int) -> RelaxedCells:
        """Settle the voxels of the open cells, which are bricks, in as many passes as memory wants."""
        most = max(1, _BYTES // _BRICK_BYTES)
        level, codes = self._open
        full, leaves, masks = list(self._tiles), [np.empty((0, 3), np.int32)], [np.empty((0, 2, 8), np.uint64)]
        for first in range(0, len(codes), most):
            cells = _Cells(level, codes[first : first + most])
            _, fine = self._pass(cells, 0, bricks=True)
            for low in range(0, len(cells.codes), _BLOCK):
                part = _Cells(level, cells.codes[low : low + _BLOCK])
                inside, boundary = self._settled(part, fine[low : low + _BLOCK])
                is_full, is_leaf = inside.all(axis=1), (inside | boundary).any(axis=1)
                full.append(_Cells(level, part.codes[is_full]))
                is_leaf &= ~is_full
                leaves.append(_corners(_Cells(level, part.codes[is_leaf]), depth))
                masks.append(np.stack([_words(inside[is_leaf]), _words(boundary[is_leaf])], axis=1))
        tiles = [cells for cells in full if len(cells.codes)]
        log2 = [np.full(len(cells.codes), depth - cells.level, np.int8) for cells in tiles]
        ijk = [_corners(cells, depth) for cells in tiles]
        inside, boundary = np.concatenate(masks).swapaxes(0, 1).copy()
        n_inside = sum(len(c.codes) << 3 * (depth - c.level) for c in tiles) + int(np.bitwise_count(inside).sum())
        return RelaxedCells(
            np.concatenate([np.empty((0, 3), np.int32), *ijk]), np.concatenate([np.empty(0, np.int8), *log2]),
            np.concatenate(leaves), inside, boundary, n_inside, int(np.bitwise_count(boundary).sum()),
        )  # fmt: skip

    def _settled(self, cells: _Cells, fine: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which voxels of bricks are inside, and which undecided."""
        nothing, border = np.zeros((len(fine), 1, 2), np.int64), np.zeros_like(fine)
        self._add(self._border, cells, 0, nothing, border)
        outside = (fine[:, 0] > self._out) | (border[:, 0] > 0)
        inside = (fine[:, 1] <= self._in) & (border[:, 1] == 0)
        return inside, ~inside & ~outside


def _n_down(below: int) -> int:
    """How many cells there are from one down to some levels below it."""
    return (8 ** (below + 1) - 1) // 7


def _corners(cells: _Cells, depth: int) -> NDArray[np.int32]:
    """Lower corners, in voxels of a depth."""
    ijk = np.zeros((len(cells.codes), 3), np.int64)
    for level in range(cells.level):
        for axis in range(3):
            ijk[:, axis] |= (cells.codes >> (3 * level + 2 - axis) & 1) << level
    return (ijk << (depth - cells.level)).astype(np.int32)


def _words(voxels: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Masks of leaves: word x, bit 8 y + z; entry 64 z + 8 x + y of what is given."""
    by_word = voxels.reshape(-1, 8, 8, 8).transpose(0, 2, 3, 1).reshape(-1, 8, 64)
    return np.packbits(by_word, axis=2, bitorder="little").view("<u8").reshape(-1, 8).astype(np.uint64)
