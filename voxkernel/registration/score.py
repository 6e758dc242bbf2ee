"""How well a motion lays one surface on another, measured from samples to triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.evidence import Fit
from voxkernel.registration.side import Side

__all__ = ["fit_within", "surface_score"]

_FACING = 0.5  # cosine between the normals of a point and of the triangle next to it


def surface_score(source: Side, target: Side, fit: Fit, reach: float) -> float:
    """Mean of the shares of both surfaces that lie near the other, facing the same way; 1 is a perfect fit."""
    shares: list[float] = []
    for side, distances, cosines in zip((source, target), fit.distances, fit.cosines, strict=True):
        near = (cosines > _FACING) & (distances < reach)
        worth = np.where(near, 1.0 - (np.minimum(distances, reach) / reach) ** 2, 0.0)
        shares.append(float(side.areas @ worth / side.areas.sum()))
    return 0.5 * (shares[0] + shares[1])


def fit_within(own: Side, distances: NDArray[np.float64], reach: float) -> tuple[float, float]:
    """Share of the area within reach of the other surface, and the RMS distance of that share."""
    near = distances <= reach
    if not near.any():
        return 0.0, float("nan")
    inside = own.areas[near]
    return float(inside.sum() / own.areas.sum()), float(np.sqrt(inside @ distances[near] ** 2 / inside.sum()))
