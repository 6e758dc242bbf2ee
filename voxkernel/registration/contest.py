"""A pair of surfaces and its candidates: each source of them in turn, all judged alike, until one fits clearly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.evidence import Evidence, Fit, evidence_of, fit_of, slack_of, slides
from voxkernel.registration.features import feature_motions, feature_points
from voxkernel.registration.motions import scaled
from voxkernel.registration.parts import moments_of_part, smooth_parts
from voxkernel.registration.polish import Polished, polished
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.rounding import motion_on_grid, on_grid
from voxkernel.registration.search import Guess, ScoredCloud, add_guesses, kernel_guesses, net_guesses, tried
from voxkernel.registration.search import rotation_angle_deg as angle_deg
from voxkernel.registration.side import Side

__all__ = ["Contest", "End"]

_SAMPLES = 1000
_FEW = 4  # every fourth sample where candidates are compared
_REACH = 1 / 45  # of the smaller diagonal: how near explains
_WIDE = 1 / 16  # of the larger diagonal: where refinement starts
_LEAST = 1 / 300
_STEPS = 10
_WHOLE_STEPS = 6  # on all samples, before it is known which end is the best
_LAST_STEPS = 30
_ROUGHLY = 1e-4  # a step on few samples that is not worth another one
_SIZE_STEPS = 6
_WHOLE_SIZE_STEPS = 3
_SAME_SIZE = 2e-3  # logarithm of a scale that is not measured on all samples
# Spacing of points with features, a share of the larger diagonal, and how many spacings around it a feature describes.
_FEATURES = ((1 / 50, 5.0), (1 / 60, 3.5), (1 / 90, 4.0))
_MOST = {"kernel": 60, "part": 12, "feature": 40}  # moved by a short ICP; those of features are judged as they are
_MOST_OTHERS = 12
_POLISHED = {"kernel": 3, "feature": 4}  # of each source; 2 of the others
_MOST_AGREED = 2  # motions on which most matches of features agree, refined whatever they explain before
_HOPELESS = -0.05  # a rank before refinement below which only kernels' candidates are refined
_WORSE = 0.35  # a score so far below the best is not looked at more closely
_AHEAD = 0.25  # a refined rank so far above the unrefined ones of other candidates ends the source
_SETTLED = 0.04  # an end whose rank on few samples comes so close to the best is refined on all
_NO_FIT = 0.0  # a rank below which more samples do not help
_CONTENDERS = 4  # ends beside the best that may be believed more
_CONTENDS = 0.5  # of the best rank: what an end must have for that
_CLEARLY = 0.5  # a rank beside which candidates that start with less than half of it are left out
_DISTINCT_DEG = 5.0
_APART = 0.03


class End(NamedTuple):
    """Where a candidate ended after refinement, in local frames, unit scale."""

    rank: float
    polished: Polished
    guess: Guess
    fit: Fit
    whole: bool  # whether it was refined and judged on all samples


class Contest:
    """One pair in its local frames, scaled to its larger diagonal."""

    def __init__(self, source: PreparedSurface, target: PreparedSurface) -> None:
        self.pair = source, target
        self.scale = max(p.diagonal for p in self.pair)
        self.reach = float(on_grid(np.array(min(p.diagonal for p in self.pair) / self.scale * _REACH)))
        self.guesses: list[Guess] = []
        self.ends: list[End] = []

    @cached_property
    def sides(self) -> tuple[Side, Side]:
        """Both surfaces with all their samples."""
        one, two = (Side(p.skin, self.scale, _SAMPLES) for p in self.pair)
        return one, two

    @cached_property
    def few(self) -> tuple[Side, Side]:
        """Both surfaces with some of their samples."""
        one, two = (s.every(_FEW) for s in self.sides)
        return one, two

    @cached_property
    def clouds(self) -> tuple[ScoredCloud, ScoredCloud]:
        """Coarse samples for short ICP."""
        one, two = (ScoredCloud(p.coarse, self.scale) for p in self.pair)
        return one, two

    def run(self, clear: Callable[[], bool], sources: int, first: Sequence[Guess] = ()) -> None:
        """Try the first guesses and source after source, at most so many, until the best answer fits clearly.

        One source follows the first guesses whatever they are: without rivals too much would be believed.
        """
        if first:
            self.guesses += first
            self.enter([(self._start(guess), guess) for guess in first])
        for guesses in islice(self._sources(), sources):
            self._judge(guesses)
            self.settle()
            if self._fits() and clear():
                break

    def _fits(self) -> bool:
        best = self.best
        return best is not None and best.rank >= _NO_FIT

    def settle(self) -> End | None:
        """Refine the best end, and those that come close to it, on all samples; give the best after that."""
        while True:
            best = self.best
            if best is None or best.rank < _NO_FIT:
                return best
            at = best.polished.transform
            close = (k for k, e in enumerate(self.ends) if not e.whole and e.rank >= best.rank - _SETTLED)
            rough = [k for k in close if self.ends[k] is best or _apart(self.ends[k].polished.transform, at)]
            if not rough:
                return best
            for k in rough:
                self.ends[k] = self._settled(self.ends[k])

    @property
    def best(self) -> End | None:
        """The end that explains most, less what contradicts it."""
        return max(self.ends, key=lambda end: end.rank, default=None)

    def contenders(self) -> list[End]:
        """The ends after the best that are other motions, a few, refined on all samples."""
        best = self.best
        if best is None:
            return []
        shown = [best]
        for end in sorted(self.ends, key=lambda e: -e.rank):
            if len(shown) > _CONTENDERS or end.rank < max(_NO_FIT, _CONTENDS * best.rank):
                break
            if all(_apart(end.polished.transform, other.polished.transform) for other in shown):
                shown.append(self.whole(end))
        return shown[1:]

    def whole(self, end: End) -> End:
        """Refine an end on all samples, unless it is already, and put it in its place."""
        if end.whole:
            return end
        place = next(k for k, other in enumerate(self.ends) if other is end)
        self.ends[place] = self._settled(end)
        return self.ends[place]

    def rivals(self, best: End) -> list[End]:
        """Other ends that are not the same motion, best first."""
        others = [e for e in self.ends if _apart(e.polished.transform, best.polished.transform)]
        return sorted(others, key=lambda e: -e.rank)

    def _sources(self) -> Iterator[list[Guess]]:
        one, two = self.pair
        by_kernels = kernel_guesses(one.margins, one.moments, two.moments, "kernel")
        yield by_kernels
        for spacing, radius in _FEATURES:
            yield self._by_features(spacing, radius)
        yield self._by_parts()
        yield net_guesses(one, two, by_kernels)

    def _by_features(self, spacing: float, radius: float) -> list[Guess]:
        one, two = (feature_points(p, self.scale, spacing, radius * spacing) for p in self.pair)
        motions = (scaled(m, self.scale) for m in feature_motions(one, two, spacing, _MOST["feature"]))
        return [Guess(m, "feature", np.nan, m) for m in motions]

    def _by_parts(self) -> list[Guess]:
        """Kernels of what the best motion explains, and of smooth parts against the whole and each other."""
        kept: list[Guess] = []
        one, two = self.pair
        best = self.best
        if best is not None:
            masks = self._explained(best)
            moments = [moments_of_part(p, m) for p, m in zip(self.pair, masks, strict=True)]
            add_guesses(kept, kernel_guesses(one.margins, moments[0], moments[1], "part"))
        parts = [[moments_of_part(p, m) for m in smooth_parts(p)] for p in self.pair]
        for a in (one.moments, *parts[0]):
            for b in (two.moments, *parts[1]):
                if a is not one.moments or b is not two.moments:
                    add_guesses(kept, kernel_guesses(one.margins, a, b, "part"))
        return kept

    def _explained(self, end: End) -> list[NDArray[np.bool_]]:
        """Masks of the facets of the thinned surfaces that the other one explains, wide of the mark too."""
        motion = scaled(end.polished.transform, self.scale)
        back = np.linalg.inv(motion)
        masks: list[NDArray[np.bool_]] = []
        for own, other, move in ((0, 1, motion), (1, 0, back)):
            skin = self.pair[own].skin
            middles = skin.vertices[skin.faces].mean(axis=1) @ move[:3, :3].T + move[:3, 3]
            found = self.sides[other].nearest(middles / self.scale)
            masks.append((found.distances < 2.0 * self.reach) & ~found.on_rim)
        return masks

    def _judge(self, guesses: list[Guess]) -> None:
        if not guesses:
            return
        origin = guesses[0].origin
        near = guesses
        if origin != "feature":
            near = tried(guesses, self.clouds, self.scale, _MOST.get(origin, _MOST_OTHERS))
        most = _POLISHED.get(origin, 2)
        self.guesses += near
        kept: list[Guess] = []
        ranks: list[float] = []
        for guess in near:
            moved = self._start(guess)
            if all(_apart(moved, self._start(k)) for k in kept):
                kept.append(guess)
                ranks.append(fit_of(*self.few, moved, 2.0 * self.reach).rank)
            few = origin != "feature" and len(kept) == 3 * most
            if few or guess.moved_score < near[0].moved_score - _WORSE:
                break
        order = sorted(range(len(kept)), key=lambda k: -ranks[k])[:most]
        if origin == "feature":
            order += [k for k in range(min(_MOST_AGREED, len(kept))) if k not in order]
        for k in order:
            if origin != "feature" and self._is_hopeless(ranks[k], origin):
                break
            self._refine(self._start(kept[k]), kept[k])

    def _is_hopeless(self, rank: float, origin: str) -> bool:
        """Whether a candidate need not be refined; where little is in common, what explains little may be true."""
        if origin != "kernel" and rank < _HOPELESS:
            return True
        ahead = _AHEAD if origin == "kernel" else 1.0  # what is not believed does not end later sources
        return any(end.rank > _CLEARLY and rank < max(0.5 * end.rank, end.rank - ahead) for end in self.ends)

    def _start(self, guess: Guess) -> NDArray[np.float64]:
        return motion_on_grid(scaled(guess.moved, 1.0 / self.scale))

    def enter(self, motions: list[tuple[NDArray[np.float64], Guess]]) -> None:
        """Refine and judge motions that were found elsewhere."""
        for start, guess in motions:
            self._refine(motion_on_grid(start), guess)
        self.settle()

    def _refine(self, start: NDArray[np.float64], guess: Guess) -> None:
        end = polished(*self.few, start, reach=_WIDE, least=_LEAST, steps=_STEPS, rests=_ROUGHLY)
        if np.isfinite(end.step):
            fit = fit_of(*self.few, end.transform, self.reach)
            self.ends.append(End(fit.rank, end, guess, fit, whole=False))

    def rested(self, end: End) -> End:
        """Refine an end on all samples until it rests, unless it does already."""
        return end if end.polished.rests() else self._settled(end, _LAST_STEPS)

    def _settled(self, end: End, steps: int = _WHOLE_STEPS) -> End:
        """Refine an end on all samples."""
        wide = max(1.5 * end.polished.reach, _LEAST)
        more = polished(*self.sides, end.polished.transform, reach=wide, least=_LEAST, steps=steps)
        motion = more.transform if np.isfinite(more.step) else end.polished.transform
        return self.measured(end, motion, more if np.isfinite(more.step) else end.polished)

    def measured(self, end: End, motion: NDArray[np.float64], after: Polished) -> End:
        """Judge the motion that an end was refined to."""
        fit = self.fit(motion)
        return End(fit.rank, after._replace(transform=motion), end.guess, fit, whole=True)

    def slides(self, end: End, below: float) -> int:
        """Count the ways in which the surfaces slide on each other, of those held less than `below` of the firmest."""
        if not end.whole:
            return 6
        slack = slack_of(*self.sides, end.fit)
        soft = np.flatnonzero(slack.values < below * slack.values[-1]) if slack.values[-1] > 0.0 else range(6)
        motion = end.polished.transform
        return sum(slides(*self.sides, motion, end.fit, slack, int(way)) for way in soft)

    def better_size(self, end: End) -> tuple[float, float, NDArray[np.float64]]:
        """The scale at which the surfaces would fit better, the standard error of its logarithm, the similarity."""
        wide = max(4.0 * end.polished.reach, 0.5 * _WIDE)
        more = polished(
            *self.few, end.polished.transform, reach=wide, least=_LEAST, steps=_SIZE_STEPS, with_scale=True
        )
        if np.isfinite(more.step) and abs(np.log(_size_of(more))) > _SAME_SIZE:
            again = polished(
                *self.sides, more.transform, reach=max(1.5 * more.reach, _LEAST), least=_LEAST,
                steps=_WHOLE_SIZE_STEPS, with_scale=True,
            )  # fmt: skip
            more = again if np.isfinite(again.step) else more
        return _size_of(more), float(more.errors[-1]), more.transform

    def fit(self, motion: NDArray[np.float64]) -> Fit:
        """Look from all samples of each surface at the other one."""
        return fit_of(*self.sides, motion, self.reach)

    def evidence(self, motion: NDArray[np.float64], fit: Fit | None = None) -> Evidence:
        """What is measured of a motion, on all samples."""
        return evidence_of(*self.sides, motion, self.fit(motion) if fit is None else fit)


def _size_of(found: Polished) -> float:
    return float(np.cbrt(np.linalg.det(found.transform[:3, :3])))


def _apart(one: NDArray[np.float64], two: NDArray[np.float64]) -> bool:
    return angle_deg(one, two) > _DISTINCT_DEG or float(np.linalg.norm((one - two)[:3, 3])) > _APART
