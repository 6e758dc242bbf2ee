"""The half-spaces of a stream that can make a difference to a voxel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import planes_reaching
from voxkernel.exact import KernelPolytope
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.large.plane_tasks import PlaneMaker, Rows, some_rows
from voxkernel.large.streamed_planes import StreamedPlanes
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.root_cube import RootCube, cube_planes
from voxkernel.voxels.exact_octree import blow_up

__all__ = ["planes_for_voxels"]

_ALL = np.empty(0, np.bool_)  # of the planes of a part


def planes_for_voxels(
    reader: SurfaceReader, kernel: KernelPolytope, inside: Feasibility, cube: RootCube, depth: int
) -> HalfSpaces:
    """Collect in one pass what `rows_for_voxels` lists in memory; of a kernel without volume, what made it.

    The polytope around the kernel is the kernel itself. The planes of the domain come last.
    """
    kept, point = kernel.certificate.halfspaces, inside.local_point
    if kernel.dimension < 3 or point is None:
        return kept
    local = cube.edge / kept.scale
    voxel, pad = 2.0**-depth * local, float(cube_planes(kept, cube, depth)[3].max()) * local
    factor = blow_up(inside, voxel, pad)
    if factor is None:
        return kept
    outer = kept.to_local(kernel.vertices) - point
    margin = 1e-9 * float(np.abs(outer).max()) + 2.0 * pad + kernel.max_residual / kept.scale
    planes = StreamedPlanes(reader).in_domain(kernel.domain)
    near = _NearVoxels(planes.maker, cube, depth, point, outer, margin, factor)
    return planes.halfspaces(planes.folded("voxels", near.of, near.merged))


class _NearVoxels(NamedTuple):
    """Planes that some voxel of the kernel's border may cross."""

    maker: PlaneMaker
    cube: RootCube
    depth: int
    point: NDArray[np.float64]
    outer: NDArray[np.float64]
    margin: float
    factor: float

    def of(self, first: int, planes: HalfSpaces) -> Rows:
        if not len(planes):
            return some_rows(first, planes, np.empty(0, np.int64))
        local = self.cube.edge / planes.scale
        _, _, reach, pads = cube_planes(planes, self.cube, self.depth)
        normals, offsets, errors = planes.local_normals, planes.local_offsets, planes.local_errors + pads * local
        wider = offsets + 0.5 * 2.0**-self.depth * local * reach
        near = planes_reaching(normals, offsets, errors, self.point, self.outer, self.margin, _ALL)
        wide = planes_reaching(normals, wider, errors, self.point, self.outer * self.factor, self.margin, _ALL)
        return self.maker.heads(some_rows(first, planes, np.union1d(near, wide)))

    def merged(self, one: Rows, other: Rows) -> Rows:
        return self.maker.heads(one.joined(other))
