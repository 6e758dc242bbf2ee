"""Coordinates on a grid, so that another unit of length, which changes their last digits, changes no decision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["motion_on_grid", "on_grid"]

_GRID = 2.0**32


def on_grid(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round values of about unit size to multiples of 2^-32."""
    return np.round(values * _GRID) / _GRID


def motion_on_grid(motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round a rigid motion between scaled frames to the grid; its rotation stays one."""
    u, _, vt = np.linalg.svd(on_grid(motion[:3, :3]))
    rounded = np.eye(4)
    rounded[:3, :3], rounded[:3, 3] = u @ vt, on_grid(motion[:3, 3])
    return rounded
