"""Passes over a surface that is read in chunks, and what they find out about it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from functools import partial
from operator import or_
from time import perf_counter
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import coordinate_range, facet_planes
from voxkernel._notebook import InNotebooks
from voxkernel.errors import MeshError
from voxkernel.halfspaces.area_moments import BLOCK, AreaMoments, moments_of_blocks
from voxkernel.halfspaces.domain import (
    BALL_FACTOR,
    Domain,
    as_domain,
    bounds_domain,
    framed_ball,
    points_hull,
)
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.halfspaces.integer_planes import lattice_bits, triangle_plane
from voxkernel.halfspaces.local_frame import LocalFrame, span_space
from voxkernel.halfspaces.rational_program import rank_of
from voxkernel.halfspaces.surface_arguments import DefaultDomain
from voxkernel.large.chunks import Chunk, Source, check_finite
from voxkernel.large.edge_sums import EdgeSums
from voxkernel.large.passes import HERE, Merge, Part, Place, Task, Workers
from voxkernel.large.sorted_edges import edges_cancel
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.files import Polygons, merge_equal_corners

__all__ = ["StreamFacts", "StreamProgress", "SurfaceReader"]

_FEW = 4096  # facets of a chunk whose normals span space, as a rule, where those of all do


@dataclass(frozen=True, slots=True)
class StreamProgress(InNotebooks):
    """Where the work on a stream is.

    Attributes
    ----------
    stage : str
        What the pass is for.
    done : int
        Facets read in this pass.
    total : int or None
        Facets there are; None until the first pass has ended, where no file says so.
    seconds : float
        Since the pass began.
    note : str
        What a user should know; "" as a rule.
    """

    stage: str
    done: int
    total: int | None
    seconds: float
    note: str = ""

    def __str__(self) -> str:
        """Say it in a line."""
        of = "" if self.total is None else f" of {self.total:,}"
        return self.note or f"{self.stage}: {self.done:,}{of} facets, {self.seconds:.1f} s"


class StreamFacts(NamedTuple):
    """What one pass finds out: numbers of facets, the ids of those without area, the bounding box, the local frame."""

    n_facets: int
    degenerate: NDArray[np.int64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    frame: LocalFrame

    @property
    def n_planes(self) -> int:
        """Facets with an area."""
        return self.n_facets - len(self.degenerate)

    def planes_before(self, facet: int) -> int:
        """How many facets with an area come before one."""
        return facet - int(np.searchsorted(self.degenerate, facet))

    def facets_of(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The facets of some planes: those without area have none."""
        before = self.degenerate - np.arange(len(self.degenerate))
        return rows + np.searchsorted(before, rows, side="right")


class SurfaceReader:
    """Reads triangles `chunk_facets` at a time, as often as it takes; what it finds out is kept."""

    def __init__(
        self,
        source: Source,
        chunk_facets: int,
        progress: Callable[[StreamProgress], object] | None,
        *,
        is_sorted: bool = False,
        folder: str | os.PathLike[str] | None = None,
    ) -> None:
        self.chunk_facets = chunk_facets
        self._source, self._progress = source, progress
        self._is_sorted, self._folder = is_sorted, folder
        self._kept: dict[str, object] = {}
        self._workers: Workers = HERE

    def by(self, workers: Workers) -> SurfaceReader:
        """The same surface with others that make its passes; what is found out is kept for both."""
        reader = copy(self)
        reader._workers = workers
        return reader

    @property
    def name(self) -> str:
        """Where it comes from, for messages."""
        return self._source.name

    @property
    def n_stored(self) -> int | None:
        """Facets, if that is known before the first pass."""
        return self._source.n_facets

    def facts(self) -> StreamFacts:
        """What the first pass finds out; kept."""
        if "facts" not in self._kept:
            self._kept["facts"] = self._read_facts()
        found = self._kept["facts"]
        assert isinstance(found, StreamFacts)
        return found

    def folded(self, stage: str, task: Task, merge: Merge) -> Any:
        """One pass: what `task` makes of every chunk, merged, neighbours first; see `passes`."""
        return self._workers.folded(self._parts(stage), task, merge)

    def chunks(self, stage: str) -> Iterator[tuple[int, Chunk]]:
        """Read all of it once, here: the first facet of every chunk, and the chunk."""
        for place, piece in self._parts(stage):
            yield place.facet, piece.read()

    def _parts(self, stage: str) -> Iterator[Part]:
        facts = self._kept.get("facts")
        known = facts if isinstance(facts, StreamFacts) else None
        total = self._source.n_facets if known is None else known.n_facets
        start, done, mark = perf_counter(), 0, 0
        for number, piece in enumerate(self._source.pieces(self.chunk_facets)):
            yield Part(Place(number, done, done if known is None else known.planes_before(done)), piece)
            done += piece.n_facets
            if isinstance(piece, Chunk) and piece.n_facets:  # files are watched instead
                mark = crc32(piece.corners[0].tobytes(), crc32(piece.corners[-1].tobytes(), mark))
            self._tell(StreamProgress(stage, done, total, perf_counter() - start))
        if known is not None and done != known.n_facets:
            raise MeshError(
                f"`source` must give the same facets in every pass; got {done} after {known.n_facets} "
                "(give a function that starts anew)"
            )
        if self._kept.setdefault("mark", mark) != mark:
            raise MeshError("`source` must give the same facets in every pass; got others than in the first")

    def note(self, stage: str, text: str) -> None:
        """Tell the caller something about the surface."""
        n = self.facts().n_facets
        self._tell(StreamProgress(stage, n, n, 0.0, text))

    def _tell(self, state: StreamProgress) -> None:
        if self._progress is not None:
            self._progress(state)

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Corners (k, 3, 3) of some facets, without a pass where the source can."""
        found = self._source.take(facets)
        if found is None:
            order = np.argsort(facets, kind="stable")
            wanted = facets[order]
            found = np.empty((len(facets), 3, 3))
            for first, chunk in self.chunks("sample"):
                low, high = np.searchsorted(wanted, [first, first + len(chunk.corners)])
                found[order[low:high]] = chunk.corners[wanted[low:high] - first]
        return found

    def blocks(self, stage: str) -> Iterator[NDArray[np.float64]]:
        """Corners in blocks that do not depend on the chunks, so that sums do not."""
        held: list[NDArray[np.float64]] = []
        n = 0
        for _, chunk in self.chunks(stage):
            corners = chunk.corners
            while n + len(corners) >= BLOCK:
                yield np.concatenate([*held, corners[: BLOCK - n]])
                corners = corners[BLOCK - n :]
                held, n = [], 0
            if len(corners):
                held.append(corners)
                n += len(corners)
        if n:
            yield np.concatenate(held)

    def _read_facts(self) -> StreamFacts:
        """Bounding box, smallest magnitude, and which facets have no area, decided exactly."""
        found = self.folded("frame", partial(_look, self._source.name), _both_looks)
        if found is None or not found.n_facets:
            raise MeshError(f"{self._source.name} must hold facets; got none")
        n, ids = found.n_facets, found.degenerate
        if len(ids) == n:
            raise MeshError(f"{self._source.name} must have a facet with positive area; got {n} facets without area")
        return StreamFacts(n, ids, found.low, found.high, LocalFrame.of_range(found.low, found.high, found.smallest))

    @property
    def bounds_volume(self) -> bool:
        """Whether the surface is closed and encloses a volume; one pass at first use, kept.

        Notes
        -----
        A closed surface is never taken for an open one. The other way round it may happen with a probability of
        about 2**-128: hashes of edges, added one way and taken off the other, must cancel by chance.
        """
        if "closed" not in self._kept:
            self._kept["closed"] = self._read_closed()
        return bool(self._kept["closed"])

    @property
    def is_known_to_bound_volume(self) -> bool:
        """The same, without a pass: False where nobody has asked yet."""
        return bool(self._kept.get("closed", False))

    def _read_closed(self) -> bool:
        frame = self.facts().frame
        if self._is_sorted:
            cancels = edges_cancel(lambda: (chunk for _, chunk in self.chunks("closed")), self._folder)
            spans = cancels and self.folded("closed", partial(_all_span, frame), or_)
            return cancels and (spans or rank_of(self._exact_normals()) == 3)
        sums, spans = self.folded("closed", partial(_edges, frame), _both_edges)
        if not sums.is_zero or spans:
            return sums.is_zero
        return self.folded("closed", partial(_all_span, frame), or_) or rank_of(self._exact_normals()) == 3

    def _exact_normals(self) -> Iterator[tuple[int, int, int]]:
        for _, chunk in self.chunks("closed"):
            points = chunk.corners.reshape(-1, 3)
            for row in np.arange(len(points)).reshape(-1, 3):
                yield triangle_plane(points, row, self.facts().frame.bits)[:3]

    def moments(self) -> AreaMoments:
        """Area, centroid and principal axes, by a pass; kept."""
        if "moments" not in self._kept:
            facts = self.facts()
            blocks = ((c.reshape(-1, 3), np.arange(3 * len(c)).reshape(-1, 3)) for c in self.blocks("frame"))
            self._kept["moments"] = moments_of_blocks(blocks, facts.low, facts.high)
        found = self._kept["moments"]
        assert isinstance(found, AreaMoments)
        return found

    def ball(self) -> Domain:
        """The default domain of open surfaces, by two passes; kept."""
        if "ball" not in self._kept:
            moments = self.moments()
            reach = 0.0
            for _, chunk in self.chunks("domain"):
                square = ((chunk.corners.reshape(-1, 3) - moments.centroid) ** 2).sum(axis=1).max()
                reach = max(reach, float(np.sqrt(square)))
            self._kept["ball"] = framed_ball(moments.centroid, moments.axes(moments.spread), BALL_FACTOR * reach)
        found = self._kept["ball"]
        assert isinstance(found, Domain)
        return found

    def box(self) -> Domain:
        """The bounding box as a domain."""
        facts = self.facts()
        return bounds_domain(facts.low, facts.high)

    def hull(self) -> Domain:
        """The convex hull as a domain, from the hulls of the chunks; kept."""
        if "hull" not in self._kept:
            points = np.empty((0, 3))
            for _, chunk in self.chunks("domain"):
                points = _corners_of_hull(np.concatenate([points, chunk.corners.reshape(-1, 3)]))
            self._kept["hull"] = points_hull(points)
        found = self._kept["hull"]
        assert isinstance(found, Domain)
        return found

    def domain(self, given: Any, default: DefaultDomain) -> Domain | None:
        """Turn a `domain` argument into a domain, with the default of a row of the table; None is everywhere."""
        makers = {"ball": self.ball, "hull": self.hull, "box": self.box}
        if given is None:
            given = (default.closed if self.bounds_volume else default.opened) or None
        if isinstance(given, str) and given in makers:
            return makers[given]()
        return as_domain(given, None)

    def to_mesh(self) -> TriangleMesh:
        """Read all of it into memory."""
        parts = [chunk for _, chunk in self.chunks("memory")]
        corners = np.concatenate([part.corners for part in parts]).reshape(-1, 3)
        if all(part.ids is not None for part in parts):
            ids = np.concatenate([part.ids for part in parts if part.ids is not None])
            used, faces = np.unique(ids, return_inverse=True)
            vertices = np.empty((len(used), 3))
            vertices[faces.reshape(-1)] = corners
            return TriangleMesh.from_triangles(vertices, faces.reshape(-1, 3), source=self.name)
        n = len(corners)
        soup = merge_equal_corners(Polygons(corners, np.arange(n), np.full(n // 3, 3)))
        return TriangleMesh.from_triangles(soup.vertices, soup.flat.reshape(-1, 3), source=self.name)


class _Look(NamedTuple):
    """What a look at some facets says: how many, the ids of those without area, box and smallest magnitude."""

    n_facets: int
    degenerate: NDArray[np.int64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    smallest: float


def _look(name: str, place: Place, chunk: Chunk) -> _Look:
    check_finite(name, place.number, place.facet, chunk.corners)
    points = chunk.corners.reshape(-1, 3)
    ids = np.arange(len(points)).reshape(-1, 3)
    if not len(ids):
        return _Look(0, np.empty(0, np.int64), np.full(3, np.inf), np.full(3, -np.inf), np.inf)
    low, high, smallest = coordinate_range(points, ids)
    return _Look(len(ids), place.facet + _without_area(points, ids, low, high), low, high, smallest)


def _both_looks(first: _Look, second: _Look) -> _Look:
    degenerate = np.concatenate([first.degenerate, second.degenerate])
    low, high = np.minimum(first.low, second.low), np.maximum(first.high, second.high)
    return _Look(first.n_facets + second.n_facets, degenerate, low, high, min(first.smallest, second.smallest))


def _edges(frame: LocalFrame, _: Place, chunk: Chunk) -> tuple[EdgeSums, bool]:
    """Sums over edges, and whether the normals of a few facets certainly span space."""
    sums = EdgeSums()
    sums.add(chunk)
    return sums, _span(chunk.corners[:: max(1, len(chunk.corners) // _FEW)], frame)


def _all_span(frame: LocalFrame, _: Place, chunk: Chunk) -> bool:
    return _span(chunk.corners, frame)


def _span(corners: NDArray[np.float64], frame: LocalFrame) -> bool:
    normals = HalfSpaces._in_frame(corners, np.arange(len(corners)), frame).local_normals
    return len(normals) > 0 and span_space(normals, ())


def _both_edges(first: tuple[EdgeSums, bool], second: tuple[EdgeSums, bool]) -> tuple[EdgeSums, bool]:
    return first[0].joined(second[0]), first[1] or second[1]


def _without_area(
    points: NDArray[np.float64], ids: NDArray[np.int64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Triangles whose corners lie on a line, in no frame but their own."""
    n = len(ids)
    normals, offsets, areas, errors = np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)
    span = float((high - low).max())
    unit = 2.0 ** -np.frexp(span)[1] if 1e-290 < span < 1e290 else 1.0
    with np.errstate(over="ignore"):
        open_ones = facet_planes(points, ids, low, unit, normals, offsets, areas, errors)
    if open_ones:
        for i in np.flatnonzero(errors == -1.0):
            bits = lattice_bits(points[ids[i]])
            if not any(triangle_plane(points, ids[i], bits)[:3]):
                errors[i] = -2.0
    return np.flatnonzero(errors == -2.0)


def _corners_of_hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points without those inside their hull; all of them, each once, where the hull is flat."""
    from scipy.spatial import ConvexHull, QhullError

    different = np.unique(points, axis=0)
    try:
        return different[ConvexHull(different).vertices]
    except (QhullError, ValueError):
        return different
