"""How much of a surface points do not face: `violation`, its certified minimum, and its field."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_choice, as_depth, as_nonnegative, as_points, as_positive, read_only
from voxkernel._core import StopFlag, least_violated, violated_weights, violation_cells
from voxkernel._threads import run_parts
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.grid import SparseGrid
from voxkernel.halfspaces import Domain, HalfSpaces, find_feasibility
from voxkernel.halfspaces.domain import surface_frame
from voxkernel.halfspaces.predicates import exact_slacks, planes_not_clear
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.polygons import used_vertices
from voxkernel.relaxed.facet_weights import UNITS, WeighedPlanes, halfspaces_of, relaxed_domain, weigh
from voxkernel.relaxed.root_cube import MIN_DEPTH, RootCube, root_cube
from voxkernel.voxels.relaxed_octree import cube_arrays

__all__ = ["StarCenter", "best_center", "center_of_planes", "violation", "violation_grid"]

_UNIT_ROUNDOFF = 2.0**-53
_THREAD_CHUNK = 1 << 15
_LEVELS = (12, 18, 26, 34, 42)
_COARSE_LEVELS = (6, 6, 7, 8, 9, *_LEVELS)
_COARSE = 512  # planes up to which the least violated points are often a plane, a line or a point
_MAX_CELLS = 2_000_000
_GAP = 1e-4
_MARGIN = 0.1

Weights = Literal["area", "count"] | ArrayLike


@dataclass(frozen=True, slots=True, repr=False)
class StarCenter:
    """The point that faces the most of a surface, and bounds on what it cannot face.

    Attributes
    ----------
    point : (3,) float64
        World coordinates, inside the domain.
    violation_bounds : (float, float)
        Certain bounds on the smallest violation in the domain, as a share of the whole weight. The upper
        one is reached at `point`, or within rounding of it where the least violated points fill no volume.
        Both are 0 exactly when the kernel is not empty.
    domain : Domain or None
        Where the point was looked for; None when a kernel was found without one.
    n_cells : int
        Octree cells looked at; 0 when the kernel is not empty.
    reason : str
        Why the bounds are further apart than asked for; "" when they are not.
    """

    point: NDArray[np.float64]
    violation_bounds: tuple[float, float]
    domain: Domain | None
    n_cells: int
    reason: str

    def __repr__(self) -> str:
        """Name the point and the bounds."""
        low, high = self.violation_bounds
        place = ", ".join(f"{v:.6g}" for v in self.point)
        return f"StarCenter(point=({place}), violation_bounds=({low:.6g}, {high:.6g}))"

    @property
    def gap(self) -> float:
        """Distance between the bounds."""
        return self.violation_bounds[1] - self.violation_bounds[0]

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers, ready for JSON."""
        return {
            "point": self.point.tolist(),
            "violation_bounds": list(self.violation_bounds),
            "domain": None if self.domain is None else self.domain.kind,
            "n_cells": self.n_cells,
            "reason": self.reason,
        }


def violation(
    surface: Any, points: ArrayLike, *, weights: Weights = "area", facets: Any = None, threads: int = 1
) -> NDArray[np.float64]:
    """Compute the share of a surface that points do not face.

    The violation of x is the weight of the facets with `n . x > d`, over the weight of all. It is 0 exactly
    in the kernel.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    points : (n, 3) array_like
        World coordinates.
    weights : {"area", "count"} or (k,) array_like
        What a facet counts: its area, 1, or the number >= 0 given for each facet id.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    threads : int
        Threads for large batches; the result does not depend on it.

    Returns
    -------
    (n,) float64
        In [0, 1]. Empty for n = 0.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the surface, the points or the weights cannot be used.

    Notes
    -----
    Every sign is exact for the doubles given; a point on a facet's plane does not violate it. Weights are
    rounded to 60 bits of their sum: the result is within (k + 1024) 2**-60 of the exact share, for k facets
    with the weights of `HalfSpaces.weights`, rounded once to a double. Points are divided like a kd-tree and
    each part keeps the planes that may cross it, so that a million points cost far less than a sweep.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section 2.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> voxkernel.violation(tetrahedron, [[0.1, 0.1, 0.1], [0.1, 0.1, -1.0]], weights="count")
    array([0.  , 0.25])
    """
    xyz = as_points("points", points)
    n_threads = as_depth("threads", threads, 1, 256)
    halfspaces, mesh = halfspaces_of(surface, facets)
    units = violated_units(weigh(halfspaces, weights, mesh=mesh), xyz, threads=n_threads)
    return units / UNITS


def violated_units(planes: WeighedPlanes, points: NDArray[np.float64], *, threads: int = 1) -> NDArray[np.int64]:
    """Add up the integer weights that points violate, every sign exact."""
    facets = planes.facets
    with np.errstate(over="ignore", invalid="ignore"):
        local = np.ascontiguousarray(facets.to_local(points).T)
    sums = np.zeros(len(points), np.int64)
    arrays = (
        local, points, facets.local_normals, facets.local_offsets, facets.local_errors, planes.weights,
        facets.corner_ids(), facets.vertices, _expansions_hold(facets.vertices) and _expansions_hold(points),
    )  # fmt: skip
    parts = _parts_of(local, max(1, min(4 * threads, len(points) // _THREAD_CHUNK)) if threads > 1 else 1)

    def run(part: NDArray[np.int64], stop: StopFlag) -> NDArray[np.int64]:
        return violated_weights(*arrays, part, sums, stop)

    for p, i in np.concatenate(run_parts(run, parts, threads)):
        a, b, c, d = facets.integer_planes([i])[0]
        x, y, z = facets.world_to_lattice([Fraction(float(v)) for v in points[p]])
        if a * x + b * y + c * z > d:
            sums[p] += planes.weights[i]
    return sums


def _expansions_hold(values: NDArray[np.float64]) -> bool:
    """Whether products of these coordinates neither overflow nor underflow in expansion arithmetic."""
    used = np.abs(values)
    if used.size == 0:
        return True
    return bool(used.max() <= 2.0**200 and np.min(used, where=used > 0, initial=1.0) >= 2.0**-200)


def _parts_of(local: NDArray[np.float64], count: int) -> list[NDArray[np.int64]]:
    """Divide points into slabs along their longest extent."""
    n = local.shape[1]
    if count == 1:
        return [np.arange(n)]
    axis = int(np.argmax(np.ptp(local, axis=1)))
    cuts = [n * k // count for k in range(1, count)]
    return np.split(np.argpartition(local[axis], cuts), cuts)


def best_center(
    surface: Any,
    *,
    gap: float | None = None,
    relative_gap: float | None = None,
    domain: Any = None,
    weights: Weights = "area",
    facets: Any = None,
) -> StarCenter:
    """Find the point that faces the most of a surface, with certain bounds on the smallest violation.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
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
    what its centre does. Whether the minimum is 0 is left to the exact kernel, for facets of positive weight.
    A minimum reached only on a plane, a line or a point is bracketed but may not be met; `reason` says so.

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
    default = _GAP if relative_gap is None else 0.0
    share = default if gap is None else min(1.0, as_positive("gap", gap))
    halfspaces, mesh = halfspaces_of(surface, facets)
    return center_of_planes(weigh(halfspaces, weights, mesh=mesh), mesh, domain, share, ratio)


def center_of_planes(
    planes: WeighedPlanes, mesh: TriangleMesh | None, domain: Any, gap: float, ratio: float = 0.0
) -> StarCenter:
    """Find the least violated point of weighed planes; `domain` is an argument or a Domain."""
    facets = planes.facets
    region = None
    if domain is not None or mesh is None or not planes.is_closed:
        region = relaxed_domain(planes.is_closed, mesh, domain)
    every = facets if region is None else facets.with_planes(region.normals, region.offsets)
    verdict = find_feasibility(every)
    if verdict.dimension >= 0:
        kernel = kernel_of_halfspaces(facets, region)
        return StarCenter(kernel.deepest_point, (0.0, 0.0), region, 0, "")
    # No point satisfies the witness, so one of its facets is always violated.
    held = [i for i in verdict.witnesses[0].ids if i < len(facets)]
    known = float(planes.shares[held].min()) if held else 0.0
    if region is None:
        region = relaxed_domain(planes.is_closed, mesh, None)
    point, best, lower, n_cells = _searched(planes, mesh, region, gap, ratio)
    low, high = planes.share_bounds(lower, best)
    low = min(high, max(low, known))
    close = high - low <= max(gap, ratio * high) + 4 * planes.slack / UNITS
    reason = "" if close else "the least violated points fill no volume, or more cells are needed than allowed"
    return StarCenter(read_only(point), (low, high), region, n_cells, reason)


def _searched(
    planes: WeighedPlanes, mesh: TriangleMesh | None, region: Domain, gap: float, ratio: float
) -> tuple[NDArray[np.float64], int, int, int]:
    """Search in rounds that go deeper, so that a flat minimum is not chased before the rest is seen."""
    axes = np.eye(3) if mesh is None else surface_frame(mesh)[1]
    cube = _skew_cube(region, axes)
    arrays = cube_arrays(planes, region, cube, _LEVELS[-1])
    blur = 8 * _UNIT_ROUNDOFF * (1.0 + float(np.abs(cube.corner).max()) / cube.edge)
    point = region.vertices.mean(axis=0)
    is_coarse = len(planes.facets) <= _COARSE
    seeds = point[None]
    if mesh is not None and is_coarse:
        seeds = np.concatenate([seeds, used_vertices(mesh.vertices, mesh.faces)])
    border = weigh(HalfSpaces.from_planes(region.normals, region.offsets))
    seeds = seeds[violated_units(border, seeds) == 0]
    best, lower, n_cells, close = int(planes.weights.sum()), 0, 0, int(gap * UNITS)
    if len(seeds):
        sums = violated_units(planes, seeds)
        point, best = seeds[np.argmin(sums)], int(sums.min())
    for levels in _COARSE_LEVELS if is_coarse else _LEVELS:
        unit, open_cell = np.full(3, np.nan), np.full(4, np.nan)
        # One unit more than is known lets the centre of a cell win over a seed on the surface.
        reached, lower, count = least_violated(
            *arrays, blur, best + 1, close, ratio, levels, _MAX_CELLS, unit, open_cell
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
        if best - lower <= max(close, int(ratio * best)) or count >= _MAX_CELLS:
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


def _skew_cube(region: Domain, axes: NDArray[np.float64]) -> RootCube:
    """Place a cube around the domain whose cells do not line up with planes at simple fractions of its size."""
    cube, _ = root_cube(region.vertices, axes)
    edge = cube.edge * 1.0860342
    shift = cube.edge * np.array([0.0398107, 0.0466301, 0.0321433])
    return RootCube(cube.corner - shift @ axes, edge, axes)


def violation_grid(
    surface: Any,
    *,
    depth: int = 6,
    tolerance: float | None = None,
    margin: float | None = None,
    domain: Any = None,
    frame: Literal["world", "principal"] = "world",
    facets: Any = None,
) -> SparseGrid:
    """Sample the violation near its minimum as a sparse field of floats.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    depth : int
        2**depth voxels along the bounding cube of the domain, 3 to 9.
    tolerance : float, optional
        Largest value that is kept, a share of the surface by area, in [0, 1].
    margin : float, optional
        Instead: how far that is above the smallest violation there is; 0.1 where neither is given.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        As for `best_center`.
    frame : {"world", "principal"}
        Grid axes: the world's, or the principal axes of the surface.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.

    Returns
    -------
    SparseGrid
        Float values: the violation at voxel centres in leaves, tiles where no facet plane crosses. Active
        where the centre is in the domain and the value is small enough; the background is 1.

    Raises
    ------
    ValueError
        If a number is out of range, or `tolerance` and `margin` are both given.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.

    Notes
    -----
    A picture of the field, not a bound: values are float32, and a plane within rounding of a voxel centre may
    count or not. 2 kB a leaf; the number of leaves grows 8x per level.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> field = voxkernel.violation_grid(tetrahedron, depth=4, tolerance=0.5, domain="box")
    >>> float(field.values_at([[1, 1, 1]])[0])
    0.0
    """
    if tolerance is not None and margin is not None:
        raise ValueError("`margin` must not be given together with `tolerance`; got both")
    as_choice("frame", frame, ("world", "principal"))
    levels = as_depth("depth", depth, MIN_DEPTH, 9)
    halfspaces, mesh = halfspaces_of(surface, facets)
    if mesh is None and frame == "principal":
        raise ValueError("`frame` must be 'world' for half-spaces; got 'principal'")
    planes = weigh(halfspaces)
    region = relaxed_domain(planes.is_closed, mesh, domain)
    if tolerance is None:
        least = center_of_planes(planes, mesh, region, _GAP).violation_bounds[1]
        share = least + (_MARGIN if margin is None else as_nonnegative("margin", margin))
    else:
        share = as_nonnegative("tolerance", tolerance)
    axes = np.eye(3) if mesh is None or frame == "world" else surface_frame(mesh)[1]
    cube, _ = root_cube(region.vertices, axes)
    normals, offsets, reach, pads, weights, n_domain = cube_arrays(planes, region, cube, levels)
    most = int(min(share, 1.0) * UNITS) + planes.slack
    arrays = violation_cells(
        normals, offsets, reach + pads * 2.0 ** (levels + 1), weights, n_domain, most, float(UNITS), levels
    )
    tile_ijk, tile_log2, tile_values, leaf_ijk, leaf_mask, leaf_values = arrays
    return SparseGrid.from_tiles_and_leaves(
        tile_ijk, tile_log2, leaf_ijk, leaf_mask, tile_values=tile_values, leaf_values=leaf_values, background=1.0,
        origin=cube.corner, linear=cube.axes.T * (cube.edge / 2**levels), name="violation",
    )  # fmt: skip
