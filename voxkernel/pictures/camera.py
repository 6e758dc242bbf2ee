"""Where a picture is seen from: the direction that points up, and the frame of its camera."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["as_up", "camera_frame", "look_at", "place_to_see", "seen_upright"]

_ANGLE = 18.0  # degrees from the lower to the upper rim of a picture


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


def place_to_see(
    points: NDArray[np.float64], view: NDArray[np.float64], up: NDArray[np.float64], *,
    aspect: float, angle: float, margin: float,
) -> tuple[NDArray[np.float64], float]:  # fmt: skip
    """Where to look, and from how far, so that the points fill a picture of that width by height and angle (degrees).

    `margin` is 1 where they may reach its rim.
    """
    axes = camera_frame(view, up)
    flat = points @ axes.T
    middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    flat = flat - middle
    # A point at depth z and height h fits when h <= slope * (distance - z).
    reach = np.maximum(np.abs(flat[:, 1]), np.abs(flat[:, 0]) / aspect)
    return middle @ axes, float((margin * reach / np.tan(np.radians(angle / 2)) + flat[:, 2]).max())


def look_at(
    plotter: Any, points: NDArray[np.float64], view: NDArray[np.float64], up: NDArray[np.float64], *,
    margin: float = 1.06, least: float = 0.0,
) -> float:  # fmt: skip
    """Fit the points into a plotter's picture, which is at least `least` high.

    Gives the world units of one of its pixels, in the plane through the middle of the points.
    """
    width, height = plotter.window_size
    focus, distance = place_to_see(points, view, up, aspect=width / height, angle=_ANGLE, margin=margin)
    slope = np.tan(np.radians(_ANGLE / 2))
    distance = max(distance, 0.5 * least / slope)
    plotter.camera.view_angle = _ANGLE
    plotter.camera.focal_point = focus
    plotter.camera.position = focus + distance * view
    plotter.camera.up = up
    plotter.reset_camera_clipping_range()
    return float(2.0 * slope * distance / height)
