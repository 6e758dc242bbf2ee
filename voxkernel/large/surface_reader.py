"""Passes over a surface that is read in chunks, and what they find out about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import coordinate_range, facet_planes
from voxkernel._notebook import InNotebooks
from voxkernel.errors import MeshError
from voxkernel.halfspaces.area_moments import BLOCK, area_frame
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
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.files import Polygons, merge_equal_corners

__all__ = ["StreamFacts", "StreamProgress", "SurfaceReader"]


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

    def facets_of(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The facets of some planes: those without area have none."""
        before = self.degenerate - np.arange(len(self.degenerate))
        return rows + np.searchsorted(before, rows, side="right")


class SurfaceReader:
    """Reads triangles `chunk_facets` at a time, as often as it takes; what it finds out is kept."""

    def __init__(
        self, source: Source, chunk_facets: int, progress: Callable[[StreamProgress], object] | None
    ) -> None:
        self.chunk_facets = chunk_facets
        self._source, self._progress = source, progress
        self._kept: dict[str, object] = {}

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

    def chunks(self, stage: str) -> Iterator[tuple[int, Chunk]]:
        """Read all of it once: the first facet of every chunk, and the chunk."""
        facts = self._kept.get("facts")
        total = facts.n_facets if isinstance(facts, StreamFacts) else self._source.n_facets
        start, done = perf_counter(), 0
        for chunk in self._source.chunks(self.chunk_facets):
            yield done, chunk
            done += len(chunk.corners)
            self._tell(StreamProgress(stage, done, total, perf_counter() - start))
        if isinstance(facts, StreamFacts) and done != facts.n_facets:
            raise MeshError(
                f"`source` must give the same facets in every pass; got {done} after {facts.n_facets} "
                "(give a function that starts anew)"
            )

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
        low, high, smallest = np.full(3, np.inf), np.full(3, -np.inf), np.inf
        degenerate: list[NDArray[np.int64]] = []
        n = 0
        for number, (first, chunk) in enumerate(self.chunks("frame")):
            check_finite(self._source.name, number, first, chunk.corners)
            points = chunk.corners.reshape(-1, 3)
            ids = np.arange(len(points)).reshape(-1, 3)
            lowest, highest, least = coordinate_range(points, ids)
            low, high, smallest = np.minimum(low, lowest), np.maximum(high, highest), min(smallest, least)
            degenerate.append(first + _without_area(points, ids, lowest, highest))
            n += len(ids)
        if not n:
            raise MeshError(f"{self._source.name} must hold facets; got none")
        ids = np.concatenate(degenerate)
        if len(ids) == n:
            raise MeshError(f"{self._source.name} must have a facet with positive area; got {n} facets without area")
        return StreamFacts(n, ids, low, high, LocalFrame.of_range(low, high, smallest))

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
        sums, frame = EdgeSums(), self.facts().frame
        spans = False
        for _, chunk in self.chunks("closed"):
            sums.add(chunk)
            if not spans:
                normals = HalfSpaces._in_frame(chunk.corners, np.arange(len(chunk.corners)), frame).local_normals
                spans = len(normals) > 0 and span_space(normals, ())
        return sums.is_zero and (spans or rank_of(self._exact_normals()) == 3)

    def _exact_normals(self) -> Iterator[tuple[int, int, int]]:
        for _, chunk in self.chunks("closed"):
            points = chunk.corners.reshape(-1, 3)
            for row in np.arange(len(points)).reshape(-1, 3):
                yield triangle_plane(points, row, self.facts().frame.bits)[:3]

    def ball(self) -> Domain:
        """The default domain of open surfaces, by four passes; kept."""
        if "ball" not in self._kept:
            centroid, frame = area_frame(lambda: self.blocks("domain"))
            reach = 0.0
            for _, chunk in self.chunks("domain"):
                square = ((chunk.corners.reshape(-1, 3) - centroid) ** 2).sum(axis=1).max()
                reach = max(reach, float(np.sqrt(square)))
            self._kept["ball"] = framed_ball(centroid, frame, BALL_FACTOR * reach)
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
