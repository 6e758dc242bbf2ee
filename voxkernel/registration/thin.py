"""A copy of a surface with at most so many facets, for everything that does not need them all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel._open3d import open3d_mesh
from voxkernel.mesh.triangles import doubled_areas

__all__ = ["MOST_FACETS", "thinned"]

MOST_FACETS = 20_000


def thinned(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], most: int = MOST_FACETS
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Join the vertices in each cell of a grid whose edge follows from the area, until few enough facets are left.

    A surface that is small enough is given back as it is; so is one that would lose nearly everything.
    """
    if len(faces) <= most:
        return vertices, faces
    area = 0.5 * float(doubled_areas(vertices[faces]).sum())
    cell = float(np.sqrt(2.0 * area / most))
    whole = open3d_mesh(vertices, faces)
    thin, triangles = whole, faces
    for _ in range(4):
        thin = whole.simplify_vertex_clustering(cell)
        triangles = np.asarray(thin.triangles).astype(np.int64)
        if len(triangles) <= most:
            break
        cell *= 1.1 * float(np.sqrt(len(triangles) / most))
    if len(triangles) < 0.05 * most:
        return vertices, faces
    return np.asarray(thin.vertices).copy(), triangles
