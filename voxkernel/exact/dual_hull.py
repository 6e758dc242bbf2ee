"""Solid kernels: cull, then take the dual hull, exact to the last face."""

from __future__ import annotations

from math import frexp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import dual_hull, solid_angle, triangles_at_vertices, used_vertices
from voxkernel.errors import SolverError
from voxkernel.exact.convexity import edge_convexity_of
from voxkernel.exact.inner_point import InnerPoint
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.plane_passes import reaching_planes, tightest_planes

__all__ = [
    "Polyhedron",
    "convex_surface",
    "polyhedron_around",
    "relevant_rows",
]

_CULL_ABOVE = 3000
_MOST = 1 << 31  # numbers of vertices and of rows have 32 bits
# Half edges of the cube that closes what is open, as powers of two of the local unit. The last one is beyond every
# corner of planes whose coordinates have 2000 bits.
_CUBES = (3, 28, 300, 20_000)


class Polyhedron(NamedTuple):
    """A bounded convex polyhedron: vertices relative to `center`, rings of vertex ids, row of each ring.

    `center` and `vertices` are in local coordinates, the latter off by at most `error`; the planes of the three
    `vertex_rows` of a vertex meet there in one point. `start` and `ring` list the polygons.
    """

    center: NDArray[np.float64]
    vertices: NDArray[np.float64]
    vertex_rows: NDArray[np.int32]
    error: float
    start: NDArray[np.int64]
    ring: NDArray[np.int32]
    rows: NDArray[np.int32]

    @property
    def extent(self) -> float:
        """Largest distance of a vertex from the centre."""
        return float(np.sqrt((self.vertices**2).sum(axis=1).max()))

    @property
    def reach(self) -> float:
        """No vertex is farther from the exact one."""
        return 2.0 * self.error


def polyhedron_around(
    planes: HalfSpaces, point: InnerPoint, rows: NDArray[np.int64], *, threads: int = 1
) -> Polyhedron | None:
    """Intersect some of the half-spaces, given by ascending rows, about a point strictly inside; None if unbounded.

    Notes
    -----
    The convex hull of the dual points n / (d - n . x): a plane of it is a vertex, a point of it a face. Half-spaces on
    one plane are one, named by the first. Which planes meet where is decided exactly. A cube far away closes what is
    open.
    """
    exponent = frexp(planes.scale)[1] - 1
    for cube in _CUBES:
        is_inside, is_closed, vertices, vertex_rows, error, start, ring, faces = dual_hull(
            planes.local_normals, planes.local_offsets, planes.local_errors, point.local, point.error, planes.scale,
            planes.vertices, planes.corner_ids(), planes.given_planes(), point.terms, planes.is_cone, rows,
            exponent + cube, threads,
        )  # fmt: skip
        if not is_inside:
            raise SolverError("the inner point lies on a half-space or outside")
        if is_closed:
            return Polyhedron(point.local, vertices, vertex_rows, error, start, ring, faces)
    return None


def convex_surface(planes: HalfSpaces, point: InnerPoint, *, threads: int = 1) -> Polyhedron | None:
    """Take a strictly convex closed triangle surface as its own kernel, decided exactly; None for any other.

    All edges strictly convex and the solid angle of one turn around `point` make it convex; then
    every facet bounds the kernel and every corner is one of its vertices, without any arithmetic.
    """
    faces = planes.corner_ids()
    if not (planes.is_triangulation and planes.bounds_volume and max(len(faces), len(planes.vertices)) < _MOST):
        return None
    if edge_convexity_of(planes.vertices, faces, np.arange(len(faces)), faces, least=2, threads=threads) < 2:
        return None
    vertices, ring = used_vertices(planes.vertices, faces, planes.origin, planes.scale, point.local, threads)
    if abs(solid_angle(vertices, ring, threads) / (4 * np.pi) - 1.0) > 0.25:
        return None
    start, at_vertices = np.arange(0, 3 * len(faces) + 1, 3), triangles_at_vertices(ring, len(vertices), threads)
    rows = np.arange(len(faces), dtype=np.int32)
    return Polyhedron(point.local, vertices, at_vertices, 2.0**-49, start, ring, rows)


def relevant_rows(
    planes: HalfSpaces, point: InnerPoint, working_set: NDArray[np.int64], *, threads: int = 1
) -> NDArray[np.int64]:
    """List the half-spaces that may bound the kernel around a point inside it.

    The tightest plane of each direction, seen from the point, gives an outer polyhedron; a plane that
    none of its corners reaches cannot matter. The caller checks what is made of them against all planes.
    """
    n = len(planes)
    if n <= _CULL_ABOVE:
        return np.arange(n)
    tight = np.unique(np.concatenate([tightest_planes(planes, point.local, threads=threads), working_set]))
    outer = polyhedron_around(planes, point, tight, threads=threads)
    if outer is None:
        return np.arange(n)
    is_near = np.zeros(n, np.bool_)
    is_near[outer.rows] = True
    margin = 1e-9 * outer.extent + outer.reach
    is_near[reaching_planes(planes, outer.center, outer.vertices, margin=margin, threads=threads)] = True
    return np.flatnonzero(is_near)
