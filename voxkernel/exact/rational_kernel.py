"""Flat kernels in rational arithmetic."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel.exact.meeting_points import RationalPoint
from voxkernel.exact.rational_clipping import RationalPolytope, clip_interval, clip_polygon
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.plane_passes import largest_heights, reaching_planes, tightest_planes
from voxkernel.halfspaces.predicates import exact_slacks

__all__ = ["RationalKernel", "rational_kernel"]

RationalKernel = tuple[list[RationalPoint], list[tuple[int, list[int]]]]

_REACHES = (8, 2**14, 2**28, 2**60, 2**120)


def rational_kernel(planes: HalfSpaces, inside: Feasibility) -> RationalKernel | None:
    """Find the corners of a kernel of dimension 0 to 2 exactly, in lattice coordinates.

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
        fresh = _cutting_rows(planes, corners, rows)
        if not len(fresh):
            used = [r for r, _ in polytope.faces]
            return corners, [(int(rows[r]), f) for r, (_, f) in zip(used, polytope.faces, strict=True)]
        rows = np.concatenate([rows, fresh])


def _clip_rows(planes: HalfSpaces, rows: NDArray[np.int64], inside: Feasibility) -> RationalPolytope | None:
    """Clip in coordinates of the affine hull; None when the start still shows."""
    assert inside.point is not None
    clip = {1: clip_interval, 2: clip_polygon}[inside.dimension]
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


def _cutting_rows(planes: HalfSpaces, corners: list[RationalPoint], known: NDArray[np.int64]) -> NDArray[np.int64]:
    """List half-spaces that some corner violates, exactly, but for the known ones; the worst few per round."""
    local = np.array([planes.from_lattice(c) for c in corners])
    size = float(np.abs(local).max())
    rounding = 16 * 2.0**-53 * (1 + size)
    ids = np.setdiff1d(reaching_planes(planes, np.zeros(3), local, margin=rounding), known)
    excess = largest_heights(planes, ids, local)
    is_near = excess >= -(planes.local_errors[ids] * (2 * size + 1) + rounding)
    ids, excess = ids[is_near], excess[is_near]
    cutting: list[int] = []
    for i in ids[np.argsort(-excess, kind="stable")]:
        if any(exact_slacks(planes, [i], c)[0] < 0 for c in corners):
            cutting.append(int(i))
            if len(cutting) >= 24:
                break
    return np.array(cutting, np.int64)


def _directions_missing(planes: HalfSpaces, inside: Feasibility, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """List the tightest half-space of every direction bin around the point: they bound what can be bounded."""
    assert inside.local_point is not None
    return np.setdiff1d(tightest_planes(planes, inside.local_point), rows)
