"""How far points outside of a closed surface are from it, on a grid; each distance a bound from below."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import cells_may_see, clearances
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.guarding.clock import Clock
from voxkernel.guarding.sight import Sight, Spots, turns_around

__all__ = ["OutsideGrid", "outside_grid"]

_NODES_AT_ONCE, _CELLS_AT_ONCE = 8192, 32  # between two looks at the clock
_MARGIN = 3  # nodes around the bounding box
_MOST_HOLLOWS = 32  # parts of space away from the surface that are looked at, the largest


@dataclass(frozen=True, eq=False, repr=False)
class OutsideGrid(Frozen):
    """Nodes that are outside for certain have a distance, all others 0.

    `slack` is far above the rounding of the few dozen operations, on numbers of the size of the coordinates and of the
    surface, by which distances and places are compared: 1e-12 of these, where 1e-14 would do.
    """

    distances: NDArray[np.float64]
    low: NDArray[np.float64]
    step: float
    slack: float

    def may_see(
        self, sight: Sight, centers: NDArray[np.float64], halves: NDArray[np.float64], parents: NDArray[np.int64],
        before: NDArray[np.bool_], spots: Spots, clock: Clock,
    ) -> NDArray[np.bool_]:  # fmt: skip
        """Whether a cell may hold a point that sees a spot; what its parent cannot see, it cannot.

        When the time is over cells may see what their parents may: supersets still.
        """
        n = len(spots)
        found = np.zeros((len(centers), n), np.bool_)
        normals = np.ascontiguousarray(sight.normals[spots.faces])
        n_parts = max(sight.threads, -(-len(centers) // _CELLS_AT_ONCE))
        parts = np.array_split(np.arange(len(centers)), max(1, min(n_parts, len(centers))))
        inherited = np.ascontiguousarray(before).reshape(-1)

        def work(ids: NDArray[np.int64], stop: Any) -> None:
            if clock.is_over:
                found[ids] = np.where(parents[ids, None] >= 0, before[parents[ids]], True)
            elif len(ids):
                rows = found[ids[0] : ids[-1] + 1].reshape(-1)
                cells_may_see(
                    self.distances, self.low, self.step, np.ascontiguousarray(centers[ids]),
                    np.ascontiguousarray(halves[ids]), np.ascontiguousarray(parents[ids]), inherited, spots.places,
                    normals, self.slack, rows, stop,
                )  # fmt: skip

        run_parts(work, parts, sight.threads)
        return found


def outside_grid(sight: Sight, resolution: int, clock: Clock) -> OutsideGrid:
    """Measure distances at the nodes of a grid and flood it from its border; nodes there is no time for have 0.

    Two neighbours are on one side of the surface where one of them is farther from it than they are apart. So what the
    flood reaches is outside for certain; narrow gaps are not reached, and hide nothing. So are hollows that the surface
    does not go around: the sum of angles is a whole number, and its rounding far from a half this far away from all
    facets.
    """
    from scipy.ndimage import binary_dilation, label

    size = float((sight.high - sight.low).max())
    step = size / resolution
    shape = np.ceil((sight.high - sight.low) / step).astype(np.int64) + 2 * _MARGIN + 1
    low = sight.low - _MARGIN * step
    axes = [a + step * np.arange(n) for a, n in zip(low, shape, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    slack = 1e-12 * (float(np.abs(nodes).max()) + sight.diagonal)
    found = np.zeros(len(nodes))
    parts = np.array_split(np.arange(len(nodes)), max(sight.threads, -(-len(nodes) // _NODES_AT_ONCE)))

    def work(ids: NDArray[np.int64], stop: Any) -> None:
        if not clock.is_over:
            clearances(sight.tree, np.ascontiguousarray(nodes[ids]), found[ids[0] : ids[-1] + 1], stop)

    run_parts(work, parts, sight.threads)
    distances = np.maximum(found - slack, 0.0).reshape(shape)
    free = distances > step + slack
    found_labels: Any = label(free)
    labels: NDArray[np.int64] = found_labels[0]
    border = np.ones(tuple(shape), np.bool_)
    border[1:-1, 1:-1, 1:-1] = False
    known: NDArray[np.int64] = np.unique(labels[border & free])
    sizes = np.bincount(labels.reshape(-1))
    sizes[0] = 0
    sizes[known] = 0
    hollows = [
        part for part in np.argsort(-sizes, kind="stable")[:_MOST_HOLLOWS].tolist()
        if sizes[part] and _is_outside(sight, nodes[np.flatnonzero(labels.reshape(-1) == part)[0]])
    ]  # fmt: skip
    reached = np.isin(labels, [*known.tolist(), *hollows]) & free
    outside: NDArray[np.bool_] = np.logical_or(np.asarray(binary_dilation(reached)), reached)
    return OutsideGrid(np.where(outside, distances, 0.0), np.ascontiguousarray(low), step, slack)


def _is_outside(sight: Sight, node: NDArray[np.float64]) -> bool:
    return float(turns_around(sight.vertices[sight.faces], node).sum()) < 0.5
