"""Corners, faces and moments of a non-empty kernel, in local coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import isqrt

import numpy as np
from numpy.typing import NDArray

from voxkernel._exact_program import deepest_rational_point
from voxkernel._flat import RationalPoint, rational_kernel, rational_moments, rough_corners
from voxkernel._solid import (
    Polyhedron,
    convex_surface,
    polyhedron_around,
    polyhedron_moments,
    relevant_rows,
    rows_reaching,
)
from voxkernel._stretched import Stretched, stretched_polyhedron
from voxkernel.feasibility import Feasibility
from voxkernel.halfspaces import HalfSpaces

__all__ = ["Shape", "rational_shape", "solid_shape"]

# Below this share of depth to size, and below this size, floating point alone loses digits.
_THIN = 1e-5
_SMALL = 1e-3
# So few half-spaces are cut exactly, in rationals.
_FEW = 64


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
    point = inside.local_point
    if point is None or inside.clearance <= 0.0:
        return None
    rows, _ = relevant_rows(planes, point, inside.working_set)
    convex = convex_surface(planes, point) if 2 * len(rows) > len(planes) else None
    if convex is not None:
        return _float_shape(planes, rows, convex, inside)
    near = planes.select(rows)
    heads = np.flatnonzero(near.coplanar_groups() == np.arange(len(near)))
    rows, near = rows[heads], near.select(heads)
    solid = polyhedron_around(near, point)
    if solid is not None:
        shape = _float_shape(near, rows, solid, inside)
        if shape.clearance >= _THIN * solid.extent and solid.extent >= _SMALL:
            return shape
    if len(near) <= _FEW:
        return None
    rough = rough_corners(near, replace(inside, working_set=np.arange(len(near))))
    stretched = None if rough is None else stretched_polyhedron(near, point, rough)
    return None if stretched is None else _stretched_shape(near, rows, stretched, inside)


def _deepest(planes: HalfSpaces, solid: Polyhedron, inside: Feasibility) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of a largest ball between the faces."""
    from voxkernel._loops.linear_program import deepest_point

    normals = planes.local_normals[solid.rows]
    # Relative to the centre and to the size, so that a small kernel is solved as well as a large one.
    offsets = (planes.local_offsets[solid.rows] - normals @ solid.center) / solid.extent
    basis, multipliers, best = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
    ids = np.arange(len(solid.rows))
    deepest_point(normals, offsets, ids, len(ids), 2.0, basis, multipliers, best, 1e-14, 2000)
    clearance = float((offsets - normals @ best[:3]).min()) * solid.extent
    if clearance < inside.clearance:  # the solver gave up early: keep the point already proven
        return solid.center, inside.clearance
    return solid.center + solid.extent * best[:3], clearance


def _float_shape(planes: HalfSpaces, rows: NDArray[np.int64], solid: Polyhedron, inside: Feasibility) -> Shape:
    """Measure a polyhedron; `rows` names the half-spaces of `planes`."""
    deepest, clearance = _deepest(planes, solid, inside)
    volume, centroid, inertia, area = polyhedron_moments(solid)
    corners = solid.center + solid.vertices
    # The rows left out are clear of an outer polyhedron by 1e-9 of its size, so of these corners too.
    _, excess = rows_reaching(planes, solid)
    owner = np.repeat(solid.rows, np.diff(solid.start))
    on_face = np.abs(
        np.einsum("ij,ij->i", planes.local_normals[owner], corners[solid.ring]) - planes.local_offsets[owner]
    )
    # Moving every plane by the largest misfit changes the volume by less than this share.
    misfit = max(float(on_face.max()), excess) + 2 * float(planes.local_errors[solid.rows].max())
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
        rounding=4.0 * misfit / clearance + 1e-14,
    )


def _stretched_shape(planes: HalfSpaces, rows: NDArray[np.int64], stretched: Stretched, inside: Feasibility) -> Shape:
    """Measure a stretched polyhedron: moments in round coordinates, the rest as for any other."""
    shape = _float_shape(planes, rows, stretched.solid, inside)
    centered = replace(stretched.solid, vertices=stretched.round_vertices)
    volume, centroid, inertia, _ = polyhedron_moments(centered)
    basis = stretched.basis
    factor = abs(float(np.linalg.det(basis)))
    return replace(
        shape,
        volume=volume * factor,
        centroid=stretched.solid.center + basis @ centroid,
        inertia=basis @ inertia @ basis.T * factor,
        rounding=8.0 * stretched.misfit + 1e-13,
    )


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
