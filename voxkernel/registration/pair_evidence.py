"""A pair of scans among many: the motion between them, and the log-odds that it is right."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.motions import scaled
from voxkernel.registration.pair import ALL_SOURCES, solve
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.result import Verdict
from voxkernel.registration.search import Guess
from voxkernel.registration.shortlist import Likeness
from voxkernel.registration.verdict import verdict_of

__all__ = ["Trial", "tried"]

_CERTAIN = 6.0  # log-odds beyond which nothing is believed or refused
_HOPELESS = 0.05  # a probability below which a motion is not refined at full resolution
_MATCHES = "matches"


class Trial(NamedTuple):
    """The best motion found for a pair, in world coordinates; how likely it is, and why that is doubted."""

    motion: NDArray[np.float64]
    probability: float
    doubt: str
    led_by: str

    @property
    def verdict(self) -> Verdict:
        """What to call it by itself."""
        return verdict_of(self.probability, doubted=bool(self.doubt))

    @property
    def evidence(self) -> float:
        """Log-odds that it is right: none for one of several that fit as well, whatever speaks for it otherwise."""
        if self.probability <= 0.0:
            return -_CERTAIN
        odds = float(np.log(self.probability / max(1.0 - self.probability, 1e-9)))
        return float(np.clip(min(odds, 0.0) if self.doubt else odds, -_CERTAIN, _CERTAIN))


def tried(one: PreparedSurface, two: PreparedSurface, like: Likeness, size: float, *, fully: bool) -> Trial:
    """Judge the motions of matches beside those of kernels, their rivals; `fully` all that `register` tries."""
    pair = one, two
    local = [scaled(motion, size) for motion in like.motions]
    matched = [Guess(motion, _MATCHES, np.nan, motion) for motion in local]
    sources = ALL_SOURCES if fully else 1
    found = solve(pair, pair, "point_to_plane", first=matched, sources=sources, least=_HOPELESS)
    led_by = "" if found.guess is None else _MATCHES if found.guess.origin == _MATCHES else "register"
    return Trial(found.transform, found.judged.probability, found.reason, led_by)
