"""Whether a closed surface is convex, decided exactly from its edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import coordinate_range, edge_convexity
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.zero_area import exact_integers

__all__ = ["edge_convexity_of", "is_behind_all_planes", "is_locally_convex"]


def edge_convexity_of(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    face_planes: NDArray[np.int64],
    plane_corners: NDArray[np.int64],
    *,
    least: int = 1,
    threads: int = 1,
) -> int:
    """Classify the edges of a surface: 2 all strictly convex, 1 convex or flat, 0 otherwise or less than `least`.

    Coordinates in use outside 2**-300 .. 2**300 are beyond the exact predicate and give 0.
    """
    low, high, smallest = coordinate_range(vertices, faces, threads)
    if max(np.abs(low).max(), np.abs(high).max()) > 2.0**300 or smallest < 2.0**-300:
        return 0
    return edge_convexity(vertices, faces, face_planes, plane_corners, least, threads)


def is_locally_convex(mesh: TriangleMesh, halfspaces: HalfSpaces) -> bool:
    """Whether no edge of a mesh is concave; a polygon counts with its own plane."""
    if halfspaces.n_degenerate:
        return False
    return edge_convexity_of(mesh.vertices, mesh.faces, _face_planes(mesh), mesh.plane_corners) > 0


def _face_planes(mesh: TriangleMesh) -> NDArray[np.int64]:
    """The row of `plane_corners` of every triangle."""
    if mesh.plane_corners is mesh.faces:
        return np.arange(len(mesh.faces))
    planar = ~np.isin(mesh.facet_ids, mesh.nonplanar_facets)
    step = np.ones(len(mesh.faces), np.int64)
    step[1:][planar[1:] & (mesh.facet_ids[1:] == mesh.facet_ids[:-1])] = 0
    return np.cumsum(step) - 1


def is_behind_all_planes(mesh: TriangleMesh) -> bool:
    """Whether no vertex is in front of a facet's plane, exactly; the corners of a facet count as on its plane.

    In integers, for few facets: also where coordinates are beyond the exact predicate, or facets have no area.
    """
    points = exact_integers(mesh.vertices)
    own: list[set[int]] = [set() for _ in mesh.plane_corners]
    for plane, face in zip(_face_planes(mesh).tolist(), mesh.faces.tolist(), strict=True):
        own[plane].update(face)
    for (i, j, k), ids in zip(mesh.plane_corners.tolist(), own, strict=True):
        a, u, v = points[i], points[j] - points[i], points[k] - points[i]
        normal = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
        heights = (points - a) @ normal
        if any(height > 0 and vertex not in ids for vertex, height in enumerate(heights.tolist())):
            return False
    return True
