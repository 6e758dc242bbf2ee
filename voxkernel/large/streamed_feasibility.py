"""Whether the half-spaces of a stream have a common point: what `find_feasibility` finds, in passes over chunks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import DeepPointSearch
from voxkernel.halfspaces import Feasibility, HalfSpaces, Witness
from voxkernel.halfspaces.feasibility import EVERY_DIRECTION, exact_feasibility
from voxkernel.halfspaces.witness import empty_witness
from voxkernel.large.plane_tasks import Rows
from voxkernel.large.streamed_planes import StreamedPlanes

__all__ = ["find_streamed_feasibility", "sampled_witness"]


def find_streamed_feasibility(planes: StreamedPlanes) -> Feasibility:
    """Find the dimension of the intersection of half-spaces, exactly; the rows are those of `planes`."""
    search = _Search(planes)
    while search.propose():
        tight = planes.tightest(search.point(), search.upper)
        fresh = search.fresh(tight.found.rows)
        if not search.judge(tight.smallest, tight.certain, len(fresh) > 0):
            break
        search.take(tight.found.part(np.isin(tight.found.rows, fresh)))
    found = search.proven()
    if found is not None:
        return found
    rows = planes.first_of_each(search.nearest()).rows
    return exact_feasibility(planes, rows, search.result()[-1], planes.touched_and_violated)


def sampled_witness(planes: StreamedPlanes) -> Feasibility | None:
    """A proof from an even sample that there is no common point; None where the sample has one."""
    search = _Search(planes)
    return None if search.propose() else search.proven()


class _Search(DeepPointSearch):
    """The search of `find_deep_point`, with the corners of its working set."""

    def __init__(self, planes: StreamedPlanes) -> None:
        super().__init__()
        self._planes, self._set = planes, planes.rows(np.empty(0, np.int64))
        self.take(planes.rows(self.first_rows(len(planes))))

    def take(self, rows: Rows) -> None:
        """Take half-spaces into the working set."""
        planes = self._planes.halfspaces(rows)
        self.add(rows.rows, planes.local_normals, planes.local_offsets)
        self._set = self._set.joined(rows)

    def proven(self) -> Feasibility | None:
        """What floating point says, if it can be proven."""
        rows, opposing, gap, depth, point, _, passes = self.result()
        if len(opposing):
            witness = self._witness(opposing)
            if witness is not None:
                return Feasibility(self._planes, -1, None, (), (witness,), rows, None, gap, passes)
        if depth == 0.0:
            return None
        return Feasibility(self._planes, 3, None, EVERY_DIRECTION, (), rows, point, depth, passes)

    def _witness(self, opposing: NDArray[np.int64]) -> Witness | None:
        order = np.argsort(opposing, kind="stable")
        planes: HalfSpaces = self._planes.halfspaces(self._corners(opposing[order])).select(np.argsort(order))
        witness = empty_witness(planes, np.arange(len(opposing)))
        return None if witness is None else replace(witness, ids=tuple(int(opposing[i]) for i in witness.ids))

    def _corners(self, rows: NDArray[np.int64]) -> Rows:
        return self._set.part(np.searchsorted(self._set.rows, rows))

    def nearest(self) -> Rows:
        """The members of the working set nearest to the last point."""
        return self._corners(np.sort(self.result()[-2]))
