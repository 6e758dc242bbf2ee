"""Solid kernels in floating point: cull, take the dual hull once, read off faces and moments."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import (
    N_BINS,
    clipped_polyhedron,
    consistent_turns,
    dual_faces,
    moments,
    planes_reaching,
    solid_angle,
    tightest_by_direction,
)
from voxkernel._frozen import Frozen
from voxkernel.exact.convexity import edge_convexity_of
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh.triangles import doubled_normals

__all__ = [
    "DualHull",
    "Polyhedron",
    "Reach",
    "convex_surface",
    "polyhedron_around",
    "polyhedron_moments",
    "polyhedron_of_duals",
    "reach_of",
    "relevant_rows",
]

_CULL_ABOVE = 3000
_FEW = 256
_LONG_HULL = 20_000
_FIRST_BOX = 4.0
_LAST_BOX = 2.0**28


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Polyhedron(Frozen):
    """A bounded convex polyhedron: vertices relative to `center`, rings of vertex ids, row of each ring.

    `center` and `vertices` are in local coordinates; `start` and `ring` list the polygons.
    """

    center: NDArray[np.float64]
    vertices: NDArray[np.float64]
    start: NDArray[np.int64]
    ring: NDArray[np.int64]
    rows: NDArray[np.int64]

    def __post_init__(self) -> None:
        """Nothing to freeze: it never leaves this folder, and a small kernel would take a tenth longer."""

    @property
    def extent(self) -> float:
        """Largest distance of a vertex from the centre."""
        return float(np.sqrt((self.vertices**2).sum(axis=1).max()))


def polyhedron_around(planes: HalfSpaces, point: NDArray[np.float64]) -> Polyhedron | None:
    """Intersect half-spaces about a local point strictly inside them.

    Returns None where Qhull gives up or the polyhedron is unbounded.

    Notes
    -----
    A few half-spaces cut a cube, one after the other. For many, the hull of the dual points n / (d - n . x) is
    computed once (Qhull, through SciPy); a triangle of it is a vertex, a point of it a face. A cube far
    away closes what is open.
    """
    normals = planes.local_normals
    slacks = planes.local_offsets - normals @ point
    if slacks.min() <= 0.0:
        return None
    if len(slacks) <= _FEW:
        vertices, start, ring, rows, is_closed, is_sound = clipped_polyhedron(normals, slacks, 2 * _FIRST_BOX)
        if is_closed and is_sound:
            return Polyhedron(point.copy(), vertices, start, ring, rows)
    duals = normals / slacks[:, None]
    box = _FIRST_BOX
    while box <= _LAST_BOX:
        found = polyhedron_of_duals(duals, _CUBE / (2 * box - _CUBE @ point)[:, None])
        if found is None:
            return None
        if found.is_closed:
            return Polyhedron(point.copy(), found.vertices, found.start, found.ring, found.rows)
        box *= 256.0
    return None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DualHull(Frozen):
    """What the hull of dual points says of a polyhedron about the origin; not closed where the closing shows."""

    vertices: NDArray[np.float64]
    start: NDArray[np.int64]
    ring: NDArray[np.int64]
    rows: NDArray[np.int64]
    is_closed: bool


def polyhedron_of_duals(duals: NDArray[np.float64], closing: NDArray[np.float64]) -> DualHull | None:
    """Read the polyhedron { y : duals . y <= 1, closing . y <= 1 } off one convex hull; None where Qhull gives up."""
    points = np.concatenate([duals, closing])
    hull = _convex_hull(points)
    if hull is None:
        return None
    equations = hull.equations
    if equations[:, 3].max() >= 0.0:
        return None
    if (hull.simplices >= len(duals)).any():
        nothing = np.empty(0, np.int64)
        return DualHull(np.empty((0, 3)), nothing, nothing, nothing, False)
    # Triangles of one hull facet share their equation bit for bit: one vertex.
    order = np.lexsort(equations.T)
    ordered = equations[order]
    fresh = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    vertex_ids = np.empty(len(order), np.int64)
    vertex_ids[order] = np.cumsum(fresh) - 1
    unique = ordered[fresh]
    side = np.einsum("ij,ij->i", doubled_normals(points[hull.simplices]), equations[:, :3])
    largest = int(np.abs(side).argmax())
    simplices = hull.simplices.astype(np.int64)
    alike, is_connected = consistent_turns(simplices, hull.neighbors.astype(np.int64), largest)
    outward = alike.view(np.bool_) if side[largest] > 0 else ~alike.view(np.bool_)
    start, ring, is_whole = dual_faces(simplices, outward, vertex_ids, len(duals))
    if not (is_connected and is_whole):
        return None
    rows = np.flatnonzero(np.diff(start))
    compact = np.concatenate([start[rows], start[-1:]])
    return DualHull(-unique[:, :3] / unique[:, 3:4], compact, ring, rows, True)


def _convex_hull(points: NDArray[np.float64]) -> Any:
    """Call Qhull; None where it gives up.

    Qhull cannot be interrupted, and Python hears signals only between its own steps: a long call runs
    beside the thread that waits for it, and is left alone when that one is interrupted.
    """
    from scipy.spatial import ConvexHull, QhullError

    def call() -> None:
        try:
            answer.append(ConvexHull(points))
        except QhullError:
            answer.append(None)
        except BaseException as error:
            answer.append(error)

    answer: list[Any] = []
    if len(points) < _LONG_HULL:
        call()
    else:
        worker = Thread(target=call, daemon=True)
        worker.start()
        while worker.is_alive():
            worker.join(0.05)
    if isinstance(answer[0], BaseException):
        raise answer[0]
    return answer[0]


def convex_surface(planes: HalfSpaces, point: NDArray[np.float64]) -> Polyhedron | None:
    """Take a strictly convex closed triangle surface as its own kernel, decided exactly; None for any other.

    All edges strictly convex and the solid angle of one turn around `point` make it convex; then
    every facet bounds the kernel and every corner is one of its vertices, without any arithmetic.
    """
    faces = planes.corner_ids()
    if not (planes.is_triangulation and planes.bounds_volume):
        return None
    if edge_convexity_of(planes.vertices, faces, np.arange(len(faces)), faces) < 2:
        return None
    used = np.zeros(len(planes.vertices), np.bool_)
    used[faces.ravel()] = True
    number = np.cumsum(used) - 1
    vertices = planes.to_local(planes.vertices[used]) - point
    start, ring = np.arange(0, 3 * len(faces) + 1, 3), number[faces.ravel()]
    if abs(solid_angle(vertices, ring) / (4 * np.pi) - 1.0) > 0.25:
        return None
    return Polyhedron(point.copy(), vertices, start, ring, np.arange(len(faces)))


_CUBE = np.concatenate([np.eye(3), -np.eye(3)])


def relevant_rows(planes: HalfSpaces, point: NDArray[np.float64], working_set: NDArray[np.int64]) -> NDArray[np.int64]:
    """List the half-spaces that may bound the kernel around a point inside it.

    The tightest plane of each direction, seen from the point, gives an outer polyhedron; a plane that
    none of its corners reaches cannot matter. The caller checks what is made of them against all planes.
    """
    n = len(planes)
    if n <= _CULL_ABOVE:
        return np.arange(n)
    ids, slacks = np.empty(N_BINS, np.int64), np.empty(N_BINS)
    arrays = planes.local_normals, planes.local_offsets, planes.local_errors
    tightest_by_direction(*arrays, point, np.inf, ids, slacks)
    tight = np.union1d(ids[ids >= 0], working_set)
    outer = polyhedron_around(planes.select(tight), point)
    if outer is None:
        return np.arange(n)
    return np.union1d(reach_of(planes, outer, margin=1e-9 * outer.extent).rows, tight[outer.rows])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Reach(Frozen):
    """Half-spaces not clear of a polyhedron, how far its corners pass each, and what rounding may add to that."""

    rows: NDArray[np.int64]
    excess: NDArray[np.float64]
    pads: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Nothing to freeze: it never leaves this folder, and a small kernel would take a tenth longer."""

    @property
    def residual(self) -> float:
        """Largest distance by which a corner lies outside a half-space, at least 0."""
        return float(np.max(self.excess, initial=0.0))

    @property
    def bound(self) -> float:
        """The same with rounding added."""
        return float(np.max(self.excess + self.pads, initial=0.0))


def reach_of(planes: HalfSpaces, solid: Polyhedron, *, margin: float = 0.0) -> Reach:
    """Hold all half-spaces against all corners of a polyhedron; those not listed are clear by `margin`, for certain."""
    return Reach(
        *planes_reaching(
            planes.local_normals, planes.local_offsets, planes.local_errors, solid.center, solid.vertices, margin
        )
    )


def polyhedron_moments(
    solid: Polyhedron,
) -> tuple[float, NDArray[np.float64], NDArray[np.float64], float]:
    """Volume, centroid (relative to the centre), second central moment and area, in local units."""
    volume, first, second, area = moments(solid.vertices, solid.start, solid.ring)
    centroid = first / volume
    return volume, centroid, second - volume * np.outer(centroid, centroid), area
