"""Where a picture is seen from: the direction that points up, and the frame of its camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["as_up", "camera_frame", "seen_upright"]


def as_up(up: ArrayLike | None) -> NDArray[np.float64] | None:
    """Check what a user wants to point up; a unit vector, or None where nothing is wanted."""
    if up is None:
        return None
    found = np.asarray(up, dtype=np.float64)
    if found.shape != (3,) or not np.isfinite(found).all() or not found.any():
        raise ValueError(f"`up` must be a direction of three numbers; got {up}")
    found = found / np.abs(found).max()
    unit: NDArray[np.float64] = found / np.linalg.norm(found)
    return unit


def seen_upright(
    view: NDArray[np.float64], upward: NDArray[np.float64], up: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same side of the surface, seen from a little above where `up` is up."""
    level = view - (view @ up) * up
    if np.linalg.norm(level) < 0.1:  # seen from above or below: from what was the lower rim then
        level = -upward + (upward @ up) * up
    towards = level / np.linalg.norm(level) + 0.35 * up
    towards /= np.linalg.norm(towards)
    above = up - (up @ towards) * towards
    return towards, above / np.linalg.norm(above)


def camera_frame(view: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right, up and towards the viewer, as rows."""
    right = np.cross(up, view)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(view, right), view])
