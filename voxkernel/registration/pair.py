"""Solve one pair of prepared surfaces: find the best candidate, refine it, doubt it, crop to the overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.errors import MeshError
from voxkernel.registration.contest import Contest, End
from voxkernel.registration.evidence import Fit
from voxkernel.registration.icp import Refine
from voxkernel.registration.judge import Judge, Judged
from voxkernel.registration.last import last_refined
from voxkernel.registration.motions import scaled, to_local, to_world
from voxkernel.registration.prepare import PreparedSurface, prepare
from voxkernel.registration.rounding import motion_on_grid
from voxkernel.registration.score import surface_score
from voxkernel.registration.search import Guess, rotation_angle_deg
from voxkernel.registration.side import Side
from voxkernel.registration.verdict import NAMES

__all__ = ["SCORE_REACH", "Judged", "Solution", "cropped_to_overlap", "solve"]

ALL_SOURCES = 6
SCORE_REACH = 1 / 30  # of the larger diagonal
_DISTINCT_DEG = 5.0
_NO_FIT = 0.02
_SAME = 1e-4  # a change of the motion that is not measured again
_MISFIT = "no motion that was tried lays the surfaces on each other, facing the same way"
_RESTLESS = "ICP has not come to rest on pairs of points"
_OVERLAP_REACH = 1 / 20
_LEAST_OVERLAP = 0.02


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Solution(Frozen):
    """The answer for a pair, in world coordinates, and what the verdict is made of."""

    transform: NDArray[np.float64]
    score: float
    guess: Guess | None
    by_kernels: Guess | None
    guesses: tuple[Guess, ...]
    converged: bool
    ambiguous: bool
    reason: str
    judged: Judged
    local: NDArray[np.float64]  # between the sides, which are scaled
    sides: tuple[Side, Side]
    fit: Fit


def solve(
    pair: tuple[PreparedSurface, PreparedSurface], shown: tuple[PreparedSurface, PreparedSurface], method: Refine,
    *, sources: int = ALL_SOURCES, first: Sequence[Guess] = (), least: float = 0.0,
) -> Solution:  # fmt: skip
    """Search with the kernels of `shown`, refine and score on the samples of `pair`; they differ when cropped.

    `first` are motions that go before all sources of candidates. An answer less probable than `least` is not refined
    at full resolution.
    """
    contest = Contest(*pair)
    searched = contest if pair is shown else Contest(*shown)
    judge = Judge(searched)
    searched.run(judge.clear, sources, first)
    guesses = tuple(_in_world(shown, g) for g in sorted(searched.guesses, key=lambda g: -g.moved_score))
    if searched is not contest:
        contest.enter([_between(searched, contest, end) for end in searched.ends])
        judge = Judge(contest)
        judge.clear()
    best = judge.best
    if best is None or best.rank < _NO_FIT:
        start = guesses[0].transform if guesses else np.eye(4)
        local = motion_on_grid(scaled(to_local(*pair, start), 1.0 / contest.scale))
        return Solution(
            start, 0.0, None, _by_kernels(guesses, start), guesses, False, False, _MISFIT,
            Judged(np.full(len(NAMES), np.nan), 0.0, 1.0, 1.0), local, contest.sides, contest.fit(local),
        )  # fmt: skip
    if method == "none":
        return _unrefined(judge, best, guesses, shown)
    return _final(judge, best, guesses, method, shown, least)


def _final(
    judge: Judge, best: End, guesses: tuple[Guess, ...], method: Refine,
    shown: tuple[PreparedSurface, PreparedSurface], least: float,
) -> Solution:  # fmt: skip
    """Refine the best at full resolution, then measure it; not what is less probable than `least`."""
    contest, judged = judge.contest, judge.of(best)
    motion, rests, doubt = best.polished.transform, True, ""
    if judged.probability >= least:
        end = contest.rested(best)
        motion, rests = last_refined(contest.pair, contest.sides, end.polished, contest.reach, method)
        same = float(np.abs(motion - best.polished.transform).max()) < _SAME
        best = contest.measured(end, motion, end.polished)
        if not same:
            judged = judge.of(best)
        doubt = judge.doubt(best)
    score = surface_score(*contest.sides, best.fit, SCORE_REACH)
    reason = doubt if rests else _RESTLESS
    world = to_world(*contest.pair, scaled(motion, contest.scale))
    guess = _in_world(shown, best.guess)
    return Solution(
        world, score, guess, _by_kernels(guesses, world), guesses, rests, bool(doubt), reason, judged, motion,
        contest.sides, best.fit,
    )  # fmt: skip


def _unrefined(
    judge: Judge, best: End, guesses: tuple[Guess, ...], shown: tuple[PreparedSurface, PreparedSurface]
) -> Solution:
    """Take the guess that leads to the best end, but give it as the kernels did."""
    contest = judge.contest
    world = to_world(*contest.pair, scaled(best.polished.transform, contest.scale))
    guess = _by_kernels(guesses, world) or _in_world(shown, best.guess)
    local = scaled(to_local(*contest.pair, guess.transform), 1.0 / contest.scale)
    fit = contest.fit(local)
    doubt = judge.doubt(best)
    return Solution(
        guess.transform, surface_score(*contest.sides, fit, SCORE_REACH), guess, guess, guesses, True, bool(doubt),
        doubt, judge.of(best), local, contest.sides, fit,
    )  # fmt: skip


def _in_world(pair: tuple[PreparedSurface, PreparedSurface], guess: Guess) -> Guess:
    from dataclasses import replace

    return replace(guess, transform=to_world(*pair, guess.transform), moved=to_world(*pair, guess.moved))


def _between(searched: Contest, contest: Contest, end: End) -> tuple[NDArray[np.float64], Guess]:
    world = to_world(*searched.pair, scaled(end.polished.transform, searched.scale))
    return scaled(to_local(*contest.pair, world), 1.0 / contest.scale), end.guess


def _by_kernels(guesses: tuple[Guess, ...], answer: NDArray[np.float64]) -> Guess | None:
    """Choose what kernels alone would have answered: the best raw score, of those that lead to the answer if any."""
    kernels = [g for g in guesses if g.origin == "kernel"]
    leading = [g for g in kernels if rotation_angle_deg(g.moved, answer) <= _DISTINCT_DEG]
    return max(leading or kernels, key=lambda g: g.score, default=None)


def cropped_to_overlap(
    pair: tuple[PreparedSurface, PreparedSurface], world: NDArray[np.float64]
) -> tuple[PreparedSurface, PreparedSurface] | None:
    """Keep the facets of each surface near the other one and prepare them; None where too few are left."""
    from scipy.spatial import KDTree

    reach = _OVERLAP_REACH * max(p.diagonal for p in pair)
    local = to_local(*pair, world)
    moved = pair[0].vertices @ local[:3, :3].T + local[:3, 3]
    middles = moved[pair[0].faces].mean(axis=1), pair[1].vertices[pair[1].faces].mean(axis=1)
    cropped: list[PreparedSurface] = []
    for own, surface, other in zip(middles, pair, (pair[1].fine.points, moved), strict=True):
        keep = np.isfinite(KDTree(other).query(own, distance_upper_bound=reach)[0])
        if keep.mean() < _LEAST_OVERLAP:
            return None
        mesh = surface.mesh
        try:
            part = mesh.from_triangles(mesh.vertices, mesh.faces[keep], source=f"overlap of {mesh.source}")
            cropped.append(prepare(part, surface.margins))
        except MeshError:
            return None
    return cropped[0], cropped[1]
