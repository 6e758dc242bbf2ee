"""What a pass makes of the half-spaces of one chunk, and how that of neighbours is merged, wherever it is done."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import N_BINS, plane_signs, planes_reaching, tightest_by_direction
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.local_frame import LocalFrame

__all__ = ["Alike", "Bins", "Objecting", "PlaneMaker", "Reaching", "Rows", "some_rows", "tighter", "tightest"]

_ALL = np.empty(0, np.bool_)  # of the planes of a chunk
_ALIKE = 1e-6  # normals and offsets of planes that may be the same differ by less
_PRODUCTS = 1 << 20  # held at a time


class Rows(NamedTuple):
    """Some of the planes: their numbers, and the corners of those that are facets (0 for those given as numbers)."""

    rows: NDArray[np.int64]
    corners: NDArray[np.float64]

    def part(self, keep: NDArray[Any]) -> Rows:
        """Those of a mask or of positions."""
        return Rows(self.rows[keep], self.corners[keep])

    def joined(self, other: Rows) -> Rows:
        """Both, in the order of their numbers, each once."""
        rows, first = np.unique(np.concatenate([self.rows, other.rows]), return_index=True)
        return Rows(rows, np.concatenate([self.corners, other.corners])[first])


class PlaneMaker(NamedTuple):
    """What it takes to make the half-spaces of a chunk and of some rows, wherever that is done."""

    frame: LocalFrame
    n_facet_planes: int
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    is_cone: bool

    def made(self, corners: NDArray[np.float64], facets: NDArray[np.int64]) -> HalfSpaces:
        """The half-spaces of some facets."""
        planes = HalfSpaces._in_frame(corners, facets, self.frame)
        return planes.recession_cone() if self.is_cone else planes

    def of_rows(self, found: Rows, facets: NDArray[np.int64] | None = None) -> HalfSpaces:
        """The half-spaces of some rows, in their order; without the ids of their facets where those are not given."""
        is_facet = found.rows < self.n_facet_planes
        planes = self.made(found.corners[is_facet], found.rows[is_facet] if facets is None else facets)
        n = len(planes)
        if not len(self.offsets):
            return planes
        planes = planes.with_planes(self.normals, self.offsets)
        return planes.select(np.where(is_facet, np.cumsum(is_facet) - 1, n + found.rows - self.n_facet_planes))

    def heads(self, every: Rows) -> Rows:
        """One of each plane: the first."""
        groups = self.of_rows(every).coplanar_groups()
        return every.part(groups == np.arange(len(groups)))


class Bins(NamedTuple):
    """The smallest slack, the smallest certain one, and the tightest plane of each direction, -1 for none."""

    smallest: float
    certain: float
    best: NDArray[np.int64]
    least: NDArray[np.float64]
    corners: NDArray[np.float64]


def tightest(point: NDArray[np.float64], limit: float, first: int, planes: HalfSpaces) -> Bins:
    """The nearest of a chunk to a point, of those nearer than `limit`."""
    ids, slacks, corners = np.full(N_BINS, -1), np.full(N_BINS, np.inf), np.zeros((N_BINS, 3, 3))
    if not len(planes):
        return Bins(np.inf, np.inf, ids, slacks, corners)
    arrays = planes.local_normals, planes.local_offsets, planes.local_errors
    smallest, certain, _ = tightest_by_direction(*arrays, point, limit, ids, slacks)
    is_found = ids >= 0
    corners[is_found] = _corners(planes, ids[is_found])
    return Bins(smallest, certain, np.where(is_found, first + ids, -1), np.where(is_found, slacks, np.inf), corners)


def tighter(one: Bins, other: Bins) -> Bins:
    """The nearer of both; the first of equals."""
    nearer = other.least < one.least
    return Bins(
        min(one.smallest, other.smallest), min(one.certain, other.certain),
        np.where(nearer, other.best, one.best), np.where(nearer, other.least, one.least),
        np.where(nearer[:, None, None], other.corners, one.corners),
    )  # fmt: skip


class Reaching(NamedTuple):
    """Planes that are not clear of some points; None for too many."""

    maker: PlaneMaker
    center: NDArray[np.float64]
    corners: NDArray[np.float64]
    margin: float
    most: int

    def of(self, first: int, planes: HalfSpaces) -> Rows | None:
        """Those of a chunk."""
        if not len(planes):
            return _no_rows()
        arrays = planes.local_normals, planes.local_offsets, planes.local_errors
        ids = planes_reaching(*arrays, self.center, self.corners, self.margin, _ALL)
        return self._few(some_rows(first, planes, ids))

    def merged(self, one: Rows, other: Rows | None) -> Rows | None:
        """Those of both."""
        if other is None or not len(one.rows) or not len(other.rows):
            return other if other is None or not len(one.rows) else one
        return self._few(one.joined(other))

    def _few(self, found: Rows) -> Rows | None:
        found = self.maker.heads(found)
        return None if len(found.rows) > self.most else found


class Objecting(NamedTuple):
    """Planes that a point is not certainly inside of; of more than `limit` those it certainly violates most."""

    maker: PlaneMaker
    point: NDArray[np.float64]
    rounding: float
    limit: int
    is_near: bool

    def of(self, first: int, planes: HalfSpaces) -> tuple[Rows, bool]:
        """Those of a chunk, and whether they are the worst of more."""
        arrays = planes.local_normals, planes.local_offsets, planes.local_errors
        ids = np.arange(len(planes))
        if self.is_near and len(planes):
            ids = plane_signs(*arrays, self.point, self.rounding)
        return self._few(some_rows(first, planes, ids), False)

    def merged(self, one: tuple[Rows, bool], other: tuple[Rows, bool]) -> tuple[Rows, bool]:
        """Those of both."""
        return self._few(one[0].joined(other[0]), one[1] or other[1])

    def _few(self, found: Rows, is_many: bool) -> tuple[Rows, bool]:
        found = self.maker.heads(found)
        if len(found.rows) <= self.limit or not self.is_near:
            return found, is_many
        found, is_worst = self.worst(found)
        return found, is_many or is_worst

    def worst(self, found: Rows) -> tuple[Rows, bool]:
        """Of many planes those that are certainly violated most; all of them where none certainly is."""
        planes = self.maker.of_rows(found)
        slack = planes.local_offsets - planes.local_normals @ self.point
        certain = slack < -(planes.local_errors * (np.linalg.norm(self.point) + 1) + 1e-12)
        if not certain.any():
            return found, False
        ids = np.flatnonzero(certain)
        return found.part(np.sort(ids[np.argsort(slack[ids], kind="stable")[: self.limit]])), True


class Alike(NamedTuple):
    """Planes that may be the same as one of a few."""

    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]

    def of(self, first: int, planes: HalfSpaces) -> Rows:
        """Those of a chunk."""
        near = [np.empty(0, np.int64)]
        step = max(1, _PRODUCTS // len(self.offsets))
        for low in range(0, len(planes), step):
            part = slice(low, low + step)
            close = planes.local_normals[part] @ self.normals.T > 1.0 - _ALIKE
            close &= np.abs(planes.local_offsets[part, None] - self.offsets) < _ALIKE
            near.append(low + np.flatnonzero(close.any(axis=1)))
        return some_rows(first, planes, np.concatenate(near))


def _no_rows() -> Rows:
    return Rows(np.empty(0, np.int64), np.empty((0, 3, 3)))


def some_rows(first: int, planes: HalfSpaces, ids: NDArray[np.int64]) -> Rows:
    """Some planes of a part that begins with number `first`."""
    return Rows(first + ids, _corners(planes, ids))


def _corners(planes: HalfSpaces, ids: NDArray[np.int64]) -> NDArray[np.float64]:
    """Corners of facets; 0 of planes given as numbers."""
    three = planes.corner_ids()[ids]
    is_facet = three[:, 0] >= 0
    corners = np.zeros((len(ids), 3, 3))
    corners[is_facet] = planes.vertices[three[is_facet]]
    return corners
