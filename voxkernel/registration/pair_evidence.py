"""How much speaks for a motion between two scans that overlap in part: log-odds from what lies close together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.joint_refinement import refined_together
from voxkernel.registration.motions import scaled, to_local, to_world
from voxkernel.registration.pair import solve
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.search import inverse
from voxkernel.registration.shortlist import Likeness
from voxkernel.registration.side import Side
from voxkernel.registration.verdict import NO_MATCH

__all__ = ["SURE", "Closeness", "Trial", "closeness", "evidence_of", "tried"]

_REACH = 1 / 30  # of the common size
_TIGHT = 1 / 8  # of the reach
_FACING = 0.5  # cosine between the normals of a point and of the triangle next to it
_SAMPLES = 1000
_POINTS = 4000  # of each scan, while a pair is judged
# Fitted to pairs of the tuning half of `datasets_tools/scan_sets.py`, right within 3 degrees and 1.5 %.
_BASE, _PER_TIGHT, _PER_OVERLAP, _PER_MATCHES = -10.2, 13.1, 0.46, 0.78
_CERTAIN = 6.0
SURE = 2.0  # log-odds from which a pair is right by itself
_POSSIBLE = -1.5  # below these it is no match


class Closeness(NamedTuple):
    """Of two surfaces, what lies near the other, and of that what faces it and what lies tightly on it; in [0, 1].

    `overlap` is a share of the smaller area, `facing` and `tight` are shares of the area that lies near.
    """

    overlap: float
    facing: float
    tight: float


def closeness(one: Side, two: Side, motion: NDArray[np.float64]) -> Closeness:
    """Measure how a motion lays the first surface on the second; both are in units of the common size."""
    near = facing = tight = 0.0
    for surface, other, there in ((one, two, motion), (two, one, inverse(motion))):
        found = other.nearest(surface.points @ there[:3, :3].T + there[:3, 3])
        distances = found.distances
        faces_it = np.einsum("ij,ij->i", surface.normals @ there[:3, :3].T, found.normals) > _FACING
        within = distances < _REACH
        near += float(surface.areas[within].sum())
        facing += float(surface.areas[within & faces_it].sum())
        tight += float(surface.areas[within & faces_it & (distances < _TIGHT * _REACH)].sum())
    if near == 0.0:
        return Closeness(0.0, 0.0, 0.0)
    least = min(float(one.areas.sum()), float(two.areas.sum()))
    return Closeness(min(1.0, 0.5 * near / least), facing / near, tight / near)


class Trial(NamedTuple):
    """The best motion found for a pair, in world coordinates, with the log-odds that it is right."""

    motion: NDArray[np.float64]
    evidence: float
    led_by: str
    closeness: Closeness

    @property
    def verdict(self) -> str:
        """What to call it by itself."""
        return "right" if self.evidence >= SURE else "uncertain" if self.evidence >= _POSSIBLE else "no match"

    @property
    def probability(self) -> float:
        """That it is right, by itself."""
        return float(1.0 / (1.0 + np.exp(-self.evidence)))


def evidence_of(close: Closeness, matches: float) -> float:
    """Log-odds that a motion is right, from a logistic regression over pairs of partial scans.

    `datasets_tools/evaluate_together.py` measures what it is worth on scans that it was not fitted to.
    """
    if close.overlap == 0.0:
        return -_CERTAIN
    odds = _BASE + _PER_TIGHT * close.tight + _PER_OVERLAP * close.overlap + _PER_MATCHES * np.log1p(matches)
    return float(np.clip(odds, -_CERTAIN, _CERTAIN))


def tried(
    one: PreparedSurface, two: PreparedSurface, like: Likeness, size: float, margins: tuple[float, ...] | None,
    known: Trial | None,
) -> Trial:  # fmt: skip
    """Refine the motions that matched descriptors ask for, unless known; where `margins` are given, register."""
    surfaces = Side(one.skin, size, _SAMPLES), Side(two.skin, size, _SAMPLES)
    best = known or Trial(np.full((4, 4), np.nan), -_CERTAIN, "", Closeness(0.0, 0.0, 0.0))
    if known is None and like.motions:
        starts = [np.stack([np.eye(4), scaled(inverse(motion), size)]) for motion in like.motions]
        quick = [refined_together([one, two], start, size, quick=True, most_points=_POINTS).poses for start in starts]
        odds = [evidence_of(closeness(*surfaces, scaled(inverse(p[1]), 1.0 / size)), like.matches) for p in quick]
        local = inverse(refined_together([one, two], quick[int(np.argmax(odds))], size, most_points=_POINTS).poses[1])
        close = closeness(*surfaces, scaled(local, 1.0 / size))
        best = Trial(to_world(one, two, local), evidence_of(close, like.matches), "matches", close)
    if margins is None:
        return best
    pair = one, two
    answer = solve(pair, pair, "point_to_plane")
    if answer.judged.probability < NO_MATCH:
        return best
    local = to_local(one, two, answer.transform)
    close = closeness(*surfaces, scaled(local, 1.0 / size))
    own = float(np.clip(answer.judged.probability, 1e-3, 1.0 - 1e-3))
    found = 0.5 * (evidence_of(close, like.matches) + float(np.log(own / (1.0 - own))))
    return Trial(answer.transform, found, "register", close) if found > best.evidence else best
