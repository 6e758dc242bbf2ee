"""The half-spaces of a streamed surface: passes over all of them that keep what can matter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.halfspaces.integer_planes import IntegerPlane
from voxkernel.halfspaces.predicates import exact_slacks
from voxkernel.large.chunks import Chunk
from voxkernel.large.passes import Merge, Place
from voxkernel.large.plane_tasks import Alike, Objecting, PlaneMaker, Reaching, Rows, tighter, tightest
from voxkernel.large.surface_reader import SurfaceReader

__all__ = ["OfPlanes", "StreamedPlanes", "Tightest"]

_UNIT = 2.0**-53
_FAR = 2.0**500  # beyond this no rounded sign is trusted
_MOST = 4096  # planes that object and are decided exactly in one go

OfPlanes = Callable[[int, HalfSpaces], Any]


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
        self.maker = PlaneMaker(self.facts.frame, self.n_facet_planes, self._normals, self._offsets, is_cone)
        self.given = self.maker.made(np.empty((0, 3, 3)), np.empty(0, np.int64))
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

    def parts(self, stage: str) -> Iterator[tuple[int, HalfSpaces]]:
        """One pass: the number of the first plane of every chunk, and its planes; those given as numbers last."""
        first = 0
        for facet, chunk in self.surface.chunks(stage):
            planes = self.maker.made(chunk.corners, np.arange(facet, facet + len(chunk.corners)))
            if len(planes):
                yield first, planes
            first += len(planes)
        if len(self.given):
            yield first, self.given

    def folded(self, stage: str, of: OfPlanes, merge: Merge) -> Any:
        """One pass: what `of(first, planes)` makes of all chunks and of the planes given as numbers, merged."""
        found = self.surface.folded(stage, partial(_of_chunk, self.maker, of), merge)
        if found is None or not len(self.given):
            return found
        return merge(found, of(self.n_facet_planes, self.given))

    def rows(self, numbers: NDArray[np.int64]) -> Rows:
        """Look up planes by number, ascending."""
        mine = numbers[numbers < self.n_facet_planes]
        corners = np.zeros((len(numbers), 3, 3))
        if len(mine):
            corners[: len(mine)] = self.surface.take(self.facts.facets_of(mine))
        return Rows(numbers, corners)

    def halfspaces(self, found: Rows) -> HalfSpaces:
        """The half-spaces of some rows, in their order, in the frame and on the lattice of all."""
        facets = self.facts.facets_of(found.rows[found.rows < self.n_facet_planes])
        return self.maker.of_rows(found, facets)

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
        found = self.folded(stage, partial(tightest, point, limit), tighter)
        order = np.argsort(found.best)
        order = order[found.best[order] >= 0]
        return Tightest(found.smallest, found.certain, Rows(found.best[order], found.corners[order]))

    def reaching(
        self, center: NDArray[np.float64], corners: NDArray[np.float64], margin: float, *, most: int, stage: str
    ) -> Rows | None:
        """One pass: planes not clear of local corners about a centre, one of each plane; None for more than `most`."""
        reaching = Reaching(self.maker, center, corners, margin, most)
        return self.folded(stage, reaching.of, reaching.merged)

    def touched_and_violated(
        self, point: Sequence[Fraction | int], *, limit: int = _MOST
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """One pass: split the planes that are not clear of an exact lattice point into touched and violated ones.

        One of each plane. As the function of this name in `halfspaces`: where more than `limit` object, the worst.
        """
        local = self.from_lattice(point)
        is_near = bool(np.abs(local).max() < _FAR)
        rounding = 2 * _UNIT * float(np.linalg.norm(local)) + 1e-300
        objecting = Objecting(self.maker, local, rounding, limit, is_near)
        found, is_many = self.folded("exact", objecting.of, objecting.merged)
        if is_many:
            return np.empty(0, np.int64), objecting.worst(found)[0].rows
        planes = self._remember(found)
        slacks = exact_slacks(planes, range(len(planes)), point)
        signs = np.array([(s > 0) - (s < 0) for s in slacks], np.int64)
        return found.rows[signs == 0], found.rows[signs < 0]

    def first_of_each(self, found: Rows) -> Rows:
        """One pass: the first of all planes that is exactly the same, for each of a few; each once."""
        few = self.halfspaces(found)
        alike = Alike(few.local_normals, few.local_offsets)
        heads = found.joined(self.folded("exact", alike.of, Rows.joined))
        groups = self.halfspaces(heads).coplanar_groups()
        return heads.part(np.unique(groups[np.searchsorted(heads.rows, found.rows)]))


def _of_chunk(maker: PlaneMaker, of: OfPlanes, place: Place, chunk: Chunk) -> Any:
    planes = maker.made(chunk.corners, np.arange(place.facet, place.facet + len(chunk.corners)))
    return of(place.plane, planes)
