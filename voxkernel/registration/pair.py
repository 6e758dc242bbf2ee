"""Solve one pair of prepared surfaces: search, refine the best, doubt the answer, crop to the overlap."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.errors import MeshError
from voxkernel.registration.icp import Refine
from voxkernel.registration.prepare import PreparedSurface, prepare
from voxkernel.registration.refine import Refined, refined, slack_of
from voxkernel.registration.score import ScoredSurface, surface_score
from voxkernel.registration.search import Guess, ScoredCloud, inverse, rotation_angle_deg, search

__all__ = ["SCORE_REACH", "Solution", "cropped_to_overlap", "scaled", "solve", "to_local", "to_world"]

SCORE_REACH = 1 / 30  # of the larger diagonal
_CLOSE = 0.06  # a runner-up of the search within this is refined too
_MOST_REFINED = 3
_DISTINCT_DEG = 5.0
_EQUAL_SCORES = 0.01
_SLIDES = 4e-3
_NO_FIT = 0.05
_MISFIT = "no motion that was tried lays the surfaces on each other, facing the same way"
_OVERLAP_REACH = 1 / 20
_LEAST_OVERLAP = 0.02


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Solution(Frozen):
    """The answer for a pair, in world coordinates."""

    transform: NDArray[np.float64]
    score: float
    guess: Guess | None
    by_kernels: Guess | None
    guesses: tuple[Guess, ...]
    converged: bool
    ambiguous: bool
    reason: str
    surfaces: tuple[ScoredSurface, ScoredSurface]


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


def solve(
    pair: tuple[PreparedSurface, PreparedSurface], shown: tuple[PreparedSurface, PreparedSurface], method: Refine
) -> Solution:
    """Search with the kernels of `shown`, refine and score on the samples of `pair`; they differ when cropped."""
    scale = max(p.diagonal for p in pair)
    found = search(*shown, max(p.diagonal for p in shown))
    guesses = tuple(
        replace(g, transform=to_world(*shown, g.transform), moved=to_world(*shown, g.moved)) for g in found
    )
    clouds = ScoredCloud(pair[0].fine, scale), ScoredCloud(pair[1].fine, scale)
    surfaces = ScoredSurface(pair[0], scale), ScoredSurface(pair[1], scale)
    if not guesses or guesses[0].moved_score < _NO_FIT:
        start = guesses[0].transform if guesses else np.eye(4)
        reason = _MISFIT
        return Solution(start, 0.0, None, _by_kernels(guesses, start), guesses, False, False, reason, surfaces)
    if method == "none":
        return _unrefined(pair, clouds, surfaces, guesses, scale)
    ends = [_refined(pair, clouds, surfaces, g, method, scale) for g in _distinct(pair, surfaces, guesses, scale)]
    ends.sort(key=lambda end: -end[0])
    score, motion, guess = ends[0]
    doubt = _doubt(clouds, ends)
    reason = doubt if motion.settled else "ICP has not come to rest on pairs of points"
    if score < _NO_FIT:
        doubt, reason = "", _MISFIT
    world = to_world(*pair, scaled(motion.transform, scale))
    kernels = _by_kernels(guesses, world)
    rests = motion.settled and score >= _NO_FIT
    return Solution(world, score, guess, kernels, guesses, rests, bool(doubt), reason, surfaces)


def _unrefined(
    pair: tuple[PreparedSurface, PreparedSurface], clouds: tuple[ScoredCloud, ScoredCloud],
    surfaces: tuple[ScoredSurface, ScoredSurface], guesses: tuple[Guess, ...], scale: float,
) -> Solution:  # fmt: skip
    """Take the guess whose short ICP ended best, but give it as the kernels did."""
    ends: list[tuple[float, Refined, Guess]] = []
    for guess in _distinct(pair, surfaces, guesses, scale):
        local = scaled(to_local(*pair, guess.moved), 1.0 / scale)
        ends.append((surface_score(*surfaces, local, SCORE_REACH), Refined(local, True, 0), guess))
    ends.sort(key=lambda end: -end[0])
    best = _by_kernels(guesses, ends[0][2].moved) or ends[0][2]
    score = surface_score(*surfaces, scaled(to_local(*pair, best.transform), 1.0 / scale), SCORE_REACH)
    doubt = _doubt(clouds, ends)
    return Solution(best.transform, score, best, best, guesses, True, bool(doubt), doubt, surfaces)


def _by_kernels(guesses: tuple[Guess, ...], answer: NDArray[np.float64]) -> Guess | None:
    """Choose what kernels alone would have answered: the best raw score, of those that lead to the answer if any."""
    kernels = [g for g in guesses if g.origin == "kernel"]
    leading = [g for g in kernels if rotation_angle_deg(g.moved, answer) <= _DISTINCT_DEG]
    return max(leading or kernels, key=lambda g: g.score, default=None)


def _distinct(
    pair: tuple[PreparedSurface, PreparedSurface], surfaces: tuple[ScoredSurface, ScoredSurface],
    guesses: tuple[Guess, ...], scale: float,
) -> list[Guess]:  # fmt: skip
    """Choose the guesses worth refining: near the best score of all, and apart from each other.

    Scores of samples favour samples that meet; the surfaces themselves decide among those that are close.
    """
    kept: list[Guess] = []
    for guess in guesses:
        near = guess.moved_score >= guesses[0].moved_score - 2.0 * _CLOSE
        if near and all(rotation_angle_deg(guess.moved, k.moved) > _DISTINCT_DEG for k in kept):
            kept.append(guess)
    kept = kept[: 2 * _MOST_REFINED]
    if len(kept) < 2:
        return kept
    locals_ = [scaled(to_local(*pair, g.moved), 1.0 / scale) for g in kept]
    scores = [surface_score(*surfaces, motion, SCORE_REACH) for motion in locals_]
    order = sorted(range(len(kept)), key=lambda k: -scores[k])
    return [kept[k] for k in order if scores[k] >= scores[order[0]] - _CLOSE][:_MOST_REFINED]


def _refined(
    pair: tuple[PreparedSurface, PreparedSurface], clouds: tuple[ScoredCloud, ScoredCloud],
    surfaces: tuple[ScoredSurface, ScoredSurface], guess: Guess, method: Refine, scale: float,
) -> tuple[float, Refined, Guess]:  # fmt: skip
    start = scaled(to_local(*pair, guess.moved), 1.0 / scale)
    motion = refined(*clouds, start, method)
    return surface_score(*surfaces, motion.transform, SCORE_REACH), motion, guess


def _doubt(clouds: tuple[ScoredCloud, ScoredCloud], ends: list[tuple[float, Refined, Guess]]) -> str:
    """Say why the answer is one of several, or nothing."""
    best_score, best, _ = ends[0]
    held = slack_of(*clouds, best.transform)
    if held[0] < _SLIDES * held[-1]:
        free = int((held < _SLIDES * held[-1]).sum())
        ways = "one way" if free == 1 else f"{free} ways"
        return f"the surfaces slide on each other in {ways}, as spheres and bodies of revolution do"
    for score, other, _ in ends[1:]:
        angle = rotation_angle_deg(other.transform, best.transform)
        if best_score - score < _EQUAL_SCORES and angle > _DISTINCT_DEG:
            return f"another motion, {angle:.0f} degrees away, fits as well (scores {best_score:.3f} and {score:.3f})"
    return ""


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
