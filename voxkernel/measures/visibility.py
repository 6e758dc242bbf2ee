"""How much of a surface is really visible from a point: `visible_fraction`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_points, as_positive
from voxkernel._core import faces_away
from voxkernel._notebook import InNotebooks
from voxkernel.halfspaces import HalfSpaces
from voxkernel.large import StreamedSurface
from voxkernel.large.stream_mesh import reader_of
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.mesh import MeshLike, as_mesh
from voxkernel.mesh.triangles import doubled_areas, triple_products
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.streamed_violation import StreamedWeights
from voxkernel.relaxed.violated_units import violated_units

__all__ = ["VisibleFraction", "visible_fraction", "visible_of_stream"]

_CLOSE = 1e-4  # a hit this close before the sample is the surface itself
_SINGLE = 4e-6  # what single precision can tell apart along a ray


@dataclass(frozen=True, slots=True, repr=False)
class VisibleFraction(InNotebooks):
    """The share of a surface that is visible from a point.

    Attributes
    ----------
    fraction : float
        Share of the area that faces the point and is not hidden behind another part, in [0, 1].
    error : float
        Sampling error of `fraction` that is exceeded with a probability of at most 1 - `confidence`; 0
        where the answer is exact.
    violation : float
        Share of the area that does not face the point: hidden in any case.
    n_samples : int
        Rays cast; 0 where none were needed.
    confidence : float
        Of `error`.
    """

    fraction: float
    error: float
    violation: float
    n_samples: int
    confidence: float

    def __repr__(self) -> str:
        """Name the share and its error."""
        return f"VisibleFraction({self.fraction:.6g} +- {self.error:.2g}, violation={self.violation:.6g})"

    def __float__(self) -> float:
        """Give `fraction`."""
        return self.fraction

    @property
    def hidden(self) -> float:
        """Share of the area that is not seen; at least `violation`."""
        return 1.0 - self.fraction

    @property
    def bounds(self) -> tuple[float, float]:
        """`fraction` less and plus `error`, cut off at 0 and at what faces the point."""
        return max(0.0, self.fraction - self.error), min(1.0 - self.violation, self.fraction + self.error)

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers, ready for JSON."""
        return {
            "fraction": self.fraction,
            "error": self.error,
            "violation": self.violation,
            "n_samples": self.n_samples,
            "confidence": self.confidence,
        }


def visible_fraction(
    surface: MeshLike | StreamedSurface,
    point: ArrayLike,
    *,
    n_samples: int = 100_000,
    confidence: float = 0.999,
    facets: Any = None,
    rng: int | np.random.Generator = 0,
) -> VisibleFraction:
    """Estimate the share of a surface's area that is visible from a point.

    A spot is visible when its facet faces the point, so that the point is on the inner side of the facet, and
    nothing lies between them.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or StreamedSurface
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or a surface of `stream_mesh`.
    point : (3,) array_like
        World coordinates.
    n_samples : int
        Spots looked at, spread evenly over the area that faces the point.
    confidence : float
        Probability with which the stated error holds, in (0, 1).
    facets : int array or bool mask, optional
        Restrict the surface to these facets; the others do not hide anything.
    rng : int or numpy.random.Generator
        Seed or generator of the spots.

    Returns
    -------
    VisibleFraction
        Exactly 1 for a point of the kernel of a surface that bounds a volume once, without casting a ray.

    Raises
    ------
    ImportError
        If rays are needed and Open3D is not there.
    MeshError, MeshReadError, TypeError, ValueError
        If the surface, the point or a number cannot be used.

    Notes
    -----
    What does not face the point is counted exactly (`violation`), so the hidden area is never less. For the
    rest the facets are cut into strata of equal area with one random spot each; the error is Hoeffding's
    bound [1]_, which strata only make safer. Rays are traced in single precision about the point (Open3D,
    Embree): what hides a spot from closer than 1e-4 of the size of the surface does not count.
    Parts of an open surface can hide each other from a point of its kernel. A stream is asked for the rays
    65,536 facets at a time, and the nearest hit of each ray counts: the same spots, the same answer.

    References
    ----------
    .. [1] W. Hoeffding, "Probability inequalities for sums of bounded random variables", J. Amer. Statist.
       Assoc. 58, 1963, doi:10.1080/01621459.1963.10500830, Theorem 2.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> voxkernel.visible_fraction(tetrahedron, [0.1, 0.1, 0.1])
    VisibleFraction(1 +- 0, violation=0)
    """
    if isinstance(surface, StreamedSurface):
        reader = reader_of(surface, facets)
        return visible_of_stream(reader, *_checked(point, n_samples, confidence), rng)
    mesh = as_mesh(surface, facets=facets)
    place, count, level = _checked(point, n_samples, confidence)
    halfspaces = HalfSpaces.from_mesh(mesh)
    missed = int(violated_units(weigh(halfspaces), place[None])[0]) / UNITS
    view = _View(lambda _: (mesh.vertices[mesh.faces],), place)
    return _visible(view, missed, lambda: halfspaces.bounds_volume, count, level, rng)


def visible_of_stream(
    reader: SurfaceReader,
    point: NDArray[np.float64],
    count: int = 100_000,
    level: float = 0.999,
    rng: int | np.random.Generator = 0,
) -> VisibleFraction:
    """Look at a stream: each block of it is asked for all rays, and of each ray the nearest hit is kept."""
    missed = int(StreamedWeights(reader, "area").violated(point[None])[0]) / UNITS
    return _visible(_View(reader.blocks, point), missed, lambda: reader.bounds_volume, count, level, rng)


def _checked(point: ArrayLike, n_samples: int, confidence: float) -> tuple[NDArray[np.float64], int, float]:
    place = as_points("point", np.reshape(np.asarray(point), (1, -1)))[0]
    count = as_depth("n_samples", n_samples, 1, 1 << 30)
    level = as_positive("confidence", confidence)
    if level >= 1.0:
        raise ValueError(f"`confidence` must be below 1; got {level:g}")
    return place, count, level


def _visible(
    view: _View, missed: float, bounds_volume: Callable[[], bool], count: int, level: float, rng: Any
) -> VisibleFraction:
    if missed == 0.0 and bounds_volume() and view.times_around() < 1.5:
        return VisibleFraction(1.0, 0.0, 0.0, 0, level)
    if not view.faces_point():
        return VisibleFraction(0.0, 0.0, missed, 0, level)
    seen = view.share_seen(count, np.random.default_rng(rng))
    error = (1.0 - missed) * sqrt(log(2.0 / (1.0 - level)) / (2.0 * count))
    return VisibleFraction((1.0 - missed) * seen, error, missed, count, level)


class _Block(NamedTuple):
    """Triangles: the number of the first, corners in units of the largest distance, areas that face, their sums."""

    first: int
    corners: NDArray[np.float64]
    areas: NDArray[np.float64]
    ends: NDArray[np.float64]  # before the first, and behind each


class _View:
    """A surface as a point sees it, block by block; a surface in memory is one block."""

    def __init__(self, blocks: Callable[[str], Iterable[NDArray[np.float64]]], point: NDArray[np.float64]) -> None:
        self._blocks, self._point = blocks, point
        square = max(float(((corners - point) ** 2).sum(axis=2).max()) for corners in blocks("view"))
        self._reach = sqrt(square) or 1.0
        self._total, self._last = 0.0, -1  # area that faces the point, and the last triangle that has some
        self._extent = np.zeros(3)
        self._only: _Block | None = None  # kept where there is no other

    def _scaled(self, stage: str) -> Iterator[NDArray[np.float64]]:
        """Corners of the triangles seen from the point, (m, 3, 3), in units of the largest distance."""
        if self._only is not None:
            return iter((self._only.corners,))
        return ((corners - self._point) / self._reach for corners in self._blocks(stage))

    def times_around(self) -> float:
        """Sum of the solid angles of the triangles over 4 pi: how often the surface goes around the point.

        A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30, 1983.
        """
        total = 0.0
        for corners in self._scaled("view"):
            a, b, c = np.moveaxis(corners, 1, 0)
            la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
            volume = triple_products(a, b, c)
            ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
            total += float(np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum())
        return total / (2.0 * np.pi)

    def faces_point(self) -> bool:
        """Whether anything faces the point; how much does, and the size of all, are kept."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for block in self._facing("view"):
            self._only = block if block.first == 0 else None
            self._total = float(block.ends[-1])
            has_area = np.flatnonzero(block.areas)
            self._last = block.first + int(has_area[-1]) if len(has_area) else self._last
            points = block.corners.reshape(-1, 3)
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
        self._extent = high - low
        return self._total > 0.0

    def _facing(self, stage: str) -> Iterator[_Block]:
        """Blocks with the areas that face the point, summed as if all were summed in one go."""
        first, total = 0, 0.0
        for given in self._blocks(stage):
            corners = (given - self._point) / self._reach
            areas = 0.5 * doubled_areas(corners)
            points = np.ascontiguousarray(given).reshape(-1, 3)
            areas[faces_away(points, np.arange(len(points)).reshape(-1, 3), self._point)] = 0.0
            ends = np.cumsum(np.concatenate([[total], areas]))
            yield _Block(first, corners, areas, ends)
            first, total = first + len(given), float(ends[-1])

    def share_seen(self, count: int, rng: np.random.Generator) -> float:
        """Cast a ray to one random spot in each of `count` strata of equal area."""
        from voxkernel._open3d import open3d, ray_scene

        o3d = open3d()
        ids, corners = self._drawn((np.arange(count) + rng.random(count)) * (self._total / count))
        u, v = rng.random((2, count))
        beyond = u + v > 1.0
        u[beyond], v[beyond] = 1.0 - u[beyond], 1.0 - v[beyond]
        a, b, c = np.moveaxis(corners, 1, 0)
        rays = np.zeros((count, 6), np.float32)
        rays[:, 3:] = a + u[:, None] * (b - a) + v[:, None] * (c - a)
        tensor, first = o3d.core.Tensor(rays), 0
        distance, nearest = np.full(count, np.inf, np.float32), np.full(count, -1)
        for block in self._scaled("rays"):
            scene = ray_scene(block.reshape(-1, 3), np.arange(block.size // 3).reshape(-1, 3))
            hits = scene.cast_rays(tensor)
            t, triangle = hits["t_hit"].numpy(), hits["primitive_ids"].numpy()
            is_nearer = t < distance
            distance[is_nearer], nearest[is_nearer] = t[is_nearer], first + triangle[is_nearer].astype(np.int64)
            first += len(block)
        # The direction is the spot itself, so the spot is at 1.
        close = max(_SINGLE, _CLOSE * min(1.0, float(self._extent.max())))
        seen = (distance >= 1.0 - close) | (nearest == ids)
        return float(np.count_nonzero(seen)) / count

    def _drawn(self, at: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The triangles where sums of areas reach some numbers, which ascend, and their corners."""
        ids, corners = np.zeros(len(at), np.int64), np.empty((len(at), 3, 3))
        for block in self._facing("spots") if self._only is None else (self._only,):
            low, high = np.searchsorted(at, block.ends[[0, -1]])
            if block.first <= self._last < block.first + len(block.corners):
                high = len(at)
            local = np.searchsorted(block.ends[1:], at[low:high], side="right")
            ids[low:high] = np.minimum(block.first + local, self._last)
            corners[low:high] = block.corners[ids[low:high] - block.first]
        return ids, corners
