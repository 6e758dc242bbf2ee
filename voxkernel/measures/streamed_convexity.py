"""Whether a streamed surface lies in its kernel, decided exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.exact import KernelPolytope
from voxkernel.exact.convexity import is_locally_convex
from voxkernel.halfspaces import HalfSpaces
from voxkernel.large.surface_reader import SurfaceReader

__all__ = ["lies_in_kernel"]

_PRODUCTS = 1 << 20  # held at a time
_UNIT = 2.0**-53


def lies_in_kernel(reader: SurfaceReader, kernel: KernelPolytope) -> bool:
    """Whether every facet lies in the plane of a face of the solid kernel, and no corner outside of it.

    Where most facets bound the kernel, which is found in memory, edges are asked, as in memory.
    """
    frame, n_faces = reader.facts().frame, len(kernel.face_facets)
    if 2 * n_faces > reader.facts().n_planes:
        mesh = reader.to_mesh()
        return is_locally_convex(mesh, HalfSpaces.from_mesh(mesh))
    if (kernel.face_facets < 0).any():  # a domain cuts it
        return False
    kept = kernel.certificate.halfspaces
    faces = kept.select(np.searchsorted(kept.facet_ids[kept.facet_ids >= 0], kernel.face_facets))
    of_faces = faces.vertices[faces.corner_ids()]
    for _, chunk in reader.chunks("convex"):
        ids = np.arange(n_faces + len(chunk.corners))
        planes = HalfSpaces._in_frame(np.concatenate([of_faces, chunk.corners]), ids, frame)
        own = planes.coplanar_groups()[n_faces:]
        if (own >= n_faces).any():
            return False
        corners = chunk.corners[planes.facet_ids[n_faces:] - n_faces]
        step = max(1, _PRODUCTS // (3 * n_faces))
        near = [_near_other_planes(faces, corners[i : i + step], own[i : i + step]) for i in range(0, len(own), step)]
        if near and not kernel.contains(np.unique(np.concatenate(near), axis=0)).all():
            return False
    return True


def _near_other_planes(
    faces: HalfSpaces, corners: NDArray[np.float64], own: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Corners that floating point cannot place inside the planes of all faces but their own."""
    local = faces.to_local(corners.reshape(-1, 3))
    slack = faces.local_offsets - local @ faces.local_normals.T
    slack[np.arange(len(slack)), np.repeat(own, 3)] = np.inf
    return corners.reshape(-1, 3)[(slack <= 2.0 * faces.local_errors + 8.0 * _UNIT).any(axis=1)]
