"""Half-spaces to a multi-resolution voxel grid of the kernel: `voxel_kernel`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_nonnegative, as_share
from voxkernel._core import exact_cells
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.exact.exact_kernel import kernel_of_stream
from voxkernel.halfspaces import Domain, Feasibility, HalfSpaces, find_feasibility
from voxkernel.halfspaces.surface_arguments import EXACT, Frame, SurfaceArgument, SurfaceLike, surface_argument
from voxkernel.large import StreamedSurface
from voxkernel.large.passes import workers_of
from voxkernel.large.stream_mesh import reader_of
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.root_cube import DEFAULT_DEPTH, MIN_DEPTH, RootCube, cube_planes, root_cube
from voxkernel.voxels.exact_octree import rows_for_voxels
from voxkernel.voxels.kernel_grid import KernelGrid
from voxkernel.voxels.streamed_relaxed import relaxed_kernel_of_stream
from voxkernel.voxels.streamed_rows import planes_for_voxels
from voxkernel.voxels.voxel_kernels import RTOL_MAX_DEPTH, Step, as_step, relaxed_kernels, still_apart, wrapped

__all__ = ["voxel_kernel"]


def voxel_kernel(
    surface: SurfaceLike | StreamedSurface,
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
) -> KernelGrid:
    """Compute the kernel of a surface, exact or relaxed, as a sparse voxel grid with certain volume bounds.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces), HalfSpaces or StreamedSurface
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; half-spaces; or a surface of
        `stream_mesh`, in the frame of the world; see Notes.
    depth : int, optional
        2**depth voxels along the root cube, which is the bounding cube of the surface or of the domain;
        3 to 20, 7 by default.
    voxel_size : float, optional
        Edge of a voxel, mesh units, instead of `depth`.
    rtol : float, optional
        Refine until the volume bounds differ by at most this share of the upper one, instead of
        `depth`; the root cube of an exact kernel is then its bounding cube. At most depth 12.
    tolerance : float
        Share of the surface, by area, that a point may not face: the kernel is `{x : violation(x) <=
        tolerance}`. In [0, 1]; 0 is the exact kernel. `voxel_kernels` finds several in one traversal.
    margin : float, optional
        Instead of `tolerance`: how far it is above the smallest violation there is, `best_center`'s
        upper bound (found to 1e-4), >= 0.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where the kernel is looked for. As for `exact_kernel` when the tolerance is 0. Relaxed kernels of
        closed surfaces would leak outside: they have the convex hull by default, open ones the ball.
    frame : {"world", "principal"}
        Grid axes: the world's, or the principal axes of the surface, so that the grid moves with it.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    threads : int
        Threads for relaxed kernels and for the chunks of a stream; the result does not depend on it.

    Returns
    -------
    KernelGrid
        Empty when the kernel is empty.

    Raises
    ------
    ValueError
        If more than one of `depth`, `voxel_size` and `rtol` is given, or one is out of range; `margin` with
        a tolerance; half-spaces without a domain and with a tolerance.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used, or several tolerances or margins are given.

    Notes
    -----
    A cell carries the half-spaces that are undecided on it and the weight that all of it violates; it is
    dropped when that is more than the tolerance, becomes a tile when it stays within it with all undecided
    ones added, and is split otherwise. The number of cells grows 4x per level, with the surface of the kernel.
    A relaxed kernel costs about 2x per level, because the lists halve. Areas are rounded to 60 bits of their
    sum, and bounds allow for that: where the violation of a region is the tolerance to 1e-15, it stays undecided.

    A streamed surface gives the voxels that it gives in memory. Its exact kernel is found first; where that has no
    volume, voxels may stay undecided that facets left out would exclude. Of its relaxed kernel no list of half-spaces
    is kept: a pass over the surface adds up what its chunks violate of the cells that are still undecided, for certain
    and at most, and goes on where that settles nothing. Depth 7 takes three such passes as a rule. The sums take 8 KB
    for every brick of 8^3 voxels on the border of the kernel, 256 MB at a time; where one depth would take more than
    16 passes, the grid is that of a smaller `depth`, whose bounds are as certain, and `reason` says so.

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
    step = as_step(depth, voxel_size, rtol)
    n_threads = as_depth("threads", threads, 1, 256)
    _check_one("tolerance", tolerance)
    _check_one("margin", margin)
    share = as_share("tolerance", tolerance)
    if margin is not None and share:
        raise ValueError("`margin` must not be given together with `tolerance`; got both")
    above_least = None if margin is None else as_nonnegative("margin", margin)
    if isinstance(surface, StreamedSurface):
        if frame != "world":
            raise ValueError(f"`frame` must be 'world' for a streamed surface; got {frame!r}")
        with workers_of(n_threads) as workers:
            reader = reader_of(surface, facets).by(workers)
            if share or above_least is not None:
                number = share if above_least is None else above_least
                return relaxed_kernel_of_stream(reader, number, above_least is not None, domain, step, n_threads)
            return _of_stream(reader, domain, step, n_threads)
    found = surface_argument(surface, facets)
    axes = found.axes(frame)
    if above_least is not None:
        return relaxed_kernels(found, [above_least], True, domain, axes, step, n_threads)[0]
    if share:
        return relaxed_kernels(found, [share], False, domain, axes, step, n_threads)[0]
    return _exact(found, domain, axes, step)


def _of_stream(reader: SurfaceReader, domain: Any, step: Step, threads: int) -> KernelGrid:
    """Run the octree on the planes that can make a difference to a voxel."""
    depth, voxel_size, rtol = step
    kernel = kernel_of_stream(reader, domain, threads=threads)
    facts, region = reader.facts(), kernel.domain
    corners = np.stack([facts.low, facts.high]) if region is None else region.vertices
    if rtol is not None:
        corners = kernel.vertices
    cube, levels = root_cube(corners, np.eye(3), depth=depth, voxel_size=voxel_size)
    inside = find_feasibility(kernel.certificate.halfspaces)
    depths = [levels] if rtol is None else range(MIN_DEPTH, RTOL_MAX_DEPTH + 1)
    planes = planes_for_voxels(reader, kernel, inside, cube, depths).merged()
    octree = _Octree(planes, find_feasibility(planes), region)
    return _grid(octree, cube, levels) if rtol is None else _refined(octree, corners, np.eye(3), rtol)


def _check_one(name: str, number: Any) -> None:
    if np.ndim(number):
        several = f"for several: voxel_kernels(..., {name}s=...)"
        raise TypeError(f"`{name}` must be a real number; got {type(number).__name__} ({several})")


def _exact(surface: SurfaceArgument, domain: Any, axes: NDArray[np.float64], step: Step) -> KernelGrid:
    """Run the octree of convex kernels, which stops at the first plane that is violated."""
    depth, voxel_size, rtol = step
    halfspaces, mesh, region = surface.halfspaces, surface.mesh, surface.domain(domain, EXACT)
    planes = halfspaces if region is None else halfspaces.with_planes(region.normals, region.offsets)
    planes = planes.merged()
    inside = find_feasibility(planes)
    if rtol is None and region is not None:
        corners = region.vertices
    elif rtol is None and mesh is not None:
        corners = mesh.used_vertices
    else:
        corners = kernel_of_halfspaces(halfspaces, region).vertices
    octree = _Octree(planes, inside, region)
    if rtol is not None:
        return _refined(octree, corners, axes, rtol)
    cube, levels = root_cube(corners, axes, depth=depth, voxel_size=voxel_size)
    return _grid(octree, cube, levels)


class _Octree(NamedTuple):
    """Half-spaces and what is known of their kernel."""

    planes: HalfSpaces
    inside: Feasibility
    region: Domain | None

    def cells(self, cube: RootCube, depth: int, count_only: bool) -> tuple[Any, ...]:
        """Run the compiled loop with the half-spaces that make a difference."""
        numbers = cube_planes(self.planes, cube, depth)
        local = cube.edge / self.planes.scale
        voxel, pad = 2.0**-depth * local, float(numbers[3].max()) * local
        near = rows_for_voxels(self.planes, self.inside, numbers[2], voxel, pad)
        normals, offsets, reach, pads = numbers
        if 4 * len(near) < 3 * len(self.planes):
            normals, offsets, reach, pads = normals[near], offsets[near], reach[near], pads[near]
        return exact_cells(normals, offsets, reach, pads, depth, count_only)


def _grid(octree: _Octree, cube: RootCube, depth: int, reason: str = "") -> KernelGrid:
    """Run the octree and wrap its arrays."""
    dimension, region = octree.inside.dimension, octree.region
    volume = (cube.edge / 2**depth) ** 3
    if dimension < 0:
        nothing = np.empty((0, 3), np.int32), np.empty(0, np.int8), np.empty((0, 3), np.int32)
        masks = np.empty((0, 8), np.uint64), np.empty((0, 8), np.uint64)
        return wrapped(dimension, region, cube, depth, (*nothing, *masks), (0.0, 0.0), "the kernel is empty")
    *arrays, n_inside, n_boundary = octree.cells(cube, depth, False)
    bounds = n_inside * volume * (1 - 1e-14), (n_inside + n_boundary) * volume * (1 + 1e-14)
    return wrapped(dimension, region, cube, depth, tuple(arrays), bounds, reason)


def _refined(
    octree: _Octree, corners: NDArray[np.float64], axes: NDArray[np.float64], rtol: float
) -> KernelGrid:
    """Deepen until the bounds agree; the voxels are counted first and stored once."""
    cube, _ = root_cube(corners, axes)
    if octree.inside.dimension < 3:
        reason = "" if octree.inside.dimension < 0 else "a kernel without volume has no relative accuracy"
        return _grid(octree, cube, DEFAULT_DEPTH, reason)
    levels, share = MIN_DEPTH, 1.0
    for levels in range(MIN_DEPTH, RTOL_MAX_DEPTH + 1):
        n_inside, n_boundary = octree.cells(cube, levels, True)[5:]
        share = n_boundary / (n_inside + n_boundary)
        if share <= rtol:
            return _grid(octree, cube, levels)
    return _grid(octree, cube, levels, still_apart(share))
