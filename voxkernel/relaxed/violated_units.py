"""The integer weights that points violate, every sign exact."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import StopFlag, violated_weights
from voxkernel._threads import run_parts
from voxkernel.relaxed.facet_weights import WeighedPlanes

__all__ = ["violated_units"]

_THREAD_CHUNK = 1 << 15
_BLOCK = 1 << 14  # rows that are looked at in one go


def violated_units(planes: WeighedPlanes, points: NDArray[np.float64], *, threads: int = 1) -> NDArray[np.int64]:
    """Add up the integer weights that points violate, every sign exact."""
    facets = planes.facets
    with np.errstate(over="ignore", invalid="ignore"):
        local = np.ascontiguousarray(facets.to_local(points).T)
    sums = np.zeros(len(points), np.int64)
    arrays = (
        local, points, facets.local_normals, facets.local_offsets, facets.local_errors, planes.weights,
        facets.corner_ids(), facets.vertices, _expansions_hold(facets.vertices) and _expansions_hold(points),
    )  # fmt: skip
    parts = _parts_of(local, max(1, min(4 * threads, len(points) // _THREAD_CHUNK)) if threads > 1 else 1)

    def run(part: NDArray[np.int64], stop: StopFlag) -> NDArray[np.int64]:
        return violated_weights(*arrays, part, sums, stop)

    for p, i in np.concatenate(run_parts(run, parts, threads)):
        a, b, c, d = facets.integer_planes([i])[0]
        x, y, z = facets.world_to_lattice([Fraction(float(v)) for v in points[p]])
        if a * x + b * y + c * z > d:
            sums[p] += planes.weights[i]
    return sums


def _expansions_hold(values: NDArray[np.float64]) -> bool:
    """Whether products of these coordinates neither overflow nor underflow in expansion arithmetic."""
    for first in range(0, len(values), _BLOCK):
        used = np.abs(values[first : first + _BLOCK])
        if used.max() > 2.0**200 or np.min(used, where=used > 0, initial=1.0) < 2.0**-200:
            return False
    return True


def _parts_of(local: NDArray[np.float64], count: int) -> list[NDArray[np.int64]]:
    """Divide points into slabs along their longest extent."""
    n = local.shape[1]
    if count == 1:
        return [np.arange(n)]
    axis = int(np.argmax(np.ptp(local, axis=1)))
    cuts = [n * k // count for k in range(1, count)]
    return np.split(np.argpartition(local[axis], cuts), cuts)
