"""Half-spaces to several relaxed kernels at once, as multi-resolution voxel grids: `voxel_kernels`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_each, as_nonnegative, as_positive, as_share
from voxkernel.grid import SparseGrid
from voxkernel.halfspaces import Domain, find_feasibility
from voxkernel.halfspaces.surface_arguments import Frame, SurfaceArgument, SurfaceLike, surface_argument
from voxkernel.relaxed.best_center import GAP, center_of_planes
from voxkernel.relaxed.facet_weights import WeighedPlanes, weigh
from voxkernel.relaxed.root_cube import MIN_DEPTH, RootCube, root_cube
from voxkernel.voxels.kernel_grid import KernelGrid
from voxkernel.voxels.relaxed_octree import RelaxedCells, relaxed_cells_of

__all__ = [
    "RTOL_MAX_DEPTH", "Step", "as_step", "relaxed_kernels", "still_apart", "voxel_kernels", "wrap_relaxed", "wrapped",
]

RTOL_MAX_DEPTH = 12

Step = tuple[int | None, float | None, float | None]
"""`depth`, `voxel_size` and `rtol`, at most one of them given."""


def voxel_kernels(
    surface: SurfaceLike,
    *,
    tolerances: Sequence[float] | NDArray[np.float64] | None = None,
    margins: Sequence[float] | NDArray[np.float64] | None = None,
    depth: int | None = None,
    voxel_size: float | None = None,
    rtol: float | None = None,
    domain: Any = None,
    frame: Frame = "world",
    facets: Any = None,
    threads: int = 1,
) -> tuple[KernelGrid, ...]:
    """Compute several relaxed kernels of a surface in one traversal, as sparse voxel grids on the same voxels.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    tolerances : sequence of float
        Shares of the surface, by area, that a point may not face, in [0, 1]; one kernel each.
    margins : sequence of float
        Instead of `tolerances`: how far they are above the smallest violation there is, `best_center`'s upper
        bound (found to 1e-4), >= 0.
    depth, voxel_size, rtol, frame, facets, threads : optional
        As for `voxel_kernel`; `rtol` is kept by all kernels.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where the kernels are looked for, also that of tolerance 0: the convex hull of closed surfaces, the ball
        about open ones by default.

    Returns
    -------
    tuple of KernelGrid
        One for each tolerance or margin, in that order.

    Raises
    ------
    ValueError
        If none or both of `tolerances` and `margins` are given; as `voxel_kernel`.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used, or a number is given instead of a sequence.

    Notes
    -----
    Cells are shared: a region is divided while any of the kernels is undecided on it. Each kernel is that of
    `voxel_kernel` with its tolerance in the same domain.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> strict, loose = voxkernel.voxel_kernels(tetrahedron, tolerances=[0.0, 0.4], depth=6, domain="box")
    >>> strict.volume_bounds[1] < loose.volume_bounds[0]
    True
    """
    step = as_step(depth, voxel_size, rtol)
    n_threads = as_depth("threads", threads, 1, 256)
    if (tolerances is None) == (margins is None):
        got = "neither" if tolerances is None else "both"
        raise ValueError(f"`tolerances` or `margins` must be given, not both; got {got}")
    if margins is None:
        numbers = as_each("tolerances", tolerances, as_share)
    else:
        numbers = as_each("margins", margins, as_nonnegative)
    found = surface_argument(surface, facets)
    return relaxed_kernels(found, numbers, margins is not None, domain, found.axes(frame), step, n_threads)


def as_step(depth: int | None, voxel_size: float | None, rtol: float | None) -> Step:
    """Check that at most one of them is given; the root cube checks the numbers of the first two."""
    if sum(v is not None for v in (depth, voxel_size, rtol)) > 1:
        raise ValueError("`depth`, `voxel_size` and `rtol` must not be given together; got more than one")
    return depth, voxel_size, None if rtol is None else as_positive("rtol", rtol)


def relaxed_kernels(
    surface: SurfaceArgument, numbers: Sequence[float], above_least: bool, domain: Any,
    axes: NDArray[np.float64], step: Step, threads: int,
) -> tuple[KernelGrid, ...]:  # fmt: skip
    """Compute the relaxed kernels of tolerances, or of margins above the least violation."""
    planes = weigh(surface.halfspaces)
    region = surface.bounded_domain(domain)
    shares = list(numbers)
    if above_least:
        least = center_of_planes(planes, surface, region, GAP).violation_bounds[1]
        shares = [min(1.0, least + m) for m in numbers]
    return _relaxed(planes, region, shares, axes, step, threads)


def _relaxed(
    planes: WeighedPlanes, region: Domain, shares: list[float], axes: NDArray[np.float64],
    step: Step, threads: int,
) -> tuple[KernelGrid, ...]:  # fmt: skip
    """Run the octree of relaxed kernels, deeper until the bounds agree where that is asked for."""
    depth, voxel_size, rtol = step
    dimension = find_feasibility(planes.facets.with_planes(region.normals, region.offsets)).dimension
    cube, levels = root_cube(region.vertices, axes, depth=depth, voxel_size=voxel_size)
    reason = ""
    if rtol is not None:
        levels = MIN_DEPTH
    cells = relaxed_cells_of(planes, region, cube, levels, shares, threads=threads)
    while rtol is not None and (apart := max(c.n_boundary / max(1, c.n_inside + c.n_boundary) for c in cells)) > rtol:
        if levels == RTOL_MAX_DEPTH:
            reason = still_apart(apart)
            break
        levels += 1
        cells = relaxed_cells_of(planes, region, cube, levels, shares, threads=threads)
    return tuple(
        wrap_relaxed(c, share, cube, levels, dimension, region, reason) for c, share in zip(cells, shares, strict=True)
    )


def wrap_relaxed(
    cells: RelaxedCells, share: float, cube: RootCube, depth: int, dimension: int, region: Domain, reason: str
) -> KernelGrid:
    """Make a result of the cells of one relaxed kernel."""
    volume = (cube.edge / 2**depth) ** 3
    bounds = cells.n_inside * volume * (1 - 1e-14), (cells.n_inside + cells.n_boundary) * volume * (1 + 1e-14)
    if not cells.n_inside + cells.n_boundary:
        reason = f"every point of the domain violates more than {share:.6g} of the surface"
    arrays = cells.tile_ijk, cells.tile_log2, cells.leaf_ijk, cells.leaf_inside, cells.leaf_boundary
    return wrapped(dimension, region, cube, depth, arrays, bounds, reason, share)


def wrapped(
    dimension: int, domain: Domain | None, cube: RootCube, depth: int, arrays: tuple[Any, ...],
    bounds: tuple[float, float], reason: str, tolerance: float = 0.0,
) -> KernelGrid:  # fmt: skip
    """Make a result of what an octree gives back."""
    tile_ijk, tile_log2, leaf_ijk, leaf_inside, leaf_boundary = arrays
    linear = cube.axes.T * (cube.edge / 2**depth)
    make = SparseGrid.from_tiles_and_leaves
    inside = make(tile_ijk, tile_log2, leaf_ijk, leaf_inside, origin=cube.corner, linear=linear, name="inside")
    no_tiles = np.empty((0, 3), np.int32), np.empty(0, np.int8)
    boundary = make(*no_tiles, leaf_ijk, leaf_boundary, origin=cube.corner, linear=linear, name="boundary")
    return KernelGrid(inside, boundary, depth, bounds, dimension, domain, reason, tolerance)


def still_apart(share: float) -> str:
    """Say that `rtol` was not reached."""
    return f"the bounds still differ by {share:.2g} at depth {RTOL_MAX_DEPTH}, the largest for `rtol`"
