"""The point that faces the most of a surface, with certified bounds: `best_center`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_positive, read_only
from voxkernel._core import least_violated
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.halfspaces import Domain, HalfSpaces, find_feasibility
from voxkernel.halfspaces.predicates import exact_slacks, planes_not_clear
from voxkernel.halfspaces.surface_arguments import SurfaceArgument, SurfaceLike, surface_argument
from voxkernel.large import StreamedSurface
from voxkernel.large.stream_mesh import reader_of
from voxkernel.relaxed.facet_weights import UNITS, WeighedPlanes, weigh
from voxkernel.relaxed.root_cube import RootCube, cube_frame, cube_planes
from voxkernel.relaxed.star_center import MAX_CELLS, StarCenter, skew_cube
from voxkernel.relaxed.streamed_center import streamed_center
from voxkernel.relaxed.violated_units import violated_units
from voxkernel.relaxed.violation import Weights

__all__ = ["GAP", "best_center", "center_of_planes"]

_UNIT_ROUNDOFF = 2.0**-53
_LEVELS = (12, 18, 26, 34, 42)
_COARSE_LEVELS = (6, 6, 7, 8, 9, *_LEVELS)
_COARSE = 512  # planes up to which the least violated points are often a plane, a line or a point
GAP = 1e-4


def best_center(
    surface: SurfaceLike | StreamedSurface,
    *,
    gap: float | None = None,
    relative_gap: float | None = None,
    domain: Any = None,
    weights: Weights = "area",
    facets: Any = None,
    threads: int = 1,
) -> StarCenter:
    """Find the point that faces the most of a surface, with certain bounds on the smallest violation.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces), HalfSpaces or StreamedSurface
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; half-spaces; or a surface of
        `stream_mesh`. Of more than 2**20 facets of a streamed one those that nearly agree are taken together, which
        leaves the bounds certain but farther apart.
    gap : float, optional
        Stop when the bounds are this close, as a share of the whole weight, > 0; 1e-4 where
        `relative_gap` is not given.
    relative_gap : float, optional
        Stop when they are this close as a share of the upper one, in (0, 1): for surfaces that are nearly
        star-shaped. With both, either is enough.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where the point may be: the convex hull of surfaces that bound a volume and a ball polytope about
        open ones by default.
    weights : {"area", "count"} or (k,) array_like
        As for `violation`.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    threads : int
        Threads of the search; the result does not depend on it.

    Returns
    -------
    StarCenter
        When the kernel is not empty, its deepest point and bounds of exactly (0, 0).

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the surface, the domain, a gap or the weights cannot be used.

    Notes
    -----
    Global, not a local search: branch and bound over octree cells in the principal frame of the surface, so
    that the point moves with it. A cell's lower bound is what all of it violates for certain, its upper one
    what its centre does. The cells of the lowest bound are divided first, up to 2 million cells, or as many planes as
    these have with 2,048 each: what is left open then bounds the minimum as well as it can. Beyond the half-spaces it
    takes less than 100 bytes a facet. Whether the minimum is 0 is left to the exact kernel, for facets of positive
    weight. A minimum reached only on a plane, a line or a point is bracketed but may not be met; `reason` says so.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> center = voxkernel.best_center(tetrahedron)
    >>> center.violation_bounds
    (0.0, 0.0)
    """
    ratio = 0.0 if relative_gap is None else as_positive("relative_gap", relative_gap)
    if ratio >= 1.0:
        raise ValueError(f"`relative_gap` must be below 1; got {ratio:g}")
    default = GAP if relative_gap is None else 0.0
    share = default if gap is None else min(1.0, as_positive("gap", gap))
    n_threads = as_depth("threads", threads, 1, 256)
    if isinstance(surface, StreamedSurface):
        reader = reader_of(surface, facets)
        return streamed_center(reader, domain, weights, share, ratio, center_of_planes, n_threads)
    found = surface_argument(surface, facets)
    planes = weigh(found.halfspaces, weights, mesh=found.mesh)
    return center_of_planes(planes, found, domain, share, ratio, threads=n_threads)


def center_of_planes(
    planes: WeighedPlanes, surface: SurfaceArgument, domain: Any, gap: float, ratio: float = 0.0, *, threads: int = 1
) -> StarCenter:
    """Find the least violated point of the weighed planes of a surface; `domain` is an argument or a Domain."""
    facets = planes.facets
    # The kernel of a closed surface needs no domain; whether there is one is known before its hull is made.
    is_inside = domain is None and surface.mesh is not None and surface.halfspaces.bounds_volume
    region = None if is_inside else surface.bounded_domain(domain)
    known = _least_of_witness(planes, region)
    if known is None:
        kernel = kernel_of_halfspaces(facets, region)
        return StarCenter(kernel.deepest_point, (0.0, 0.0), region, 0, "")
    if region is None:
        region = surface.bounded_domain(None)
    point, best, lower, n_cells = _searched(planes, surface, region, gap, ratio, threads)
    low, high = planes.share_bounds(lower, best)
    low = min(high, max(low, known))
    close = high - low <= max(gap, ratio * high) + 4 * planes.slack / UNITS
    reason = "" if close else "the least violated points fill no volume, or more cells are needed than allowed"
    return StarCenter(read_only(point), (low, high), region, n_cells, reason)


def _least_of_witness(planes: WeighedPlanes, region: Domain | None) -> float | None:
    """Share that every point violates, for there is a witness, one of whose facets it does; None where a kernel is."""
    facets = planes.facets
    verdict = find_feasibility(facets if region is None else facets.signs_with_planes(region.normals, region.offsets))
    if verdict.dimension >= 0:
        return None
    held = [i for i in verdict.witnesses[0].ids if i < len(facets)]
    return float(planes.shares[held].min()) if held else 0.0


def _searched(
    planes: WeighedPlanes, surface: SurfaceArgument, region: Domain, gap: float, ratio: float, threads: int
) -> tuple[NDArray[np.float64], int, int, int]:
    """Search in rounds that go deeper, so that a flat minimum is not chased before the rest is seen."""
    mesh = surface.mesh
    cube = skew_cube(region, surface.own_axes())
    facets, border = planes.facets, HalfSpaces.from_planes(region.normals, region.offsets)
    normals, offsets, _, pads = cube_planes(border, cube, _LEVELS[-1])
    arrays = (
        facets.local_normals, facets.local_offsets, facets.local_errors, planes.weights,
        cube_frame(facets, cube, _LEVELS[-1]), normals, offsets, pads,
    )  # fmt: skip
    blur = 8 * _UNIT_ROUNDOFF * (1.0 + float(np.abs(cube.corner).max()) / cube.edge)
    point = region.vertices.mean(axis=0)
    is_coarse = len(planes.facets) <= _COARSE
    seeds = point[None]
    if mesh is not None and is_coarse:
        seeds = np.concatenate([seeds, mesh.used_vertices])
    seeds = seeds[violated_units(weigh(border), seeds) == 0]
    best, lower, n_cells, close = int(planes.weights.sum()), 0, 0, int(gap * UNITS)
    if len(seeds):
        sums = violated_units(planes, seeds)
        point, best = seeds[np.argmin(sums)], int(sums.min())
    for levels in _COARSE_LEVELS if is_coarse else _LEVELS:
        unit, open_cell = np.full(3, np.nan), np.full(4, np.nan)
        # One unit more than is known lets the centre of a cell win over a seed on the surface.
        reached, lower, count, is_over = least_violated(
            *arrays, blur, best + 1, close, ratio, levels, MAX_CELLS, threads, unit, open_cell
        )
        n_cells += count
        if not np.isnan(unit).any():
            point = cube.to_world(unit)
            # Planes within rounding of the point were counted as violated: the exact sum may be smaller.
            best = min(best, reached, int(violated_units(planes, point[None])[0]))
        if best - lower <= max(close, int(ratio * best)):
            break
        flat = _meeting_point(planes, region, cube, open_cell) if is_coarse else None
        if flat is not None and flat[1] < best:
            point, best = flat
        if best - lower <= max(close, int(ratio * best)) or is_over:
            break
    return point, best, min(lower, best), n_cells


def _meeting_point(
    planes: WeighedPlanes, region: Domain, cube: RootCube, cell: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int] | None:
    """Find a point of a small cell on the inner side of all planes through it, and what it violates.

    Where the least violated points lie on a plane, a line or a point, no centre of a cell meets them. The
    point is exact; it is rounded only when it is returned.
    """
    if np.isnan(cell).any():
        return None
    facets = planes.facets
    middle, reach = cube.to_world(cell[:3]), cell[3] * cube.edge * (1.0 + 1e-6)
    near = np.abs(facets.normals @ middle - facets.offsets) <= 2.0 * reach
    sides = np.concatenate([cube.axes, -cube.axes])
    corner = facets.select(near).with_planes(region.normals, region.offsets).with_planes(sides, sides @ middle + reach)
    found = find_feasibility(corner)
    if found.point is None:
        return None
    exact = corner.lattice_to_world(found.point)
    lattice = facets.world_to_lattice(exact)
    ids = planes_not_clear(facets, lattice)
    violated = [i for i, s in zip(ids, exact_slacks(facets, ids, lattice), strict=True) if s < 0]
    return np.array([float(v) for v in exact]), int(planes.weights[violated].sum())
