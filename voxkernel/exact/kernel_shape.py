"""Corners, faces and moments of a non-empty kernel, in local coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import isqrt, lcm

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import deepest_point, face_misfit
from voxkernel._frozen import Frozen
from voxkernel.exact.dual_hull import (
    Polyhedron,
    Reach,
    convex_surface,
    polyhedron_around,
    polyhedron_moments,
    reach_of,
    relevant_rows,
)
from voxkernel.exact.rational_kernel import RationalPoint, rational_kernel, rational_moments, rough_corners
from voxkernel.exact.stretched_hull import Stretched, axes_of_cloud, axes_of_corners, stretched_polyhedron
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.rational_program import deepest_rational_point

__all__ = ["Shape", "rational_shape", "solid_shape"]

_UNIT = 2.0**-53
# Below this share of depth to size, and below this size, floating point alone loses digits.
_THIN = 1e-4
_SMALL = 1e-3
# Above this depth, in local units, floating point still knows in which directions a kernel is thin.
_RESOLVED = 1e-13
# Rounding, as a share of the volume or of the depth, above which exact planes are used instead.
_ROUNDING = 1e-8
# So few half-spaces are cut exactly, in rationals; more where floating point cannot tell the directions.
_FEW, _FEW_UNRESOLVED = 24, 64


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Shape(Frozen):
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

    def __post_init__(self) -> None:
        """Nothing to freeze: it never leaves this folder, and a small kernel would take a tenth longer."""


def solid_shape(planes: HalfSpaces, inside: Feasibility) -> Shape | None:
    """Find corners and faces in floating point; None where rationals must do it.

    Rows that seem not to matter are left out, and the corners found are held against all half-spaces:
    whoever objects is put back, until nobody does.
    """
    point = inside.local_point
    if point is None or inside.point is None:
        return None
    rows = relevant_rows(planes, point, inside.working_set) if inside.clearance > 0.0 else np.arange(len(planes))
    if inside.clearance > 0.0 and 2 * len(rows) > len(planes):
        convex = convex_surface(planes, point)
        if convex is not None:
            shape = _float_shape(planes, convex, reach_of(planes, convex), inside)
            if _is_accurate(shape, convex):
                return shape
    while True:
        shape, near = _shape_of_rows(planes, rows, inside)
        if len(rows) == len(planes):
            return shape
        missing = np.setdiff1d(near, rows)
        if not len(missing):
            return shape
        rows = np.union1d(rows, missing)


def _shape_of_rows(
    planes: HalfSpaces, rows: NDArray[np.int64], inside: Feasibility
) -> tuple[Shape | None, NDArray[np.int64]]:
    """Find the shape that some of the half-spaces make, and the half-spaces of all that are not clear of it."""
    assert inside.local_point is not None
    assert inside.point is not None
    near = planes if len(rows) == len(planes) else planes.select(rows)
    heads = np.flatnonzero(near.coplanar_groups() == np.arange(len(near)))
    if len(heads) < len(near):
        near = near.select(heads)
    axes = None
    solid = polyhedron_around(near, inside.local_point) if inside.clearance > 0.0 else None
    if solid is not None:
        solid = replace(solid, rows=rows[heads[solid.rows]])
        reach = reach_of(planes, solid)
        shape = _float_shape(planes, solid, reach, inside)
        if _is_accurate(shape, solid) and solid.extent >= _SMALL:
            return shape, reach.rows
        if shape.clearance >= _RESOLVED * max(1.0, solid.extent):
            axes = axes_of_cloud(near, solid.vertices)
    if len(near) <= (_FEW if axes is not None else _FEW_UNRESOLVED):
        return rational_shape(planes, replace(inside, working_set=rows[heads])), rows
    if axes is None:
        rough = rough_corners(near, replace(inside, working_set=np.arange(len(near))))
        axes = None if rough is None else axes_of_corners(rough)
    stretched = None if axes is None else stretched_polyhedron(near, inside.point, axes)
    if stretched is None:
        return None, rows
    solid = replace(stretched.solid, rows=rows[heads[stretched.solid.rows]])
    reach = reach_of(planes, solid)
    return _stretched_shape(planes, replace(stretched, solid=solid), reach, inside), reach.rows


def _is_accurate(shape: Shape, solid: Polyhedron) -> bool:
    """Whether floating point was enough: no thin kernel, no facet so slender that its plane is blurred."""
    return shape.clearance >= _THIN * solid.extent and shape.rounding <= _ROUNDING


def _deepest(planes: HalfSpaces, solid: Polyhedron, inside: Feasibility) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of a largest ball between the faces."""
    normals = planes.local_normals[solid.rows]
    size = solid.extent
    # Relative to the centre and to the size, so that a small kernel is solved as well as a large one.
    offsets = (planes.local_offsets[solid.rows] - normals @ solid.center) / size
    basis, multipliers, best = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
    deepest_point(normals, offsets, np.arange(len(solid.rows)), 2.0, basis, multipliers, best, 1e-14, 2000)
    clearance = float((offsets - normals @ best[:3]).min()) * size
    if clearance < inside.clearance:  # the solver gave up early: keep the point already proven
        return solid.center, inside.clearance
    return solid.center + size * best[:3], clearance


def _float_shape(planes: HalfSpaces, solid: Polyhedron, reach: Reach, inside: Feasibility) -> Shape:
    """Measure a polyhedron; `reach` is what all half-spaces say to its corners."""
    deepest, clearance = _deepest(planes, solid, inside)
    volume, centroid, inertia, area = polyhedron_moments(solid)
    on_face, blur, extent = face_misfit(
        planes.local_normals, planes.local_offsets, planes.local_errors,
        solid.center, solid.vertices, solid.start, solid.ring, solid.rows,
    )  # fmt: skip
    # Moving every plane by the largest misfit changes the volume by less than this share.
    misfit = max(on_face + blur, reach.bound)
    return Shape(
        vertices=solid.center + solid.vertices,
        face_starts=solid.start,
        face_vertices=solid.ring,
        rows=solid.rows,
        volume=volume,
        area=area,
        centroid=solid.center + centroid,
        inertia=inertia,
        deepest=deepest,
        clearance=clearance,
        corners=[],
        residual=reach.residual,
        rounding=4.0 * misfit / clearance + _UNIT * (extent / clearance) ** 2 + 1e-14
        if clearance > 0
        else np.inf,
    )


def _stretched_shape(planes: HalfSpaces, stretched: Stretched, reach: Reach, inside: Feasibility) -> Shape:
    """Measure a stretched polyhedron: moments in round coordinates, the rest as for any other."""
    shape = _float_shape(planes, stretched.solid, reach, inside)
    centered = replace(stretched.solid, vertices=stretched.round_vertices)
    volume, centroid, inertia, _ = polyhedron_moments(centered)
    basis = stretched.basis
    factor = stretched.factor
    deepest, clearance = shape.deepest, shape.clearance
    if _ROUNDING * clearance < float(planes.local_errors[stretched.solid.rows].max()) * (1 + stretched.solid.extent):
        deepest, clearance = _exact_deepest(planes.select(stretched.solid.rows), shape.vertices)
    return replace(
        shape,
        deepest=deepest,
        clearance=clearance,
        volume=volume * factor,
        centroid=stretched.solid.center + basis @ centroid,
        inertia=basis @ inertia @ basis.T * factor,
        rounding=8.0 * stretched.misfit + 1e-13,
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
        deepest, clearance = _exact_deepest(planes.select(np.array(rows)), vertices)
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
