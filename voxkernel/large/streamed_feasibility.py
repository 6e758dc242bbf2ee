"""Whether the half-spaces of a stream have a common point: what `find_feasibility` finds, in passes over chunks."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import N_BINS, deepest_point
from voxkernel.halfspaces import Feasibility, HalfSpaces, Witness
from voxkernel.halfspaces.feasibility import EVERY_DIRECTION, exact_feasibility
from voxkernel.halfspaces.witness import empty_witness
from voxkernel.large.plane_tasks import Rows
from voxkernel.large.streamed_planes import StreamedPlanes

__all__ = ["find_streamed_feasibility", "sampled_witness"]

# As in `find_deep_point` of the compiled core: the same steps with the same numbers find the same point.
_SHARE = 0.5
_BOXES = (4.0, 2.0**12, 2.0**26)
_MAX_ROUNDS = 60
_MAX_STEPS = 400
_FIRST_ROWS = 256
_EXACT_ROWS = 48
_CONSTRAINTS = 7  # of the box, before the half-spaces
_CORNER = (1, 3, 5, 6)


def find_streamed_feasibility(planes: StreamedPlanes) -> Feasibility:
    """Find the dimension of the intersection of half-spaces, exactly; the rows are those of `planes`."""
    search = _Search(planes)
    found = search.run()
    if found is not None:
        return found
    rows = planes.first_of_each(search.nearest()).rows
    return exact_feasibility(planes, rows, search.passes, planes.touched_and_violated)


def sampled_witness(planes: StreamedPlanes) -> Feasibility | None:
    """A proof from an even sample that there is no common point; None where the sample has one."""
    search = _Search(planes)
    return search.run(max_rounds=0)


class _Working(NamedTuple):
    """A working set in the order in which it grew, and its planes."""

    rows: NDArray[np.int64]
    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]

    def followed_by(self, more: _Working) -> _Working:
        """The set grown."""
        return _Working(
            np.concatenate([self.rows, more.rows]), np.concatenate([self.corners, more.corners]),
            np.concatenate([self.normals, more.normals]), np.concatenate([self.offsets, more.offsets]),
        )  # fmt: skip


class _Search:
    """A deep point on a growing working set."""

    def __init__(self, planes: StreamedPlanes) -> None:
        n = len(planes)
        step = 1 if n <= N_BINS else max(1, n // _FIRST_ROWS)
        self._planes = planes
        self.passes = 0
        self._point = np.zeros(4)
        self._basis, self._multipliers = np.array(_CORNER), np.zeros(4)
        self._set = self._working(planes.rows(np.arange(0, n, step)))

    def _working(self, rows: Rows) -> _Working:
        planes = self._planes.halfspaces(rows)
        return _Working(rows.rows, rows.corners, planes.local_normals, planes.local_offsets)

    def run(self, *, max_rounds: int = _MAX_ROUNDS) -> Feasibility | None:
        """A proven answer, or None where floating point has none; no pass at all for `max_rounds` = 0."""
        depth, best, box = 0.0, np.zeros(3), 0
        for _ in range(_MAX_ROUNDS):
            size = _BOXES[box]
            arrays = self._set.normals, self._set.offsets, np.arange(len(self._set.rows))
            state = self._basis, self._multipliers, self._point
            if deepest_point(*arrays, size, *state, 1e-15 * size, _MAX_STEPS) < 0:
                break
            upper = float(self._point[3])
            if upper < 0.0:
                if ((self._basis < _CONSTRAINTS - 1) & (self._multipliers > 1e-13)).any():
                    box += 1
                    if box == len(_BOXES):
                        break
                    continue
                witness = self._witness()
                if witness is not None:
                    return Feasibility(
                        self._planes, -1, None, (), (witness,), self._set.rows, None, -upper, self.passes
                    )
                break
            if not max_rounds:
                return None
            tight = self._planes.tightest(self._point[:3].copy(), upper)
            self.passes += 1
            if tight.certain > 0.0 and tight.smallest > depth:
                depth, best = tight.smallest, self._point[:3].copy()
            fresh = ~np.isin(tight.found.rows, self._set.rows)
            if (depth > 0.0 and depth >= _SHARE * upper) or not fresh.any():
                break
            more = self._working(tight.found.part(fresh))
            self._set = self._set.followed_by(more)
        if depth == 0.0:
            return None
        rows = self._set.rows
        return Feasibility(self._planes, 3, None, EVERY_DIRECTION, (), rows, best, depth, self.passes)

    def _witness(self) -> Witness | None:
        """Half-spaces that hold the maximum, with multipliers that prove it."""
        held = [b - _CONSTRAINTS for b, m in zip(self._basis, self._multipliers, strict=True) if m > 0.0]
        positions = np.array([w for w in held if w >= 0], np.int64)
        order = np.argsort(self._set.rows[positions], kind="stable")
        rows = Rows(self._set.rows[positions][order], self._set.corners[positions][order])
        planes: HalfSpaces = self._planes.halfspaces(rows).select(np.argsort(order))
        witness = empty_witness(planes, np.arange(len(positions)))
        if witness is None:
            return None
        return replace(witness, ids=tuple(int(self._set.rows[positions[i]]) for i in witness.ids))

    def nearest(self) -> Rows:
        """The members of the working set nearest to the last point."""
        x, y, z = self._point[:3]
        n = self._set.normals
        slack = self._set.offsets - (n[:, 0] * x + n[:, 1] * y + n[:, 2] * z)
        chosen = np.argsort(slack, kind="stable")[:_EXACT_ROWS]
        chosen = chosen[np.argsort(self._set.rows[chosen])]
        return Rows(self._set.rows[chosen], self._set.corners[chosen])
