"""What points see of a surface: on fresh samples, by certificate, and at most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.guarding.certificate import CertifiedParts, certified_parts, middles_of
from voxkernel.guarding.clock import Clock
from voxkernel.guarding.sight import Sight, Spots

__all__ = ["CONFIDENCE", "FRESH", "Confirmed", "Measured", "measure"]

CONFIDENCE = 0.95
FRESH = 100_000
_QUICK = 0.002  # what a tenth of the samples may be short of before all are asked
_AT_ONCE = 4_000  # samples or facets between two looks at the clock


class Measured(NamedTuple):
    """What is known of points; `left_out` says what there was no time for."""

    seen: float
    bounds: tuple[float, float]
    n_samples: int
    certified: float
    facing: float
    middles: NDArray[np.int64]
    parts: CertifiedParts
    left_out: str


class Confirmed:
    """Measures on fresh samples what points see, less what the samples may flatter; new ones at every call.

    `margin` is a multiple of the distance from the share that is seen to the lower end of its interval: the last
    measurement may give less than the one that ends a search.
    """

    def __init__(
        self, sight: Sight, faces: NDArray[np.int64], coverage: float, margin: float, rng: np.random.Generator,
        clock: Clock,
    ) -> None:  # fmt: skip
        self._sight, self._faces, self._coverage, self._margin = sight, faces, coverage, margin
        self._rng, self._clock = rng, clock

    def __call__(self, points: list[NDArray[np.float64]]) -> tuple[float, Spots]:
        """Give the lower end of the interval less the margin, 1 where all samples are seen, and the unseen ones."""
        spots = self._sight.samples(FRESH, self._rng, self._faces)
        some = spots.some(np.arange(0, FRESH, 10))
        places = np.array(points)
        dark = self._sight.first_seen(places, some) < 0
        n_quick = len(some) - int(dark.sum())
        if n_quick < (self._coverage - _QUICK) * len(some):
            return n_quick / len(some), some.some(dark)
        if self._clock.is_over:  # the last measurement will tell
            return _interval(n_quick, len(some))[0], some.some(dark)
        dark = self._sight.first_seen(places, spots) < 0
        n_seen = FRESH - int(dark.sum())
        if n_seen == FRESH:
            return 1.0, spots.some(dark)
        low = _interval(n_seen, FRESH)[0]
        return low - self._margin * (n_seen / FRESH - low), spots.some(dark)


def measure(sight: Sight, points: NDArray[np.float64], rng: np.random.Generator, clock: Clock) -> Measured:
    """Count samples, find who sees the middles of facets, and prove; each as far as there is time."""
    spots = sight.samples(FRESH, rng)
    clock.tell("confirm")
    sample_order = rng.permutation(FRESH)
    firsts, n_samples = _first_seen(sight, points, spots, sample_order, clock)
    n_seen = int((firsts >= 0).sum())
    n_faces = len(sight.faces)
    middles, n_middles = _first_seen(sight, points, middles_of(sight), np.arange(n_faces), clock)
    clock.tell("certify")
    proven = certified_parts(sight, points, middles, clock)
    facing = _facing(sight, points, clock)
    low, high = _interval(n_seen, n_samples)
    bounds = (max(low, proven.share), max(proven.share, min(high, facing)))
    seen = min(max(n_seen / n_samples, proven.share), max(proven.share, facing))
    missing = [
        f"`seen` is measured on {n_samples:,} samples" if n_samples < FRESH else "",
        f"`first_seen` is not known of {n_faces - n_middles} facets" if n_middles < n_faces else "",
        f"{proven.n_left} facets are not looked at for `certified`" if proven.n_left else "",
    ]
    return Measured(
        seen, bounds, n_samples, proven.share, facing, middles, proven.parts, ", ".join(m for m in missing if m)
    )


def _first_seen(
    sight: Sight, points: NDArray[np.float64], spots: Spots, order: NDArray[np.int64], clock: Clock
) -> tuple[NDArray[np.int64], int]:
    """Find who sees the spots, in the given order while there is time, some at least; -1 for the others."""
    if clock.is_endless:
        return sight.first_seen(points, spots), len(spots)
    found = np.full(len(spots), -1, np.int64)
    done = 0
    while done < len(spots) and not (done and clock.is_over):
        ids = np.sort(order[done : done + _AT_ONCE])
        found[ids] = sight.first_seen(points, spots.some(ids))
        done += len(ids)
    return found, done


def _facing(sight: Sight, points: NDArray[np.float64], clock: Clock) -> float:
    """Share of the faces with a point on their inner side; planes that floats cannot tell are counted in."""
    corners = sight.vertices[sight.faces]
    faced = np.zeros(len(corners), np.bool_)
    for point in points:
        to_point = point - corners[:, 0]
        sizes = np.linalg.norm(to_point, axis=1) * 1e-15
        faced |= np.einsum("ij,ij->i", sight.normals, to_point) < 4.0 * sizes + 1e-300
        if clock.is_over:
            return 1.0
    if faced.all():
        return 1.0
    return min(1.0, float(sight.areas[faced].sum() / sight.areas.sum()) * (1.0 + 4.0 * len(corners) * 2.0**-53))


def _interval(n_seen: int, n: int) -> tuple[float, float]:
    """Clopper and Pearson, "The use of confidence or fiducial limits", Biometrika 26, 1934.

    One sample in each stratum: a sum of unlike coins is closer to its mean than that of like ones (W. Hoeffding, "On
    the distribution of the number of successes in independent trials", Ann. Math. Statist. 27, 1956). Strata that are
    left out for want of time are chosen at random, and a sum without replacement is closer to its mean, too.
    """
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - CONFIDENCE)
    low = float(betaincinv(n_seen, n - n_seen + 1, tail)) if n_seen else 0.0
    high = float(betaincinv(n_seen + 1, n - n_seen, 1.0 - tail)) if n_seen < n else 1.0
    return low, high
