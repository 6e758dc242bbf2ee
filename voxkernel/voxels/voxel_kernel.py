"""Half-spaces to a multi-resolution voxel grid of the kernel: `voxel_kernel`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_nonnegative, as_positive
from voxkernel._core import exact_cells
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.grid import SparseGrid
from voxkernel.halfspaces import Domain, HalfSpaces, find_feasibility
from voxkernel.halfspaces.domain import surface_frame
from voxkernel.halfspaces.surface_arguments import halfspaces_of, relaxed_domain, resolve_surface
from voxkernel.mesh import as_mesh
from voxkernel.relaxed.best_center import center_of_planes
from voxkernel.relaxed.facet_weights import WeighedPlanes, weigh
from voxkernel.relaxed.root_cube import DEFAULT_DEPTH, MIN_DEPTH, RootCube, cube_planes, root_cube
from voxkernel.voxels.kernel_grid import KernelGrid
from voxkernel.voxels.relaxed_octree import RelaxedCells, relaxed_cells_of

__all__ = ["voxel_kernel"]

_RTOL_MAX_DEPTH = 12
_CENTER_GAP = 1e-4

Frame = Literal["world", "principal"]


@overload
def voxel_kernel(
    surface: Any,
    *,
    depth: int | None = None,
    voxel_size: float | None = None,
    rtol: float | None = None,
    tolerance: float = 0.0,
    margin: float | None = None,
    domain: Any = None,
    frame: Frame = "world",
    facets: Any = None,
    threads: int = 1,
) -> KernelGrid: ...


@overload
def voxel_kernel(
    surface: Any,
    *,
    depth: int | None = None,
    voxel_size: float | None = None,
    rtol: float | None = None,
    tolerance: Sequence[float] | NDArray[np.float64],
    margin: None = None,
    domain: Any = None,
    frame: Frame = "world",
    facets: Any = None,
    threads: int = 1,
) -> tuple[KernelGrid, ...]: ...


@overload
def voxel_kernel(
    surface: Any,
    *,
    depth: int | None = None,
    voxel_size: float | None = None,
    rtol: float | None = None,
    tolerance: float = 0.0,
    margin: Sequence[float] | NDArray[np.float64],
    domain: Any = None,
    frame: Frame = "world",
    facets: Any = None,
    threads: int = 1,
) -> tuple[KernelGrid, ...]: ...


def voxel_kernel(
    surface: Any,
    *,
    depth: int | None = None,
    voxel_size: float | None = None,
    rtol: float | None = None,
    tolerance: Any = 0.0,
    margin: Any = None,
    domain: Any = None,
    frame: Frame = "world",
    facets: Any = None,
    threads: int = 1,
) -> KernelGrid | tuple[KernelGrid, ...]:
    """Compute the kernel of a surface, exact or relaxed, as a sparse voxel grid with certain volume bounds.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    depth : int, optional
        2**depth voxels along the root cube, which is the bounding cube of the surface or of the domain;
        3 to 20, 7 by default.
    voxel_size : float, optional
        Edge of a voxel, mesh units, instead of `depth`.
    rtol : float, optional
        Refine until the volume bounds differ by at most this share of the upper one, instead of
        `depth`; the root cube of an exact kernel is then its bounding cube. At most depth 12.
    tolerance : float or sequence of float
        Share of the surface, by area, that a point may not face: the kernel is `{x : violation(x) <=
        tolerance}`. In [0, 1]; 0 is the exact kernel. Several are found in one traversal.
    margin : float or sequence of float, optional
        Instead of `tolerance`: how far it is above the smallest violation there is, `best_center`'s
        upper bound (found to 1e-4), >= 0. Several are found in one traversal.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where the kernel is looked for. As for `exact_kernel` when the tolerance is 0. Relaxed kernels of
        closed surfaces would leak outside: they have the convex hull by default, open ones the ball.
    frame : {"world", "principal"}
        Grid axes: the world's, or the principal axes of the surface, so that the grid moves with it.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    threads : int
        Threads for relaxed kernels; the result does not depend on it.

    Returns
    -------
    KernelGrid, or tuple of KernelGrid
        Empty when the kernel is empty. A sequence of tolerances or margins gives one grid each, in that
        order, on the same voxels.

    Raises
    ------
    ValueError
        If more than one of `depth`, `voxel_size` and `rtol` is given, or one is out of range; `margin` with
        a tolerance; half-spaces without a domain and with a tolerance.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.

    Notes
    -----
    A cell carries the half-spaces that are undecided on it and the weight that all of it violates; it is
    dropped when that is more than the tolerance, becomes a tile when it stays within it with all undecided
    ones added, and is split otherwise. The number of cells grows 4x per level, with the surface of the kernel.
    A relaxed kernel costs about 2x per level, because the lists halve. Areas are rounded to 60 bits of their
    sum, and bounds allow for that: where the violation of a region is the tolerance to 1e-15, it stays undecided.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section 3.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> grid = voxkernel.voxel_kernel(tetrahedron, depth=6)
    >>> low, high = grid.volume_bounds
    >>> low < 1 / 6 < high
    True
    >>> relaxed = voxkernel.voxel_kernel(tetrahedron, depth=6, tolerance=0.4, domain="box")
    >>> relaxed.volume_bounds[0] > high
    True
    """
    if sum(v is not None for v in (depth, voxel_size, rtol)) > 1:
        raise ValueError("`depth`, `voxel_size` and `rtol` must not be given together; got more than one")
    if frame not in ("world", "principal"):
        raise ValueError(f"`frame` must be 'world' or 'principal'; got {frame!r}")
    n_threads = as_depth("threads", threads, 1, 256)
    shares = _shares("tolerance", tolerance)
    if max(shares) > 1.0:
        raise ValueError(f"`tolerance` must be at most 1, the whole surface; got {max(shares):g}")
    if margin is not None and (np.ndim(tolerance) or shares != [0.0]):
        raise ValueError("`margin` must not be given together with `tolerance`; got both")
    margins = None if margin is None else _shares("margin", margin)
    mesh = None if isinstance(surface, HalfSpaces) else as_mesh(surface, facets=facets)
    if mesh is None and frame == "principal":
        raise ValueError("`frame` must be 'world' for half-spaces; got 'principal'")
    axes = np.eye(3) if frame == "world" or mesh is None else surface_frame(mesh)[1]
    step = depth, voxel_size, None if rtol is None else as_positive("rtol", rtol)
    if margins is None and not np.ndim(tolerance) and shares == [0.0]:
        return _exact(surface if mesh is None else mesh, facets if mesh is None else None, domain, axes, *step)
    halfspaces, _ = halfspaces_of(surface if mesh is None else mesh, facets if mesh is None else None)
    planes = weigh(halfspaces)
    region = relaxed_domain(planes.is_closed, mesh, domain)
    if margins is not None:
        least = center_of_planes(planes, mesh, region, _CENTER_GAP).violation_bounds[1]
        shares = [min(1.0, least + m) for m in margins]
    grids = _relaxed(planes, region, shares, axes, step, n_threads)
    return grids if np.ndim(tolerance) or (margin is not None and np.ndim(margin)) else grids[0]


def _shares(name: str, given: Any) -> list[float]:
    """Check one share or several."""
    values = [as_nonnegative(name, v) for v in np.atleast_1d(np.asarray(given, dtype=object)).ravel()]
    if not values:
        raise ValueError(f"`{name}` must hold at least one number; got none")
    return values


def _exact(
    surface: Any, facets: Any, domain: Any, axes: NDArray[np.float64],
    depth: int | None, voxel_size: float | None, rtol: float | None,
) -> KernelGrid:  # fmt: skip
    """Run the octree of convex kernels, which stops at the first plane that is violated."""
    halfspaces, region = resolve_surface(surface, domain=domain, facets=facets)
    planes = halfspaces if region is None else halfspaces.with_planes(region.normals, region.offsets)
    if rtol is not None or (region is None and isinstance(surface, HalfSpaces)):
        kernel = kernel_of_halfspaces(halfspaces, region)
        dimension, corners = kernel.dimension, kernel.vertices
    else:
        dimension = find_feasibility(planes).dimension
        corners = region.vertices if region is not None else surface.used_vertices
    planes = planes.merged()
    if rtol is not None:
        return _refined(planes, corners, dimension, region, axes, rtol)
    cube, levels = root_cube(corners, axes, depth=depth, voxel_size=voxel_size)
    return _grid(planes, dimension, region, cube, levels)


def _relaxed(
    planes: WeighedPlanes, region: Domain, shares: list[float], axes: NDArray[np.float64],
    step: tuple[int | None, float | None, float | None], threads: int,
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
        if levels == _RTOL_MAX_DEPTH:
            reason = _still_apart(apart)
            break
        levels += 1
        cells = relaxed_cells_of(planes, region, cube, levels, shares, threads=threads)
    return tuple(
        _wrap_relaxed(c, share, cube, levels, dimension, region, reason) for c, share in zip(cells, shares, strict=True)
    )


def _wrap_relaxed(
    cells: RelaxedCells, share: float, cube: RootCube, depth: int, dimension: int, region: Domain, reason: str
) -> KernelGrid:
    volume = (cube.edge / 2**depth) ** 3
    bounds = cells.n_inside * volume * (1 - 1e-14), (cells.n_inside + cells.n_boundary) * volume * (1 + 1e-14)
    if not cells.n_inside + cells.n_boundary:
        reason = f"every point of the domain violates more than {share:.6g} of the surface"
    arrays = cells.tile_ijk, cells.tile_log2, cells.leaf_ijk, cells.leaf_inside, cells.leaf_boundary
    return _wrap(dimension, region, cube, depth, arrays, bounds, reason, share)


def _grid(
    planes: HalfSpaces, dimension: int, region: Domain | None, cube: RootCube, depth: int, reason: str = ""
) -> KernelGrid:
    """Run the octree and wrap its arrays."""
    volume = (cube.edge / 2**depth) ** 3
    if dimension < 0:
        nothing = np.empty((0, 3), np.int32), np.empty(0, np.int8), np.empty((0, 3), np.int32)
        masks = np.empty((0, 8), np.uint64), np.empty((0, 8), np.uint64)
        return _wrap(dimension, region, cube, depth, (*nothing, *masks), (0.0, 0.0), "the kernel is empty")
    *arrays, n_inside, n_boundary = exact_cells(*cube_planes(planes, cube, depth), depth, False)
    bounds = n_inside * volume * (1 - 1e-14), (n_inside + n_boundary) * volume * (1 + 1e-14)
    return _wrap(dimension, region, cube, depth, tuple(arrays), bounds, reason)


def _wrap(
    dimension: int, domain: Domain | None, cube: RootCube, depth: int, arrays: tuple[Any, ...],
    bounds: tuple[float, float], reason: str, tolerance: float = 0.0,
) -> KernelGrid:  # fmt: skip
    tile_ijk, tile_log2, leaf_ijk, leaf_inside, leaf_boundary = arrays
    linear = cube.axes.T * (cube.edge / 2**depth)
    make = SparseGrid.from_tiles_and_leaves
    inside = make(tile_ijk, tile_log2, leaf_ijk, leaf_inside, origin=cube.corner, linear=linear, name="inside")
    no_tiles = np.empty((0, 3), np.int32), np.empty(0, np.int8)
    boundary = make(*no_tiles, leaf_ijk, leaf_boundary, origin=cube.corner, linear=linear, name="boundary")
    return KernelGrid(inside, boundary, depth, bounds, dimension, domain, reason, tolerance)


def _refined(
    planes: HalfSpaces, corners: NDArray[np.float64], dimension: int, region: Domain | None,
    axes: NDArray[np.float64], rtol: float,
) -> KernelGrid:  # fmt: skip
    """Deepen until the bounds agree; the voxels are counted first and stored once."""
    cube, _ = root_cube(corners, axes)
    if dimension < 3:
        reason = "" if dimension < 0 else "a kernel without volume has no relative accuracy"
        return _grid(planes, dimension, region, cube, DEFAULT_DEPTH, reason)
    levels, share = MIN_DEPTH, 1.0
    for levels in range(MIN_DEPTH, _RTOL_MAX_DEPTH + 1):
        n_inside, n_boundary = exact_cells(*cube_planes(planes, cube, levels), levels, True)[5:]
        share = n_boundary / (n_inside + n_boundary)
        if share <= rtol:
            return _grid(planes, dimension, region, cube, levels)
    return _grid(planes, dimension, region, cube, levels, _still_apart(share))


def _still_apart(share: float) -> str:
    return f"the bounds still differ by {share:.2g} at depth {_RTOL_MAX_DEPTH}, the largest for `rtol`"
