"""How many guards are needed at least, anywhere inside."""

from __future__ import annotations

import numpy as np

from voxkernel.guards.clock import Clock
from voxkernel.guards.result import GuardBound
from voxkernel.guards.sight import Sight

__all__ = ["guard_bound"]


def guard_bound(sight: Sight, coverage: float, rng: np.random.Generator, clock: Clock) -> GuardBound:
    raise NotImplementedError
