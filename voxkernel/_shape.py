"""Corners, faces and moments of a non-empty kernel, in local coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import isqrt

import numpy as np
from numpy.typing import NDArray

from voxkernel._exact_program import deepest_rational_point
from voxkernel._flat import RationalPoint, rational_kernel, rational_moments
from voxkernel._solid import (
    convex_surface,
    polyhedron_around,
    polyhedron_moments,
    relevant_rows,
    rows_reaching,
)
from voxkernel.feasibility import Feasibility
from voxkernel.halfspaces import HalfSpaces

__all__ = ["Shape", "rational_shape", "solid_shape"]

# Below this share of depth to size, a solid is left to rational arithmetic.
_THIN = 1e-5
# A kernel smaller than this share of the surface gets its plane distances from rationals.
_SMALL = 1e-3


@dataclass(frozen=True, slots=True)
class Shape:
    """A convex polytope; `rows` are the half-spaces of its faces, `corners` its vertices where known exactly.

    `residual` is how far a rounded vertex lies outside a half-space, `rounding` a bound on the
    relative error of the volume.
    """

    vertices: NDArray[np.float64]
    face_starts: NDArray[np.int64]
    face_vertices: NDArray[np.int64]
    rows: NDArray[np.int64]
    volume: float
    area: float
    centroid: NDArray[np.float64]
    inertia: NDArray[np.float64]
    deepest: NDArray[np.float64]
    clearance: float
    corners: list[RationalPoint]
    residual: float
    rounding: float


def solid_shape(planes: HalfSpaces, inside: Feasibility) -> Shape | None:
    """Find corners and faces in floating point; None where rationals must do it."""
    from voxkernel._loops.linear_program import deepest_point

    point = inside.local_point
    if point is None or inside.clearance <= 0.0:
        return None
    rows, _ = relevant_rows(planes, point, inside.working_set)
    solid = convex_surface(planes, point) if 2 * len(rows) > len(planes) else None
    near = planes
    if solid is None:
        near = planes.select(rows)
        heads = np.flatnonzero(near.coplanar_groups() == np.arange(len(near)))
        rows, near = rows[heads], near.select(heads)
        solid = polyhedron_around(near, point)
    if solid is None:
        return None
    basis, multipliers, best = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
    deepest_point(
        near.local_normals, near.local_offsets, solid.rows, len(solid.rows), 2.0**28, basis, multipliers, best,
        1e-14 * solid.extent, 2000,
    )  # fmt: skip
    slack = near.local_offsets[solid.rows] - near.local_normals[solid.rows] @ best[:3]
    deepest, clearance = best[:3], float(slack.min())
    if clearance < inside.clearance:  # the solver gave up early: keep the point already proven
        deepest, clearance = point, inside.clearance
    if clearance < _THIN * solid.extent:
        return None
    if solid.extent < _SMALL:
        solid = polyhedron_around(near, deepest, slacks=_exact_distances(near, deepest)) or solid
    volume, centroid, inertia, area = polyhedron_moments(solid)
    corners = solid.center + solid.vertices
    # The rows left out are clear of an outer polyhedron by 1e-9 of its size, so of these corners too.
    _, excess = rows_reaching(near, solid)
    owner = np.repeat(solid.rows, np.diff(solid.start))
    on_face = np.abs(np.einsum("ij,ij->i", near.local_normals[owner], corners[solid.ring]) - near.local_offsets[owner])
    # Moving every plane by the largest misfit changes the volume by less than this share.
    misfit = max(float(on_face.max()), excess) + 2 * float(near.local_errors[solid.rows].max())
    rounding = 4.0 * misfit / clearance + 1e-14
    return Shape(
        vertices=corners,
        face_starts=solid.start,
        face_vertices=solid.ring,
        rows=rows[solid.rows],
        volume=volume,
        area=area,
        centroid=solid.center + centroid,
        inertia=inertia,
        deepest=deepest,
        clearance=clearance,
        corners=[],
        residual=max(0.0, excess),
        rounding=rounding,
    )


def _exact_distances(planes: HalfSpaces, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of a local point from the planes, each rounded once from its exact value."""
    lattice = planes.to_lattice(point)
    unit = planes.scale * planes.lattice_unit
    distances = np.empty(len(planes))
    for i, (a, b, c, d) in enumerate(planes.integer_planes(range(len(planes)))):
        slack = d - (a * lattice[0] + b * lattice[1] + c * lattice[2])
        distances[i] = float(slack * (1 << 64) / isqrt((a * a + b * b + c * c) << 128) / Fraction(unit))
    return distances


def rational_shape(planes: HalfSpaces, inside: Feasibility) -> Shape | None:
    """Find corners and faces in rational arithmetic; None for an unbounded kernel."""
    kernel = rational_kernel(planes, inside)
    if kernel is None or inside.point is None:
        return None
    corners, faces = kernel
    unit = Fraction(planes.scale) * planes.lattice_unit
    volume, area, centroid, inertia = rational_moments(inside.dimension, corners, [f for _, f in faces])
    vertices = np.array([planes.from_lattice(c) for c in corners])
    deepest, clearance = planes.from_lattice(inside.point), 0.0
    rows = [r for r, _ in faces]
    rings = [np.array(f, np.int64) for _, f in faces]
    if inside.dimension == 3:
        used = planes.integer_planes(rows)
        optimum = deepest_rational_point([(p[:3], Fraction(p[3])) for p in used], 3, unit=unit)
        x, y, z = optimum.point
        deepest = planes.from_lattice((x, y, z))
        clearance = min(
            float((p[3] - p[0] * x - p[1] * y - p[2] * z) / isqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2) / unit)
            for p in used
        )
    elif inside.dimension == 2:
        ring = [faces[0][1][0]]
        after = dict((f[0], f[1]) for _, f in faces)
        while after[ring[-1]] != ring[0]:
            ring.append(after[ring[-1]])
        rings, rows = [np.array(ring, np.int64)], [inside.witnesses[-1].ids[0]]
    else:
        rings, rows = [], []
    residual = float(np.max(planes.local_normals @ vertices.T - planes.local_offsets[:, None], initial=0.0))
    starts = np.concatenate([[0], np.cumsum([len(r) for r in rings], dtype=np.int64)])
    ring_array = np.concatenate(rings) if rings else np.empty(0, np.int64)
    return Shape(
        vertices=vertices,
        face_starts=starts,
        face_vertices=ring_array,
        rows=np.array(rows, np.int64),
        volume=float(volume / unit**3),
        area=float(area / unit**2),
        centroid=planes.from_lattice(centroid),
        inertia=np.array([[float(v / unit**5) for v in line] for line in inertia]),
        deepest=deepest,
        clearance=clearance,
        corners=corners,
        residual=residual,
        rounding=1e-14,
    )
