"""Corners, faces and moments of a non-empty kernel, in local coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from math import isqrt, lcm

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import solid_measures
from voxkernel._frozen import Frozen
from voxkernel.exact.dual_hull import (
    Polyhedron,
    convex_surface,
    polyhedron_around,
    relevant_rows,
)
from voxkernel.exact.inner_point import inner_point
from voxkernel.exact.meeting_points import RationalPoint, meeting_points
from voxkernel.exact.rational_kernel import rational_kernel, rational_moments
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.plane_passes import largest_heights, reaching_planes
from voxkernel.halfspaces.rational_program import deepest_rational_point

__all__ = ["Shape", "flat_shape", "solid_shape"]

_UNIT = 2.0**-53
# Below this share of depth to size moments are summed exactly.
_THIN = 1e-4
# Rounding, as a share of the volume, above which they are too.
_ROUNDING = 1e-8
# So many half-spaces enter the exact linear program at first.
_FEW = 24
# Below this the hull is found sooner than a convex surface is recognised.
_SMALL = 100


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Shape(Frozen):
    """A convex polytope; `rows` are the half-spaces of its faces.

    The planes of the three `vertex_rows` meet in a vertex; without them `corners` are the vertices, exactly.
    `residual` bounds how far a rounded vertex lies from the exact one, `rounding` the relative error of the volume.
    """

    vertices: NDArray[np.float64]
    face_starts: NDArray[np.int64]
    face_vertices: NDArray[np.int64]
    rows: NDArray[np.int64]
    vertex_rows: NDArray[np.int64]
    volume: float
    area: float
    centroid: NDArray[np.float64]
    inertia: NDArray[np.float64]
    deepest: NDArray[np.float64]
    clearance: float
    extent: float
    corners: list[RationalPoint]
    residual: float
    rounding: float

    def __post_init__(self) -> None:
        """Nothing to freeze: it never leaves this folder, and a small kernel would take a tenth longer."""


def solid_shape(planes: HalfSpaces, inside: Feasibility, *, threads: int = 1) -> Shape | None:
    """Find corners and faces of a solid, exactly; None where it is unbounded.

    Rows that seem not to matter are left out, and the corners found are held against all half-spaces:
    whoever objects is put back, until nobody does.
    """
    point = inner_point(planes, inside)
    rows = relevant_rows(planes, point, inside.working_set, threads=threads)
    if 2 * len(rows) > len(planes) > _SMALL:
        convex = convex_surface(planes, point, threads=threads)
        if convex is not None:
            shape = _float_shape(planes, convex, inside)
            if _is_accurate(shape):
                return shape
    while True:
        solid = polyhedron_around(planes, point, _heads(planes, rows, threads), threads=threads)
        if solid is not None:
            missing = _missing_rows(planes, solid, rows, threads)
            if not len(missing):
                break
            rows = np.sort(np.concatenate([rows, missing]))
        elif len(rows) == len(planes):
            return None
        else:
            rows = np.arange(len(planes))
    shape = _float_shape(planes, solid, inside)
    return shape if _is_accurate(shape) else _exact_shape(planes, solid, shape)


def _missing_rows(
    planes: HalfSpaces, solid: Polyhedron, rows: NDArray[np.int64], threads: int
) -> NDArray[np.int64]:
    """List the half-spaces left out that are not clear of all corners."""
    if len(rows) == len(planes):
        return rows[:0]
    is_out = np.ones(len(planes), np.bool_)
    is_out[rows] = False
    return reaching_planes(
        planes, solid.center, solid.vertices, margin=solid.reach, among=is_out, threads=threads
    )


def _heads(planes: HalfSpaces, rows: NDArray[np.int64], threads: int) -> NDArray[np.int64]:
    """One row of each plane."""
    near = planes if len(rows) == len(planes) else planes.select(rows)
    return rows[near.coplanar_groups(threads=threads) == np.arange(len(near))]


def _is_accurate(shape: Shape) -> bool:
    """Whether floating point was enough: no thin kernel, none that is small beside its rounding."""
    return shape.clearance >= _THIN * shape.extent and shape.rounding <= _ROUNDING


def _float_shape(planes: HalfSpaces, solid: Polyhedron, inside: Feasibility) -> Shape:
    """Measure a polyhedron, every vertex of which is within `reach` of the exact one; its vertices are moved."""
    extent, volume, area, centroid, inertia, deepest, clearance = solid_measures(
        planes.local_normals, planes.local_offsets, solid.center, solid.vertices, solid.start, solid.ring, solid.rows
    )
    if clearance < inside.clearance:  # the solver gave up early: keep the point already proven
        deepest, clearance = np.zeros(3), inside.clearance
    vertices = solid.vertices
    vertices += solid.center  # in place: where many half-spaces meet a copy would count
    # Scaled about the deepest point by 1 + reach / clearance, the exact polyhedron holds the rounded one; by
    # 1 - reach / clearance, it lies inside.
    return Shape(
        vertices=vertices,
        face_starts=solid.start,
        face_vertices=solid.ring,
        rows=solid.rows,
        vertex_rows=solid.vertex_rows,
        volume=volume,
        area=area,
        centroid=solid.center + centroid,
        inertia=inertia,
        deepest=solid.center + deepest,
        clearance=clearance,
        extent=extent,
        corners=[],
        residual=solid.reach,
        rounding=4.0 * solid.reach / clearance + _UNIT * (extent / clearance) ** 2 + 1e-14
        if clearance > 0
        else np.inf,
    )


def _exact_shape(planes: HalfSpaces, solid: Polyhedron, shape: Shape) -> Shape:
    """Measure a thin or tiny polyhedron by exact sums over its exact vertices."""
    corners = meeting_points(planes, solid.vertex_rows)
    bounds = solid.start.tolist()
    faces = [solid.ring[a:b].tolist() for a, b in pairwise(bounds)]
    volume, area, centroid, inertia = rational_moments(3, corners, faces)
    deepest, clearance = _exact_deepest(planes.select(solid.rows), shape.vertices)
    unit = Fraction(planes.scale) * planes.lattice_unit
    return replace(
        shape,
        volume=float(volume / unit**3),
        area=float(area / unit**2),
        centroid=planes.from_lattice(centroid),
        inertia=np.array([[float(v / unit**5) for v in line] for line in inertia]),
        deepest=deepest,
        clearance=clearance,
        rounding=1e-14,
    )


def _exact_deepest(faces: HalfSpaces, vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of a largest ball between faces, by exact linear programs on a growing working set."""
    unit = Fraction(faces.scale) * faces.lattice_unit
    size = Fraction(max(1.0, 2 * float(np.abs(vertices).max())))
    # Scaled up, so that integers near the lengths of the normals are near enough.
    planes = [tuple(v << 64 for v in p) for p in faces.integer_planes(range(len(faces)))]
    lengths = [isqrt(a * a + b * b + c * c) for a, b, c, _ in planes]
    chosen = list(range(0, len(planes), -(-len(planes) // _FEW)))
    while True:
        optimum = deepest_rational_point([(planes[i][:3], Fraction(planes[i][3])) for i in chosen], 3, unit=unit * size)
        common = lcm(*(v.denominator for v in optimum.point))
        x, y, z = (int(v * common) for v in optimum.point)
        slacks = [d * common - a * x - b * y - c * z for a, b, c, d in planes]
        depths = [Fraction(slack, length) for slack, length in zip(slacks, lengths, strict=True)]
        least = min(depths[i] for i in chosen)
        worse = sorted((d, i) for i, d in enumerate(depths) if d < least - abs(least) / (1 << 53))
        if not worse:
            return faces.from_lattice(optimum.point), float(min(depths) / common / unit)
        chosen += [i for _, i in worse[:8]]


def flat_shape(planes: HalfSpaces, inside: Feasibility) -> Shape | None:
    """Find the corners of a point, a segment or a flat polygon in rational arithmetic; None for an unbounded one."""
    kernel = rational_kernel(planes, inside)
    if kernel is None or inside.point is None:
        return None
    corners, faces = kernel
    unit = Fraction(planes.scale) * planes.lattice_unit
    volume, area, centroid, _ = rational_moments(inside.dimension, corners, [f for _, f in faces])
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
        vertices=vertices,
        face_starts=np.array([0, len(ring)] if ring else [0], np.int64),
        face_vertices=np.array(ring, np.int64),
        rows=np.array(rows, np.int64),
        vertex_rows=np.empty((0, 3), np.int64),
        volume=float(volume / unit**3),
        area=float(area / unit**2),
        centroid=planes.from_lattice(centroid),
        inertia=np.zeros((3, 3)),
        deepest=planes.from_lattice(inside.point),
        clearance=0.0,
        extent=float(np.abs(vertices).max()),
        corners=corners,
        residual=residual,
        rounding=1e-14,
    )
