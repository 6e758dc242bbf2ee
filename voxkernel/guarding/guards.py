"""A surface -> few points that see it, and what they provably see: `guards`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_choice, as_depth, as_points, as_positive, read_only
from voxkernel.guarding.bound import guard_bound
from voxkernel.guarding.certificate import middles_of
from voxkernel.guarding.clock import Clock, GuardsProgress
from voxkernel.guarding.cover import Cover
from voxkernel.guarding.measuring import CONFIDENCE, FRESH, Confirmed, Measured, measure
from voxkernel.guarding.result import Guards
from voxkernel.guarding.sight import Sight, look_at
from voxkernel.halfspaces.surface_arguments import SurfaceArgument, surface_argument
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.relaxed.best_center import center_of_planes
from voxkernel.relaxed.facet_weights import weigh

__all__ = ["guards"]

_MOST = 10_000
_MARGIN = 1.0  # of a search that goes on, see Confirmed
_GAP = 1e-3  # of the point that faces the most, one candidate of many where the kernel is empty


def guards(
    surface: MeshLike,
    *,
    coverage: float = 0.99,
    max_guards: int | None = None,
    candidates: ArrayLike | None = None,
    bound: bool = False,
    side: Literal["inside", "outside"] = "inside",
    distance: float | None = None,
    facets: Any = None,
    threads: int = 1,
    time_limit: float | None = None,
    progress: Callable[[GuardsProgress], object] | None = None,
    rng: int = 0,
) -> Guards:
    """Find few points that together see a surface, and measure, prove and bound what they see.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes, facets counter-clockwise seen from outside.
    coverage : float
        Share of the area of each body that its guards shall see, in (0, 1].
    max_guards : int, optional
        Stop at so many guards, 1 to 10,000.
    candidates : (n, 3) array_like, optional
        Take guards from these points only, such as places where a scanner can stand; found by the search by default.
    bound : bool
        Prove how many guards are needed at least, too; of closed surfaces seen from inside.
    side : {"inside", "outside"}
        "outside" looks at the outer side of a closed surface, from a shell around it: a scan plan.
    distance : float, optional
        Distance of the guards outside from the surface, mesh units, > 0; half the diagonal of the bounding box by
        default. Only for ``side="outside"``.
    facets : int array or bool mask, optional
        Restrict the surface to these facets; others hide nothing.
    threads : int
        Threads; the result does not depend on it, unless a time limit ends the search.
    time_limit : float, optional
        Seconds after which the best cover so far is returned with its numbers, > 0; what there was no time for is in
        `left_out` and in the `reason` of the bound.
    progress : callable, optional
        Called with a `GuardsProgress` while work goes on.
    rng : int
        Seed, >= 0: the same one gives the same guards.

    Returns
    -------
    Guards
        A coverage that is not reached is a result with a `reason`, not an error.

    Raises
    ------
    MeshError, MeshReadError, TypeError
        If the surface cannot be used, or has no inner side: neighbours disagree, or the enclosed volume is not > 0.
    ValueError
        If an option is out of range, or `bound` is asked of an open surface or from outside.

    Notes
    -----
    A point sees a spot of a facet when it is strictly on the inner side of the facet and no other facet meets the
    segment between them. Every facet hides what is behind it, whatever its orientation: an inner shell hides what it
    encloses, and facets of a surface that crosses itself hide each other as they lie; guards inside are where the
    surface goes around at least once. A shell inside that faces inwards is a cavity, and its facets are seen by the
    guards of the body around it; one that faces outwards is a body of its own, with guards of its own.

    Guards of an open surface lie in the ball that is its default domain; it is one body, and so is what is seen from
    outside.

    Samples of the area, candidates (the point of `best_center`, middles of chords, a lattice, points in sight of what
    is unseen), a greedy cover, exchange and moves; accepted only when fresh samples confirm it. Where the last
    measurement does not, the search goes on once with a margin, and other samples measure what it found. The point of
    `best_center` is the only guard where the kernel is not empty and holds a point that doubles can name. `certified`
    counts facets f for which no facet enters the hull of f and the guard: separating planes, decided exactly.

    Examples
    --------
    >>> import voxkernel
    >>> from voxkernel.demo_shapes import torus
    >>> found = voxkernel.guards(torus(n_major=24, n_minor=12), coverage=0.9)
    >>> len(found), found.is_reached, found.certified <= found.seen_bounds[1]
    (2, True, True)
    """
    share = as_positive("coverage", coverage)
    if share > 1.0:
        raise ValueError(f"`coverage` must be in (0, 1]; got {share:g}")
    most = _MOST if max_guards is None else as_depth("max_guards", max_guards, 1, _MOST)
    as_choice("side", side, ("inside", "outside"))
    n_threads = as_depth("threads", threads, 1, 256)
    limit = None if time_limit is None else as_positive("time_limit", time_limit)
    seed = as_depth("rng", rng, 0, 2**63 - 1)
    given = None if candidates is None else as_points("candidates", candidates)
    if given is not None and not len(given):
        raise ValueError("`candidates` must hold at least one point; got 0")
    if distance is not None and side == "inside":
        raise ValueError("`distance` must be left out with `side` 'inside'; got a number")
    clock = Clock(limit, progress)
    mesh = as_mesh(surface, facets=facets)
    argument = surface_argument(mesh)
    closed = argument.halfspaces.bounds_volume
    if side == "outside" and not closed:
        raise ValueError("`side` must be 'inside' for an open surface; got 'outside'")
    if bound and (side == "outside" or not closed):
        raise ValueError("`bound` must be False for open surfaces and from outside; got True")
    sight = look_at(mesh, argument.halfspaces, side, n_threads)
    away = 0.0
    if side == "outside":
        away = 0.5 * sight.diagonal
        if distance is not None:
            away = float(np.ldexp(as_positive("distance", distance), -sight.exponent))
    search, fresh = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
    covers: dict[int, Cover] = {}

    def attempt(margin: float) -> tuple[_Found, Measured, bool]:
        found = _searched(sight, argument, share, most, given, away, search, clock, covers, margin)
        measured = measure(sight, found.points, fresh, clock)
        is_all = measured.seen == 1.0 and measured.n_samples == FRESH and not found.reason
        return found, measured, measured.bounds[0] >= share or is_all

    found, measured, is_reached = attempt(0.0)
    if not (is_reached or found.reason or clock.is_over):
        found, measured, is_reached = attempt(_MARGIN)
    reason = found.reason
    if not is_reached and not reason:
        reason = f"the {measured.n_samples:,} fresh samples do not confirm it: {measured.seen:.6g} are seen"
    result = Guards(
        points=read_only(sight.to_world(found.points)), seen=measured.seen, seen_bounds=measured.bounds,
        confidence=CONFIDENCE, n_samples=measured.n_samples, certified=measured.certified, facing_bound=measured.facing,
        first_seen=read_only(_of_all_faces(sight, mesh, measured.middles)), bodies=read_only(found.bodies),
        coverage=share, is_reached=is_reached, reason="" if is_reached else reason, side=side,
        left_out=f"the time limit is over: {measured.left_out}" if measured.left_out else "",
        distance=float(np.ldexp(away, sight.exponent)), bound=None, parts=measured.parts, mesh=mesh,
    )  # fmt: skip
    if not bound:
        return result
    from dataclasses import replace

    clock.tell("bound")
    n_found = len(found.points) if is_reached else 1 << 30
    return replace(result, bound=guard_bound(sight, share, np.random.default_rng([seed, 2]), clock, n_found))


class _Found(NamedTuple):
    points: NDArray[np.float64]
    bodies: NDArray[np.int64]
    reason: str


def _searched(
    sight: Sight, argument: SurfaceArgument, coverage: float, most: int, given: NDArray[np.float64] | None,
    distance: float, rng: np.random.Generator, clock: Clock, covers: dict[int, Cover], margin: float,
) -> _Found:  # fmt: skip
    """Search the bodies one after the other, the largest first; go on with the covers that are there."""
    points: list[NDArray[np.float64]] = []
    owners: list[int] = []
    reasons: list[str] = []
    local = None if given is None else sight.to_local(given)
    elsewhere = ""
    if local is not None:
        may_stand = sight.allowed(local)
        if not may_stand.all():
            elsewhere = f"{int((~may_stand).sum())} of {len(local)} `candidates` are not where guards may be"
        local = local[may_stand]
    areas = np.bincount(sight.bodies, sight.areas, sight.n_bodies)
    for body in np.argsort(-areas, kind="stable").tolist():
        faces = np.flatnonzero(sight.bodies == body)
        if len(points) >= most or (points and clock.is_over):
            why = "max_guards" if len(points) >= most else "time limit"
            reasons.append(_words(why, most, 0.0, sight, faces, points))
            continue
        if body not in covers:
            first = _first_points(sight, argument, body) if local is None else np.zeros((0, 3))
            covers[body] = Cover(sight, faces, first, local, distance, rng, clock)
        cover = covers[body]
        confirm = Confirmed(sight, faces, coverage, margin, rng, clock)
        why = cover.run(coverage, most - len(points), confirm)
        cover.sort()
        points += cover.points
        owners += [body] * len(cover.points)
        if why:
            reasons.append(_words(why, most, cover.share, sight, faces, cover.points))
    if reasons and elsewhere:
        reasons.insert(0, elsewhere)
    kept = np.array(points).reshape(-1, 3)
    return _Found(kept, np.array(owners, np.int64), "; ".join(dict.fromkeys(reasons)))


def _first_points(sight: Sight, argument: SurfaceArgument, body: int) -> NDArray[np.float64]:
    """The point that faces the most of a body, where guards may be."""
    if sight.side == "outside":
        return np.zeros((0, 3))
    part = argument
    if sight.n_bodies > 1:
        mesh = argument.mesh
        assert mesh is not None
        rows = sight.face_ids[sight.bodies == body]
        part = surface_argument(TriangleMesh.from_triangles(mesh.vertices, mesh.faces[rows]))
    center = center_of_planes(weigh(part.halfspaces), part, None, _GAP)
    point = sight.to_local(center.point[None])
    return point if center.violation_bounds[1] == 0.0 else point[sight.allowed(point)]


def _of_all_faces(sight: Sight, mesh: TriangleMesh, middles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces without area are seen by none."""
    found = np.full(len(mesh.faces), -1, np.int64)
    found[sight.face_ids] = middles
    return found


def _words(
    why: str, most: int, share: float, sight: Sight, faces: NDArray[np.int64], points: list[NDArray[np.float64]]
) -> str:
    """Why a body is not covered, in words."""
    reached = f"{100.0 * share:.4g} % of the samples of a body of {len(faces)} facets are seen"
    if why == "max_guards":
        return f"`max_guards` is {most}: {reached}"
    if why == "time limit":
        return f"the time limit is over: {reached}"
    middles = middles_of(sight).some(faces)
    dark = int((sight.first_seen(np.array(points).reshape(-1, 3), middles) < 0).sum())
    return f"{reached}, and no point that was tried sees more: {dark} facets are too thin inside, or hidden by others"
