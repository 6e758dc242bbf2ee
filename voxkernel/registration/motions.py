"""Motions between world coordinates, local frames and units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.search import inverse

__all__ = ["scaled", "to_local", "to_world"]



def to_world(one: PreparedSurface, two: PreparedSurface, local: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn a motion between local frames into one between world coordinates."""
    return two.T_world_local @ local @ inverse(one.T_world_local)


def to_local(one: PreparedSurface, two: PreparedSurface, world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn a motion between world coordinates into one between local frames."""
    return inverse(two.T_world_local) @ world @ one.T_world_local


def scaled(motion: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    """Change the unit of length of a motion."""
    changed = motion.copy()
    changed[:3, 3] *= factor
    return changed
