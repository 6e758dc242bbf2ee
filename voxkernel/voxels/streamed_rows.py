"""The half-spaces of a stream that can make a difference to a voxel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import planes_reaching
from voxkernel.exact import KernelPolytope
from voxkernel.exact.dual_hull import polyhedron_around
from voxkernel.exact.inner_point import InnerPoint
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.plane_passes import tightest_planes
from voxkernel.large.plane_tasks import PlaneMaker, Rows, some_rows
from voxkernel.large.streamed_planes import StreamedPlanes
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.root_cube import RootCube, cube_planes
from voxkernel.voxels.exact_octree import blow_up

__all__ = ["planes_for_voxels"]

_ALL = np.empty(0, np.bool_)  # of the planes of a part
_FEW = 20_000  # planes whose polyhedron is taken without asking which are the nearest


def planes_for_voxels(
    reader: SurfaceReader, kernel: KernelPolytope, inside: Feasibility, cube: RootCube, depths: Sequence[int]
) -> HalfSpaces:
    """Collect in one pass what the octree needs at some depths; of a kernel without volume, what made it.

    Notes
    -----
    Which voxels are inside is decided by the planes that the kernel itself, the polytope of `rows_for_voxels`, does not
    keep clear of. A voxel is excluded where its centre is beyond a plane by more than its reach. The planes that made
    the kernel, moved out by that reach, leave a polyhedron with all centres that they do not exclude: a plane that,
    moved out as well, keeps clear of it excludes no other voxel. What the kernel blown up tells, at the coarsest depth
    for all, is asked first. The planes of the domain come last.
    """
    kept, point = kernel.certificate.halfspaces, inside.local_point
    if kernel.dimension < 3 or point is None:
        return kept
    local = cube.edge / kept.scale
    depth = min(depths)
    voxel, pad = 2.0**-depth * local, float(cube_planes(kept, cube, max(depths))[3].max()) * local
    factor = blow_up(inside, voxel, pad)
    if factor is None:
        return kept
    outer = kept.to_local(kernel.vertices) - point
    margin = 1e-9 * float(np.abs(outer).max()) + 2.0 * pad + kernel.max_residual / kept.scale
    centers = [_centers(kept, point, cube, d) for d in depths]
    planes = StreamedPlanes(reader).in_domain(kernel.domain)
    near = _NearVoxels(planes.maker, cube, point, outer, margin, factor, tuple(depths), tuple(centers))
    return planes.halfspaces(planes.folded("voxels", near.of, near.merged))


class _Centers(NamedTuple):
    """Corners, about a point, of a polyhedron around all centres of voxels that some planes leave, and a margin."""

    corners: NDArray[np.float64]
    margin: float


def _centers(planes: HalfSpaces, point: NDArray[np.float64], cube: RootCube, depth: int) -> _Centers | None:
    """Move planes out by the reach of a voxel and what rounding may add; None where they leave no end."""
    local = cube.edge / planes.scale
    _, _, reach, pads = cube_planes(planes, cube, depth)
    offsets = planes.local_offsets - planes.local_normals @ point + (0.5 * 2.0**-depth * reach + 4.0 * pads) * local
    if not (offsets > 0.0).all():
        return None
    moved = HalfSpaces.from_planes(planes.local_normals, offsets)
    zero = np.zeros(3)
    rows = np.arange(len(moved)) if len(moved) <= _FEW else tightest_planes(moved, zero)
    found = polyhedron_around(moved, InnerPoint(zero[None], zero, 0.0), rows)
    if found is None:
        return None
    margin = (1e-9 * found.extent + found.reach) * moved.scale + 2.0 * float(pads.max()) * local
    return _Centers(found.vertices * moved.scale, margin)


class _NearVoxels(NamedTuple):
    """Planes that some voxel of the kernel's border may cross."""

    maker: PlaneMaker
    cube: RootCube
    point: NDArray[np.float64]
    outer: NDArray[np.float64]
    margin: float
    factor: float
    depths: tuple[int, ...]
    centers: tuple[_Centers | None, ...]

    def of(self, first: int, planes: HalfSpaces) -> Rows:
        if not len(planes):
            return some_rows(first, planes, np.empty(0, np.int64))
        local = self.cube.edge / planes.scale
        _, _, reach, pads = cube_planes(planes, self.cube, max(self.depths))
        steps, errors = 0.5 * local * reach, planes.local_errors + pads * local

        def reaching(depth: int | None, corners: NDArray[np.float64], margin: float, among: NDArray[np.bool_]):
            offsets = planes.local_offsets if depth is None else planes.local_offsets + 2.0**-depth * steps
            return planes_reaching(planes.local_normals, offsets, errors, self.point, corners, margin, among)

        is_needed, among = np.zeros(len(planes), np.bool_), np.ones(len(planes), np.bool_)
        is_needed[reaching(None, self.outer, self.margin, among)] = True
        if len(self.depths) > 1 or None in self.centers:
            among[:] = False
            among[reaching(min(self.depths), self.outer * self.factor, self.margin, ~is_needed)] = True
        for depth, centers in zip(self.depths, self.centers, strict=True):
            if centers is None:
                is_needed |= among
                break
            is_needed[reaching(depth, centers.corners, centers.margin, among & ~is_needed)] = True
        return self.maker.heads(some_rows(first, planes, np.flatnonzero(is_needed)))

    def merged(self, one: Rows, other: Rows) -> Rows:
        return self.maker.heads(one.joined(other))
