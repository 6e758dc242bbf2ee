"""The exact kernel of a streamed surface: what can matter is kept, the rest of this folder finishes on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.exact.assembly import empty_kernel, polytope_of
from voxkernel.exact.certificate import Proof
from voxkernel.exact.dual_hull import Polyhedron, polyhedron_around
from voxkernel.exact.inner_point import inner_point
from voxkernel.exact.kernel_polytope import KernelPolytope
from voxkernel.exact.kernel_shape import Shape, flat_shape, solid_shape
from voxkernel.exact.meeting_points import RationalPoint
from voxkernel.halfspaces import Domain, Feasibility, HalfSpaces
from voxkernel.halfspaces.predicates import exact_slacks
from voxkernel.halfspaces.surface_arguments import EXACT
from voxkernel.large.plane_tasks import Rows
from voxkernel.large.streamed_feasibility import find_streamed_feasibility, sampled_witness
from voxkernel.large.streamed_planes import StreamedPlanes
from voxkernel.large.surface_reader import SurfaceReader

__all__ = ["streamed_kernel"]

# Up to so many planes all may stay; above, half of them.
_SMALL = 100
_BYTES = 700  # that a facet takes in memory while its kernel is found: measured with a ball of 320,000

InMemory = Callable[[HalfSpaces, Domain | None], KernelPolytope]


class _Kept(NamedTuple):
    """Planes that stay: their rows, all of them, those of the facets alone, and what is known of their common part."""

    found: Rows
    planes: HalfSpaces
    own: HalfSpaces
    inside: Feasibility


def streamed_kernel(surface: SurfaceReader, domain: Any, in_memory: InMemory) -> KernelPolytope:
    """Compute the kernel of a stream; `in_memory` does it where most facets stay.

    Notes
    -----
    The same working set with the same numbers leads to the same deep point as in memory. What the tightest planes of
    every direction leave around it decides which planes are kept; of these the kernel is found, and its corners are
    held against all planes in one more pass.
    """
    own = StreamedPlanes(surface)
    if domain is None:
        sampled = sampled_witness(own)
        if sampled is not None:
            return _empty(own, None, sampled, sampled)
    region = surface.domain(domain, EXACT)
    planes = own.in_domain(region)
    inside = find_streamed_feasibility(planes)
    unclipped = inside if region is None else _without_domain(own, planes, inside)
    if inside.dimension < 0:
        return _empty(planes, region, inside, unclipped)
    found = _solid(planes, inside) if inside.dimension == 3 else _flat(planes, inside)
    if found is None:
        n = surface.facts().n_facets
        text = f"most of {n:,} facets may bound the kernel: it is found in memory, about {n * _BYTES / 1e6:,.1f} MB"
        surface.note("memory", text)
        return in_memory(_in_memory(surface, text), region)
    shape, kept = found
    cut = region is not None and _is_cut(own, region, unclipped, inside, shape, kept)
    proof = Proof(kept.planes, kept.inside, shape.corners, is_own=True)
    alone = proof if region is None else _prove_unclipped(own, unclipped, kept)
    return polytope_of(shape, region, cut, not cut or _is_bounded(surface), proof, alone)


def _in_memory(surface: SurfaceReader, text: str) -> HalfSpaces:
    try:
        return HalfSpaces.from_mesh(surface.to_mesh())
    except MemoryError:
        raise MemoryError(f"`surface` must fit in memory: {text}") from None


def _empty(
    planes: StreamedPlanes, region: Domain | None, inside: Feasibility, unclipped: Feasibility
) -> KernelPolytope:
    """An empty kernel with its witness; without a domain it is none of an open surface either."""
    own = StreamedPlanes(planes.surface)
    kept = _keep(planes, planes.rows(_named(inside)), inside)
    proof = Proof(kept.planes, kept.inside, (), is_own=True)
    alone = proof if region is None else _prove_unclipped(own, unclipped, None)
    bounded = unclipped.dimension < 0 or _is_bounded(planes.surface)
    return empty_kernel(region, unclipped.dimension >= 0, bounded, proof, alone)


def _named(inside: Feasibility) -> NDArray[np.int64]:
    """Rows that an answer names."""
    ids = [np.array(w.ids, np.int64) for w in inside.witnesses]
    return np.unique(np.concatenate([inside.working_set, *ids]))


def _keep(planes: StreamedPlanes, found: Rows, inside: Feasibility) -> _Kept:
    """Make half-spaces of some rows, with all planes of the domain after them, and say all in their numbers."""
    n = planes.n_facet_planes
    mine = found.part(found.rows < n)
    own = replace(planes.halfspaces(mine), bounds_volume=planes.surface.is_known_to_bound_volume)
    every = own if planes.given_rows is None else own.with_planes(*planes.given_rows)

    def renumbered(rows: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.where(rows < n, np.searchsorted(mine.rows, rows), len(own) + rows - n)

    witnesses = tuple(
        replace(w, ids=tuple(renumbered(np.array(w.ids, np.int64)).tolist())) for w in inside.witnesses
    )
    working_set = np.unique(renumbered(inside.working_set))
    known = replace(inside, halfspaces=every, witnesses=witnesses, working_set=working_set)
    return _Kept(mine, every, own, known)


def _solid(planes: StreamedPlanes, inside: Feasibility) -> tuple[Shape, _Kept] | None:
    """The shape of a solid, and the planes it was made of; None where most planes stay."""
    assert inside.local_point is not None
    most = len(planes) if len(planes) <= _SMALL else len(planes) // 2
    found = planes.rows(_named(inside)).joined(planes.tightest(inside.local_point, stage="tighten").found)
    kept = _keep(planes, found, inside)
    outer = _around(kept)
    if outer is None:
        return None
    margin = 1e-9 * outer.extent + outer.reach
    near = planes.reaching(outer.center, outer.vertices, margin, most=most, stage="cull")
    while near is not None:
        found = found.joined(near)
        kept = _keep(planes, found, inside)
        solid = _around(kept)
        if solid is None:
            return None
        near = planes.reaching(solid.center, solid.vertices, solid.reach, most=most, stage="check")
        if near is not None and np.isin(near.rows, found.rows).all():
            shape = solid_shape(kept.planes, kept.inside)
            return None if shape is None else (shape, kept)
    return None


def _around(kept: _Kept) -> Polyhedron | None:
    """What the planes that stay leave around the deep point; None where it has no end."""
    return polyhedron_around(kept.planes, inner_point(kept.planes, kept.inside), np.arange(len(kept.planes)))


def _flat(planes: StreamedPlanes, inside: Feasibility) -> tuple[Shape, _Kept] | None:
    """The same for a point, a segment or a flat polygon."""
    assert inside.local_point is not None
    most = max(_SMALL, len(planes) // 2)
    found = planes.rows(_named(inside)).joined(planes.tightest(inside.local_point, stage="tighten").found)
    while True:
        kept = _keep(planes, found, inside)
        shape = flat_shape(kept.planes, kept.inside)
        if shape is None:
            return None
        vertices = np.array([kept.planes.from_lattice(corner) for corner in shape.corners])
        center = vertices.mean(axis=0)
        margin = 2.0**-48 * (1.0 + float(np.abs(vertices).max()))
        near = planes.reaching(center, vertices - center, margin, most=most, stage="check")
        if near is None:
            return None
        fresh = near.part(~np.isin(near.rows, found.rows))
        others = planes.halfspaces(fresh)
        slacks = [exact_slacks(others, range(len(others)), corner) for corner in shape.corners]
        cutting = [i for i in range(len(others)) if any(line[i] < 0 for line in slacks)]
        if not cutting:
            return shape, kept
        found = found.joined(fresh.part(np.array(cutting)))


def _without_domain(own: StreamedPlanes, planes: StreamedPlanes, inside: Feasibility) -> Feasibility:
    """What is known without the domain: of a solid kernel the same, of any other it is asked again."""
    if inside.dimension < 3:
        return find_streamed_feasibility(own)
    rows = inside.working_set[inside.working_set < own.n_facet_planes]
    point = inside.exact_point
    if point is not None:
        point = own.given.world_to_lattice(planes.given.lattice_to_world(point))
    return replace(inside, halfspaces=own, exact_point=point, working_set=rows)


def _is_bounded(surface: SurfaceReader) -> bool:
    """Whether a kernel that is not empty is bounded, decided exactly."""
    if surface.bounds_volume:
        return True
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    return find_streamed_feasibility(StreamedPlanes(surface, cube, np.ones(6), is_cone=True)).dimension == 0


def _is_cut(
    own: StreamedPlanes, domain: Domain, unclipped: Feasibility, inside: Feasibility, shape: Shape, kept: _Kept
) -> bool:
    """Whether a part of the kernel lies beyond one of the planes of the domain, as in memory."""
    if inside.dimension != unclipped.dimension:
        return True
    if inside.dimension == 3:
        return bool((shape.rows >= len(kept.own)).any())
    outer = HalfSpaces.from_planes(domain.normals, domain.offsets)
    reach = 1e-9 * max(own.scale, float(np.abs(shape.vertices - own.given.origin).max()))
    height = outer.normals @ shape.vertices.T - outer.offsets[:, None]
    for j in np.flatnonzero(height.max(axis=1) >= -reach).tolist():
        beyond = own.with_planes(-domain.normals[j : j + 1], -domain.offsets[j : j + 1])
        found = find_streamed_feasibility(beyond)
        if found.point is not None and exact_slacks(beyond.given, [0], found.point)[0] > 0:
            return True
    return False


def _prove_unclipped(own: StreamedPlanes, unclipped: Feasibility, kept: _Kept | None) -> Proof:
    """What proves the dimension without the domain; points that span a flat kernel are found near its own."""
    rows = own.rows(_named(unclipped))
    if unclipped.dimension == 3 and kept is not None:
        rows = rows.joined(kept.found)
    mine = _keep(own, rows, unclipped)
    corners: list[RationalPoint] = []
    if 0 <= unclipped.dimension < 3:
        point = unclipped.point
        assert point is not None
        corners.append(point)
        unit = Fraction(own.scale) * own.lattice_unit
        for w in unclipped.directions:
            step = unit / max(map(abs, w))
            while True:
                x, y, z = (u + step * v for u, v in zip(point, w, strict=True))
                if not len(own.touched_and_violated((x, y, z))[1]):
                    break
                step /= 4096
            corners.append((x, y, z))
    return Proof(mine.planes, mine.inside, tuple(corners), is_own=True)
