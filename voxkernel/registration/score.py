"""How well a motion lays one surface on another, measured from samples to triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.search import inverse
from voxkernel.registration.side import Side

__all__ = ["fit_within", "surface_score"]

_FACING = 0.5  # cosine between the normals of a point and of the triangle next to it


def surface_score(source: Side, target: Side, motion: NDArray[np.float64], reach: float) -> float:
    """Mean of the shares of both surfaces that lie near the other, facing the same way; 1 is a perfect fit."""
    return 0.5 * (_share_near(source, target, motion, reach) + _share_near(target, source, inverse(motion), reach))


def _share_near(own: Side, other: Side, motion: NDArray[np.float64], reach: float) -> float:
    """Area mean of 1 - (d / reach)^2, 0 beyond reach or where the surfaces do not face the same way."""
    found = other.nearest(own.points @ motion[:3, :3].T + motion[:3, 3])
    faces_it = np.einsum("ij,ij->i", own.normals @ motion[:3, :3].T, found.normals) > _FACING
    near = faces_it & (found.distances < reach)
    worth = np.where(near, 1.0 - (np.minimum(found.distances, reach) / reach) ** 2, 0.0)
    return float(own.areas @ worth / own.areas.sum())


def fit_within(own: Side, other: Side, motion: NDArray[np.float64], reach: float) -> tuple[float, float]:
    """Share of the area within reach of the other surface, and the RMS distance of that share."""
    distances = other.nearest(own.points @ motion[:3, :3].T + motion[:3, 3]).distances
    near = distances <= reach
    if not near.any():
        return 0.0, float("nan")
    inside = own.areas[near]
    return float(inside.sum() / own.areas.sum()), float(np.sqrt(inside @ distances[near] ** 2 / inside.sum()))
