"""The half-spaces of a stream that can make a difference to a voxel."""

from __future__ import annotations

import numpy as np

from voxkernel._core import planes_reaching
from voxkernel.exact import KernelPolytope
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.large.streamed_planes import Rows, StreamedPlanes, some_rows
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
    found: Rows | None = None
    for first, part in planes.parts("voxels"):
        _, _, reach, pads = cube_planes(part, cube, depth)
        normals, offsets, errors = part.local_normals, part.local_offsets, part.local_errors + pads * local
        near = planes_reaching(normals, offsets, errors, point, outer, margin, _ALL)
        wide = planes_reaching(normals, offsets + 0.5 * voxel * reach, errors, point, outer * factor, margin, _ALL)
        ids = np.union1d(near, wide)
        fresh = planes.heads(some_rows(first, part, ids))
        found = fresh if found is None else planes.heads(found.joined(fresh))
    assert found is not None  # there are facets
    return planes.halfspaces(found)
