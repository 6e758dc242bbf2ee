"""Kernels that floating point cannot resolve: flat, or so thin that rationals must find the corners."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from voxkernel._exact_polytope import RationalPolytope, clip_interval, clip_polygon, clip_polyhedron
from voxkernel.feasibility import Feasibility
from voxkernel.halfspaces import HalfSpaces
from voxkernel.predicates import exact_slacks

__all__ = ["RationalKernel", "RationalPoint", "rational_kernel", "rational_moments", "rough_corners"]

RationalPoint = tuple[Fraction, Fraction, Fraction]
RationalKernel = tuple[list[RationalPoint], list[tuple[int, list[int]]]]

_REACHES = (8, 2**14, 2**28, 2**60, 2**120)


def rational_kernel(planes: HalfSpaces, inside: Feasibility) -> RationalKernel | None:
    """Find the corners of a kernel of dimension 0 to 3 exactly, in lattice coordinates.

    Half-spaces are added lazily: the polytope of a working set is clipped, every half-space that
    is not clear of its corners is tried in integers, and those that cut it join the working set.
    Faces name the row of `planes` that made them. Returns None where the kernel is unbounded.
    """
    assert inside.point is not None  # the caller asks for non-empty kernels only
    if inside.dimension == 0:
        return [inside.point], []
    groups = planes.coplanar_groups()
    heads = np.flatnonzero(groups == np.arange(len(groups)))
    if len(heads) < len(planes):
        working_set = np.unique(np.searchsorted(heads, groups[inside.working_set]))
        kernel = rational_kernel(planes.select(heads), replace(inside, working_set=working_set))
        return None if kernel is None else (kernel[0], [(int(heads[r]), f) for r, f in kernel[1]])
    rows = inside.working_set[:256]
    while True:
        polytope = _clip_rows(planes, rows, inside)
        if polytope is None:
            missing = np.setdiff1d(inside.working_set, rows)
            if not len(missing):
                missing = _directions_missing(planes, inside, rows)
            if not len(missing):
                missing = np.setdiff1d(np.arange(len(planes)), rows)
            if not len(missing):
                return None
            rows = np.concatenate([rows, missing[:1024]])
            continue
        corners = [_lift(p, inside) for p in polytope.vertices]
        fresh = np.setdiff1d(_cutting_rows(planes, corners), rows)
        if not len(fresh):
            used = [r for r, _ in polytope.faces]
            return corners, [(int(rows[r]), f) for r, (_, f) in zip(used, polytope.faces, strict=True)]
        rows = np.concatenate([rows, fresh])


def rough_corners(planes: HalfSpaces, inside: Feasibility) -> NDArray[np.float64] | None:
    """Give corners, local and rounded, of a solid that contains the kernel and is about as thin.

    The tightest half-spaces around the point, few at a time, until they bound a solid.
    """
    assert inside.local_point is not None
    slack = planes.local_offsets - planes.local_normals @ inside.local_point
    order = np.argsort(slack, kind="stable")
    tight = np.concatenate([order[:16], _directions_missing(planes, inside, order[:16])])
    for count in (48, 128, len(planes)):
        polytope = _clip_rows(planes, tight[:count], inside)
        if polytope is not None:
            return np.array([planes.from_lattice(_lift(p, inside)) for p in polytope.vertices])
        tight = np.concatenate([tight, np.setdiff1d(order, tight)])
    return None


def _clip_rows(planes: HalfSpaces, rows: NDArray[np.int64], inside: Feasibility) -> RationalPolytope | None:
    """Clip in coordinates of the affine hull; None when the start still shows."""
    assert inside.point is not None
    clip = {1: clip_interval, 2: clip_polygon, 3: clip_polyhedron}[inside.dimension]
    reduced = []
    names = []
    for i, p in zip(range(len(rows)), planes.integer_planes(rows), strict=True):
        normal = tuple(sum(u * v for u, v in zip(p[:3], w, strict=True)) for w in inside.directions)
        if any(normal):
            reduced.append((normal, p[3] - sum((u * v for u, v in zip(p[:3], inside.point, strict=True)), Fraction(0))))
            names.append(i)
    unit = Fraction(planes.scale) * planes.lattice_unit
    shortest = min(max(abs(v) for v in w) for w in inside.directions)
    for reach in _REACHES:
        polytope = clip(reduced, reach * unit / shortest)
        if all(r >= 0 for r, _ in polytope.faces):
            return RationalPolytope(polytope.vertices, [(names[r], f) for r, f in polytope.faces])
    return None


def _lift(z: tuple[Fraction, ...], inside: Feasibility) -> RationalPoint:
    assert inside.point is not None
    x, y, w = (
        inside.point[k] + sum((d[k] * v for d, v in zip(inside.directions, z, strict=True)), Fraction(0))
        for k in range(3)
    )
    return x, y, w


def _cutting_rows(planes: HalfSpaces, corners: list[RationalPoint]) -> NDArray[np.int64]:
    """List half-spaces that some corner violates, exactly; the worst few per round."""
    local = np.array([planes.from_lattice(c) for c in corners])
    low, high = local.min(axis=0), local.max(axis=0)
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    error = planes.local_errors * (np.abs(local).max() * 2 + 1) + 16 * 2.0**-53 * (1 + np.abs(local).max())
    support = planes.local_normals @ center + np.abs(planes.local_normals) @ half
    ids = np.flatnonzero(support - planes.local_offsets >= -error)
    excess = (planes.local_normals[ids] @ local.T).max(axis=1) - planes.local_offsets[ids]
    cutting: list[int] = []
    ids, excess = ids[excess >= -error[ids]], excess[excess >= -error[ids]]
    for i in ids[np.argsort(-excess, kind="stable")]:
        if any(exact_slacks(planes, [i], c)[0] < 0 for c in corners):
            cutting.append(int(i))
            if len(cutting) >= 24:
                break
    return np.array(cutting, np.int64)


def _directions_missing(planes: HalfSpaces, inside: Feasibility, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """List the tightest half-space of every direction bin around the point: they bound what can be bounded."""
    from voxkernel._loops.linear_program import N_BINS, tightest_by_direction

    assert inside.local_point is not None
    ids, slacks = np.empty(N_BINS, np.int64), np.empty(N_BINS)
    tightest_by_direction(
        planes.local_normals,
        planes.local_offsets,
        planes.local_errors,
        inside.local_point,
        np.inf,
        ids,
        slacks,
    )
    return np.setdiff1d(ids[ids >= 0], rows)


def rational_moments(
    dimension: int, corners: list[RationalPoint], faces: list[list[int]]
) -> tuple[Fraction, Fraction, RationalPoint, list[list[Fraction]]]:
    """Volume, area (its root rounded), centroid and second central moment of a rational polytope.

    Solids are cut into tetrahedra from corner 0, polygons into triangles; exact but for the area.
    """
    zero = Fraction(0)
    base = corners[0]
    relative = [[u - v for u, v in zip(c, base, strict=True)] for c in corners]
    second = [[zero] * 3 for _ in range(3)]
    if dimension < 3:
        area = zero
        weights: list[tuple[Fraction, list[Fraction]]] = []
        if dimension == 2:
            for i, j in faces:
                size = _length(_cross(relative[i], relative[j])) / 2
                area += size
                weights.append((size, [(u + v) / 3 for u, v in zip(relative[i], relative[j], strict=True)]))
        else:
            weights = [(Fraction(1), r) for r in relative]
        total = sum((w for w, _ in weights), zero)
        mean = [sum((w * m[k] for w, m in weights), zero) / total + base[k] for k in range(3)]
        return zero, area, (mean[0], mean[1], mean[2]), second
    volume = zero
    area = zero
    first = [zero] * 3
    for ring in faces:
        for j, k in pairwise(ring[1:]):
            a, b, c = relative[ring[0]], relative[j], relative[k]
            normal = _cross([u - v for u, v in zip(b, a, strict=True)], [u - v for u, v in zip(c, a, strict=True)])
            area += _length(normal) / 2
            part = sum((u * v for u, v in zip(a, normal, strict=True)), zero) / 6
            volume += part
            total3 = [u + v + w for u, v, w in zip(a, b, c, strict=True)]
            for p in range(3):
                first[p] += part * total3[p] / 4
                for q in range(3):
                    second[p][q] += part * (a[p] * a[q] + b[p] * b[q] + c[p] * c[q] + total3[p] * total3[q]) / 20
    mean = [v / volume for v in first]
    second = [[second[p][q] - volume * mean[p] * mean[q] for q in range(3)] for p in range(3)]
    return volume, area, (mean[0] + base[0], mean[1] + base[1], mean[2] + base[2]), second


def _cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _length(a: list[Fraction]) -> Fraction:
    """Length of a rational vector, rounded to a double's accuracy but not to its range."""
    largest = max(abs(v) for v in a)
    if largest == 0:
        return largest
    return largest * Fraction(sqrt(sum(float(v / largest) ** 2 for v in a)))
