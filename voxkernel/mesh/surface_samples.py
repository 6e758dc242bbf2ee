"""Points spread evenly over triangles, the same for every pose of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.triangles import scaled_triangle_areas

__all__ = ["spread_samples"]

# The generalised golden ratio of two dimensions: the R2 sequence.
_PHI = 1.3247179572447460
_R2 = np.array([1.0 / _PHI, 1.0 / _PHI**2])
_NUDGE = 1e-9


def spread_samples(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Place about `count` points on triangles: positions, the triangle of each, the area it stands for.

    Where there are fewer triangles than points, every triangle gets points in proportion to its area, in a
    pattern that depends on its own corners only; else the triangles at even steps of the summed area get
    one point each. A triangle whose share is a whole number is kept from changing with rounding.
    """
    areas = scaled_triangle_areas(vertices, faces, 0)
    total = areas.sum()
    if total == 0.0:
        return np.empty((0, 3)), np.empty(0, np.int64), np.empty(0)
    share = areas * (count / total)
    if len(faces) >= count:
        steps = np.floor(np.cumsum(share) + 0.5 + _NUDGE)
        owners = np.repeat(np.arange(len(faces)), np.diff(steps, prepend=0.0).astype(np.int64))
        return vertices[faces[owners]].mean(axis=1), owners, np.full(len(owners), total / max(1, len(owners)))
    numbers = np.where(areas > 0, np.maximum(1, np.ceil(share - _NUDGE)), 0).astype(np.int64)
    owners = np.repeat(np.arange(len(faces)), numbers)
    order = np.arange(len(owners)) - np.repeat(np.cumsum(numbers) - numbers, numbers)
    # The first point of a triangle is its middle; the R2 sequence goes on from there.
    square = np.mod(np.array([1.0 / 3.0, 1.0 / 3.0]) + order[:, None] * _R2, 1.0)
    outside = square.sum(axis=1) > 1.0
    square[outside] = 1.0 - square[outside]
    corners = vertices[faces]
    edges = corners[:, 1:] - corners[:, :1]
    points = corners[owners, 0] + np.einsum("ik,ikj->ij", square, edges[owners])
    return points, owners, areas[owners] / numbers[owners]
