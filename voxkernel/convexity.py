"""Whether a closed surface is convex, decided exactly from its edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import coordinate_range, edge_convexity, halfedge_twins
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh

__all__ = ["edge_convexity_of", "is_locally_convex"]


def edge_convexity_of(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    face_planes: NDArray[np.int64],
    plane_corners: NDArray[np.int64],
) -> int:
    """Classify the edges of a surface: 2 all strictly convex, 1 convex or flat, 0 otherwise.

    Coordinates in use outside 2**-300 .. 2**300 are beyond the exact predicate and give 0.
    """
    low, high, smallest = coordinate_range(vertices, faces)
    if max(np.abs(low).max(), np.abs(high).max()) > 2.0**300 or smallest < 2.0**-300:
        return 0
    twins = halfedge_twins(faces, len(vertices))
    return edge_convexity(vertices, faces, twins, face_planes, plane_corners)


def is_locally_convex(mesh: TriangleMesh, halfspaces: HalfSpaces) -> bool:
    """Whether no edge of a mesh is concave; a polygon counts with its own plane."""
    if halfspaces.n_degenerate:
        return False
    face_planes = np.arange(len(mesh.faces))
    if mesh.plane_corners is not mesh.faces:
        planar = ~np.isin(mesh.facet_ids, mesh.nonplanar_facets)
        step = np.ones(len(mesh.faces), np.int64)
        step[1:][planar[1:] & (mesh.facet_ids[1:] == mesh.facet_ids[:-1])] = 0
        face_planes = np.cumsum(step) - 1
    return edge_convexity_of(mesh.vertices, mesh.faces, face_planes, mesh.plane_corners) > 0
