"""Triangles apart at sharp edges, so that what draws with a normal per vertex shows flat sides as flat."""

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.connected_components import components
from voxkernel.mesh.edges import half_edges
from voxkernel.mesh.triangles import doubled_normals

__all__ = ["SHARP_DEG", "split_at_creases"]

SHARP_DEG = 30.0
"""An edge is sharp where the normals of its two triangles differ by more."""


def split_at_creases(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The same triangles; two share a vertex only where smooth edges at this vertex lead from one to the other."""
    normals = doubled_normals(vertices[faces])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0, lengths, 1.0)
    one, other = half_edges(faces, len(vertices)).pairs()
    smooth = np.einsum("ij,ij->i", normals[one // 3], normals[other // 3]) >= np.cos(np.radians(SHARP_DEG))
    one, other = one[smooth], other[smooth]
    corner = faces.reshape(-1)
    far, other_far = _next(one), _next(other)
    turned = corner[one] != corner[other]  # the other triangle runs through the edge the other way
    other, other_far = np.where(turned, other_far, other), np.where(turned, other, other_far)
    n, label = components(corner.size, np.concatenate([one, far]), np.concatenate([other, other_far]))
    kept = np.empty(n, np.int64)
    kept[label] = corner
    return vertices[kept], label.reshape(-1, 3).astype(np.int64)


def _next(half_edge: NDArray[np.int64]) -> NDArray[np.int64]:
    return half_edge - half_edge % 3 + (half_edge % 3 + 1) % 3
