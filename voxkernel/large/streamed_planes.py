"""The half-spaces of a streamed surface: passes over all of them that keep what can matter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import N_BINS, plane_signs, planes_reaching, tightest_by_direction
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.halfspaces.integer_planes import IntegerPlane
from voxkernel.halfspaces.predicates import exact_slacks
from voxkernel.large.surface_reader import SurfaceReader

__all__ = ["Rows", "StreamedPlanes", "Tightest", "some_rows"]

_UNIT = 2.0**-53
_FAR = 2.0**500  # beyond this no rounded sign is trusted
_ALL = np.empty(0, np.bool_)  # of the planes of a part
_MOST = 4096  # planes that object and are decided exactly in one go
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


class Tightest(NamedTuple):
    """The smallest slack at a point, the smallest certain one, and the tightest plane of each direction."""

    smallest: float
    certain: float
    found: Rows


class StreamedPlanes:
    """Half-spaces of the facets of a stream, numbered as in memory, and of a few planes given as numbers.

    Passes read the stream; all of them come to what the functions of `halfspaces` come to in memory. `is_cone` moves
    the planes of the facets to the origin.
    """

    def __init__(
        self,
        surface: SurfaceReader,
        normals: NDArray[np.float64] | None = None,
        offsets: NDArray[np.float64] | None = None,
        *,
        is_cone: bool = False,
    ) -> None:
        self.surface, self.is_cone = surface, is_cone
        self.facts = surface.facts()
        self.n_facet_planes = self.facts.n_planes
        self._normals = np.empty((0, 3)) if normals is None else normals
        self._offsets = np.empty(0) if offsets is None else offsets
        self.given = self._made(np.empty((0, 3, 3)), np.empty(0, np.int64))
        if len(self._offsets):
            self.given = self.given.with_planes(self._normals, self._offsets)
        self._integers: dict[int, IntegerPlane] = {}

    def __len__(self) -> int:
        """Number of half-spaces."""
        return self.n_facet_planes + len(self.given)

    def with_planes(self, normals: NDArray[np.float64], offsets: NDArray[np.float64]) -> StreamedPlanes:
        """The same with more planes given as numbers."""
        more = np.concatenate([self._normals, normals]), np.concatenate([self._offsets, offsets])
        return StreamedPlanes(self.surface, *more, is_cone=self.is_cone)

    def in_domain(self, domain: Domain | None) -> StreamedPlanes:
        """The same with the planes of a domain."""
        return self if domain is None else self.with_planes(domain.normals, domain.offsets)

    @property
    def given_rows(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Normals and offsets of the planes given as numbers; None where there are none."""
        return (self._normals, self._offsets) if len(self._offsets) else None

    @property
    def scale(self) -> float:
        """Of the local frame."""
        return self.given.scale

    @property
    def lattice_unit(self) -> int:
        """Lattice units per world unit."""
        return self.given.lattice_unit

    def from_lattice(self, point: Sequence[Fraction | int]) -> NDArray[np.float64]:
        """Round an exact lattice point to local coordinates."""
        return self.given.from_lattice(point)

    def to_lattice(self, local: NDArray[np.float64]) -> tuple[Fraction, Fraction, Fraction]:
        """Map a local double point to exact lattice coordinates."""
        return self.given.to_lattice(local)

    def _made(self, corners: NDArray[np.float64], facets: NDArray[np.int64]) -> HalfSpaces:
        planes = HalfSpaces._in_frame(corners, facets, self.facts.frame)
        return planes.recession_cone() if self.is_cone else planes

    def parts(self, stage: str) -> Iterator[tuple[int, HalfSpaces]]:
        """One pass: the number of the first plane of every chunk, and its planes; those given as numbers last."""
        first = 0
        for facet, chunk in self.surface.chunks(stage):
            planes = self._made(chunk.corners, np.arange(facet, facet + len(chunk.corners)))
            if len(planes):
                yield first, planes
            first += len(planes)
        if len(self.given):
            yield first, self.given

    def rows(self, numbers: NDArray[np.int64]) -> Rows:
        """Look up planes by number, ascending."""
        mine = numbers[numbers < self.n_facet_planes]
        corners = np.zeros((len(numbers), 3, 3))
        if len(mine):
            corners[: len(mine)] = self.surface.take(self.facts.facets_of(mine))
        return Rows(numbers, corners)

    def halfspaces(self, found: Rows) -> HalfSpaces:
        """The half-spaces of some rows, in their order, in the frame and on the lattice of all."""
        is_facet = found.rows < self.n_facet_planes
        facets = self.facts.facets_of(found.rows[is_facet])
        planes = self._made(found.corners[is_facet], facets)
        n = len(planes)
        if not len(self.given):
            return planes
        planes = planes.with_planes(self._normals, self._offsets)
        return planes.select(np.where(is_facet, np.cumsum(is_facet) - 1, n + found.rows - self.n_facet_planes))

    def integer_planes(self, ids: NDArray[Any] | Sequence[int]) -> list[IntegerPlane]:
        """Planes by number, exactly."""
        missing = np.unique([int(i) for i in ids if int(i) not in self._integers]).astype(np.int64)
        if len(missing):
            self._remember(self.rows(missing))
        return [self._integers[int(i)] for i in ids]

    def _remember(self, found: Rows) -> HalfSpaces:
        planes = self.halfspaces(found)
        exact = planes.integer_planes(range(len(planes)))
        self._integers |= zip(found.rows.tolist(), exact, strict=True)
        return planes

    def tightest(self, point: NDArray[np.float64], limit: float = np.inf, *, stage: str = "search") -> Tightest:
        """One pass: the plane nearest to a local point of each direction, of those nearer than `limit`."""
        best, least = np.full(N_BINS, -1), np.full(N_BINS, np.inf)
        corners = np.zeros((N_BINS, 3, 3))
        smallest = certain = np.inf
        ids, slacks = np.empty(N_BINS, np.int64), np.empty(N_BINS)
        for first, planes in self.parts(stage):
            arrays = planes.local_normals, planes.local_offsets, planes.local_errors
            low, safe, _ = tightest_by_direction(*arrays, point, limit, ids, slacks)
            nearer = slacks < least
            if nearer.any():
                best[nearer], least[nearer] = first + ids[nearer], slacks[nearer]
                corners[nearer] = _corners(planes, ids[nearer])
            smallest, certain = min(smallest, low), min(certain, safe)
        order = np.argsort(best)
        order = order[best[order] >= 0]
        return Tightest(smallest, certain, Rows(best[order], corners[order]))

    def reaching(
        self, center: NDArray[np.float64], corners: NDArray[np.float64], margin: float, *, most: int, stage: str
    ) -> Rows | None:
        """One pass: planes not clear of local corners about a centre, one of each plane; None for more than `most`."""
        found, fresh = _no_rows(), _no_rows()
        for first, planes in self.parts(stage):
            arrays = planes.local_normals, planes.local_offsets, planes.local_errors
            ids = planes_reaching(*arrays, center, corners, margin, _ALL)
            if not len(ids):
                continue
            fresh = fresh.joined(self.heads(some_rows(first, planes, ids)))
            if len(fresh.rows) > max(_MOST, len(found.rows)):
                found, fresh = self.heads(found.joined(fresh)), _no_rows()
                if len(found.rows) > most:
                    return None
        found = self.heads(found.joined(fresh))
        return None if len(found.rows) > most else found

    def touched_and_violated(
        self, point: Sequence[Fraction | int], *, limit: int = _MOST
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """One pass: split the planes that are not clear of an exact lattice point into touched and violated ones.

        One of each plane. As the function of this name in `halfspaces`: where more than `limit` object, the worst.
        """
        local = self.from_lattice(point)
        is_near = bool(np.abs(local).max() < _FAR)
        rounding = 2 * _UNIT * float(np.linalg.norm(local)) + 1e-300
        found, is_many = _no_rows(), False
        for first, planes in self.parts("exact"):
            arrays = planes.local_normals, planes.local_offsets, planes.local_errors
            ids = plane_signs(*arrays, local, rounding) if is_near else np.arange(len(planes))
            if not len(ids):
                continue
            found = self.heads(found.joined(some_rows(first, planes, ids)))
            if len(found.rows) > limit and is_near:
                found, is_worst = self._worst(found, local, limit)
                is_many = is_many or is_worst
        if is_many:
            return np.empty(0, np.int64), self._worst(found, local, limit)[0].rows
        planes = self._remember(found)
        slacks = exact_slacks(planes, range(len(planes)), point)
        signs = np.array([(s > 0) - (s < 0) for s in slacks], np.int64)
        return found.rows[signs == 0], found.rows[signs < 0]

    def _worst(self, found: Rows, local: NDArray[np.float64], limit: int) -> tuple[Rows, bool]:
        """Of many planes those that a point certainly violates most; all of them where it certainly violates none."""
        planes = self.halfspaces(found)
        slack = planes.local_offsets - planes.local_normals @ local
        certain = slack < -(planes.local_errors * (np.linalg.norm(local) + 1) + 1e-12)
        if not certain.any():
            return found, False
        ids = np.flatnonzero(certain)
        return found.part(np.sort(ids[np.argsort(slack[ids], kind="stable")[:limit]])), True

    def first_of_each(self, found: Rows) -> Rows:
        """One pass: the first of all planes that is exactly the same, for each of a few; each once."""
        few = self.halfspaces(found)
        heads = found
        step = max(1, _PRODUCTS // len(few))
        for first, planes in self.parts("exact"):
            near: list[NDArray[np.int64]] = []
            for low in range(0, len(planes), step):
                part = slice(low, low + step)
                close = planes.local_normals[part] @ few.local_normals.T > 1.0 - _ALIKE
                close &= np.abs(planes.local_offsets[part, None] - few.local_offsets) < _ALIKE
                near.append(low + np.flatnonzero(close.any(axis=1)))
            ids = np.concatenate(near)
            if len(ids):
                heads = heads.joined(some_rows(first, planes, ids))
        groups = self.halfspaces(heads).coplanar_groups()
        return heads.part(np.unique(groups[np.searchsorted(heads.rows, found.rows)]))

    def heads(self, every: Rows) -> Rows:
        """One of each plane: the first."""
        groups = self.halfspaces(every).coplanar_groups()
        return every.part(groups == np.arange(len(groups)))


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
