"""Corners, faces and moments of a non-empty kernel, in world coordinates."""

from __future__ import annotations

from fractions import Fraction
from heapq import nsmallest
from itertools import pairwise
from math import inf, isqrt, lcm, nextafter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import solid_measures
from voxkernel.exact.dual_hull import (
    Polyhedron,
    convex_surface,
    polyhedron_around,
    relevant_rows,
)
from voxkernel.exact.inner_point import inner_point
from voxkernel.exact.meeting_points import RationalPoint, homogeneous_meeting_points
from voxkernel.exact.rational_kernel import rational_kernel
from voxkernel.exact.rational_moments import flat_moments, solid_moments
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.plane_passes import largest_heights, reaching_planes
from voxkernel.halfspaces.rational_program import deepest_rational_point

__all__ = ["Shape", "flat_shape", "solid_shape"]

_UNIT = 2.0**-53
# Above what a number below the normal range of doubles loses, several times over.
_LEAST = 2.0**-1070
# Below this share of depth to size moments are summed exactly.
_THIN = 1e-4
# Rounding, as a share of the volume, above which they are too.
_ROUNDING = 1e-8
# So many half-spaces enter the exact linear program at first.
_FEW = 24
# Below this the hull is found sooner than a convex surface is recognised.
_SMALL = 100
# Above this a sample of so many facets says whether a surface may be convex, before culling.
_MANY, _SAMPLE = 3000, 64


class Shape(NamedTuple):
    """A convex polytope in world coordinates; `rows` are the half-spaces of its faces.

    The planes of the three `vertex_rows` meet in a vertex; without them `corners` are the vertices, exactly, in lattice
    coordinates. `residual` bounds how far a rounded vertex lies from the exact one. It `is_accurate` where floating
    point was enough: no thin kernel, none that is small beside its rounding.
    """

    vertices: NDArray[np.float64]
    face_starts: NDArray[np.int64]
    face_vertices: NDArray[np.int32]
    rows: NDArray[np.signedinteger]
    vertex_rows: NDArray[np.signedinteger]
    volume: float
    volume_bounds: tuple[float, float]
    area: float
    centroid: NDArray[np.float64]
    inertia: NDArray[np.float64]
    deepest: NDArray[np.float64]
    clearance: float
    corners: tuple[RationalPoint, ...]
    residual: float
    is_accurate: bool


def solid_shape(planes: HalfSpaces, inside: Feasibility, *, threads: int = 1) -> Shape | None:
    """Find corners and faces of a solid, exactly; None where it is unbounded.

    Rows that seem not to matter are left out, and the corners found are held against all half-spaces:
    whoever objects is put back, until nobody does.
    """
    point = inner_point(planes, inside)
    seems_convex = len(planes) > _MANY and _seems_convex(planes)
    rows = None if seems_convex else relevant_rows(planes, point, inside.working_set, threads=threads)
    if rows is None or 2 * len(rows) > len(planes) > _SMALL:
        convex = convex_surface(planes, point, threads=threads)
        if convex is not None:
            shape = _float_shape(planes, convex, inside, threads)
            if shape.is_accurate:
                return shape
    if rows is None:
        rows = relevant_rows(planes, point, inside.working_set, threads=threads)
    while True:
        solid = polyhedron_around(planes, point, rows, threads=threads)
        if solid is not None:
            missing = _missing_rows(planes, solid, rows, threads)
            if not len(missing):
                break
            rows = np.sort(np.concatenate([rows, missing]))
        elif len(rows) == len(planes):
            return None
        else:
            rows = np.arange(len(planes))
    shape = _float_shape(planes, solid, inside, threads)
    return shape if shape.is_accurate else _exact_shape(planes, solid, shape)


def _seems_convex(planes: HalfSpaces) -> bool:
    """Whether no corner of some facets is clearly in front of another: then it is worth a look before any culling."""
    if not (planes.is_triangulation and planes.bounds_volume):
        return False
    some = np.arange(0, len(planes), len(planes) // _SAMPLE)
    corners = planes.to_local(planes.vertices[planes.corner_ids()[some, 0]])
    return bool((planes.local_normals[some] @ corners.T <= planes.local_offsets[some, None] + 1e-9).all())


def _missing_rows(planes: HalfSpaces, solid: Polyhedron, rows: NDArray[np.int64], threads: int) -> NDArray[np.int64]:
    """List the half-spaces left out that are not clear of all corners."""
    if len(rows) == len(planes):
        return rows[:0]
    is_out = np.ones(len(planes), np.bool_)
    is_out[rows] = False
    return reaching_planes(planes, solid.center, solid.vertices, margin=solid.reach, among=is_out, threads=threads)


def _float_shape(planes: HalfSpaces, solid: Polyhedron, inside: Feasibility, threads: int) -> Shape:
    """Measure a polyhedron, every vertex of which is within `reach` of the exact one; moves them to the world."""
    scale, reach = planes.scale, solid.reach
    extent, volume, area, clearance, centroid, deepest, inertia = solid_measures(
        planes.local_normals, planes.local_offsets, solid.center, solid.vertices, solid.start, solid.ring, solid.rows,
        inside.clearance, planes.origin, scale, threads,
    )  # fmt: skip
    # Scaled about the deepest point by 1 + reach / clearance, the exact polyhedron holds the rounded one; by
    # 1 - reach / clearance, it lies inside.
    slenderness = extent / clearance if clearance > 0.0 else inf
    rounding = 4.0 * reach / clearance + _UNIT * slenderness * slenderness + 1e-14 if clearance > 0.0 else inf
    return Shape(
        vertices=read_only(solid.vertices),
        face_starts=solid.start,
        face_vertices=solid.ring,
        rows=solid.rows,
        vertex_rows=solid.vertex_rows,
        volume=volume * scale**3,
        volume_bounds=_volume_bounds(volume, rounding, scale),
        area=area * scale**2,
        centroid=centroid,
        inertia=inertia,
        deepest=deepest,
        clearance=clearance * scale,
        corners=(),
        residual=reach * scale,
        is_accurate=clearance >= _THIN * extent and rounding <= _ROUNDING,
    )


def _volume_bounds(volume: float, rounding: float, scale: float) -> tuple[float, float]:
    """Bounds that hold where the volume is too small or too large for a double with all its digits, too."""
    cube = scale**3
    lower = max(0.0, volume * (1.0 - rounding) - _LEAST) * cube
    upper = (volume * (1.0 + rounding) + _LEAST) * cube
    return max(0.0, nextafter(lower, -inf)), nextafter(upper, inf)


def _exact_shape(planes: HalfSpaces, solid: Polyhedron, shape: Shape) -> Shape:
    """Measure a thin or tiny polyhedron by exact sums over its exact vertices."""
    corners = homogeneous_meeting_points(planes, solid.vertex_rows)
    bounds = solid.start.tolist()
    faces = [solid.ring[a:b].tolist() for a, b in pairwise(bounds)]
    exact_volume, area, centroid, inertia = solid_moments(corners, faces)
    deepest, clearance = _exact_deepest(planes.select(solid.rows), float(np.abs(planes.to_local(shape.vertices)).max()))
    scale, unit = planes.scale, Fraction(planes.scale) * planes.lattice_unit
    volume = float(exact_volume / unit**3)
    return shape._replace(
        volume=volume * scale**3,
        volume_bounds=_volume_bounds(volume, 1e-14, scale),
        area=float(area / unit**2) * scale**2,
        centroid=planes.to_world(planes.from_lattice(centroid)),
        inertia=np.array([[float(v / unit**5) for v in line] for line in inertia]) * scale**5,
        deepest=planes.to_world(deepest),
        clearance=clearance * scale,
    )


def _exact_deepest(faces: HalfSpaces, largest: float) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of a largest ball between faces, by exact linear programs on a growing working set.

    `largest` is the largest coordinate of a vertex; as the results it is local.
    """
    unit = Fraction(faces.scale) * faces.lattice_unit
    size = Fraction(max(1.0, 2 * largest))
    # Scaled up, so that integers near the lengths of the normals are near enough.
    planes = [tuple(v << 64 for v in p) for p in faces.integer_planes(range(len(faces)))]
    lengths = [isqrt(a * a + b * b + c * c) for a, b, c, _ in planes]
    chosen = list(range(0, len(planes), -(-len(planes) // _FEW)))
    while True:
        optimum = deepest_rational_point([(planes[i][:3], Fraction(planes[i][3])) for i in chosen], 3, unit=unit * size)
        common = lcm(*(v.denominator for v in optimum.point))
        x, y, z = (int(v * common) for v in optimum.point)
        slacks = [d * common - a * x - b * y - c * z for a, b, c, d in planes]
        least = min(Fraction(slacks[i], lengths[i]) for i in chosen)
        bound = least - abs(least) / (1 << 53)
        below, above = bound.numerator, bound.denominator
        worse = [i for i, slack in enumerate(slacks) if slack * above < below * lengths[i]]
        if not worse:
            below, above = least.numerator, least.denominator
            depths = [Fraction(v, w) for v, w in zip(slacks, lengths, strict=True) if v * above <= below * w]
            return faces.from_lattice(optimum.point), float(min(depths) / common / unit)
        chosen += nsmallest(8, worse, key=lambda i: Fraction(slacks[i], lengths[i]))


def flat_shape(planes: HalfSpaces, inside: Feasibility) -> Shape | None:
    """Find the corners of a point, a segment or a flat polygon in rational arithmetic; None for an unbounded one."""
    kernel = rational_kernel(planes, inside)
    if kernel is None or inside.point is None:
        return None
    corners, faces = kernel
    scale, unit = planes.scale, Fraction(planes.scale) * planes.lattice_unit
    area, centroid = flat_moments(inside.dimension, corners, [f for _, f in faces])
    vertices = np.array([planes.from_lattice(c) for c in corners])
    ring: list[int] = []
    rows: list[int] = []
    if inside.dimension == 2:
        ring = [faces[0][1][0]]
        after = dict((f[0], f[1]) for _, f in faces)
        while after[ring[-1]] != ring[0]:
            ring.append(after[ring[-1]])
        rows = [inside.witnesses[-1].ids[0]]
    near = reaching_planes(planes, np.zeros(3), vertices)  # of the others no corner is outside
    residual = max(0.0, float(largest_heights(planes, near, vertices).max(initial=0.0)))
    return Shape(
        vertices=planes.to_world(vertices),
        face_starts=np.array([0, len(ring)] if ring else [0], np.int64),
        face_vertices=np.array(ring, np.int32),
        rows=np.array(rows, np.int32),
        vertex_rows=np.empty((0, 3), np.int32),
        volume=0.0,
        volume_bounds=(0.0, 0.0),
        area=float(area / unit**2) * scale**2,
        centroid=planes.to_world(planes.from_lattice(centroid)),
        inertia=np.zeros((3, 3)),
        deepest=planes.to_world(planes.from_lattice(inside.point)),
        clearance=0.0,
        corners=tuple(corners),
        residual=residual * scale,
        is_accurate=True,
    )
