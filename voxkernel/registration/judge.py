"""What to believe of the ends of a contest: the answer is the one that explains most, unless another is believed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.contest import Contest, End
from voxkernel.registration.evidence import Evidence
from voxkernel.registration.search import rotation_angle_deg
from voxkernel.registration.verdict import NO_MATCH, believed, descriptors

__all__ = ["Judge", "Judged"]

_CLEAR = 0.75  # a probability at which no further source of candidates is asked
_BELIEVED = 0.5  # a probability from which an end is preferred to one that explains more and is believed less
_LEAST_RANK = 0.1  # of an end that is looked at once more
_MAY_BE = 0.1  # a probability before an end is refined on all samples
_OTHER_SIZE = 0.02
_OTHERWISE = 0.02  # the most that is believed where another size fits better
_EQUAL_RANKS = 0.02
_MUCH_LESS = 0.02  # odds that are such a share of those of the answer are no other answer
_SLIDES = 4e-3  # of the largest eigenvalue: a direction that may be free


class Judged(NamedTuple):
    """Numbers for the verdict, the probability, the scale at which the surfaces clearly fit better (or 1), the best."""

    numbers: NDArray[np.float64]
    probability: float
    other_size: float
    size: float


class _Measured(NamedTuple):
    evidence: Evidence
    size: float
    error: float  # standard, of the logarithm of the size
    other_size: float


class Judge:
    """Measures ends of a contest, each once.

    An end that slides over smooth surfaces can explain more of them than the true one, a little off everywhere; what
    is measured of both tells them apart.
    """

    def __init__(self, contest: Contest) -> None:
        self.contest = contest
        self._known: list[tuple[End, _Measured]] = []
        self._looked_at: list[End] = []

    def clear(self) -> bool:
        """Whether the end that explains most, or one that comes after it, is clearly believed."""
        best = self.contest.best
        if best is None or self.of(best).probability > _CLEAR:
            return best is not None
        if any(self._could_be(end) and self.of(end).probability > _CLEAR for end in self.contest.contenders()):
            return True
        return any(self._could_be(end) and self.of(end).probability > _CLEAR for end in self._overlooked())

    def _overlooked(self) -> Iterator[End]:
        """Refine ends that explain less than others but, as they are, may be believed."""
        for end in [e for e in self.contest.ends if not e.whole and e.rank >= _LEAST_RANK]:
            if any(other is end for other in self._looked_at):
                continue
            self._looked_at.append(end)
            motion = end.polished.transform
            rough = self.contest.evidence(motion)
            if believed(descriptors(rough, self._rival(end), 1.0, 0.0)) >= _MAY_BE:
                yield self.contest.whole(end)

    @property
    def best(self) -> End | None:
        """The end that explains most, unless it is believed less than not and another one more."""
        best = self.contest.best
        known = [(self.of(end).probability, end) for end, _ in self._known if self._is_there(end)]
        believed_most = max(known, key=lambda entry: entry[0], default=(0.0, None))
        if best is None or believed_most[0] < _BELIEVED or self.of(best).probability >= _BELIEVED:
            return best
        return believed_most[1]

    def of(self, end: End) -> Judged:
        """Believe an end or not, beside what has been tried so far."""
        known = next((measured for other, measured in self._known if other is end), None)
        if known is None:
            known = self._measured(end)
            self._known.append((end, known))
        numbers = descriptors(known.evidence, self._rival(end), known.size, known.error)
        probability = believed(numbers)
        return Judged(
            numbers, probability if known.other_size == 1.0 else min(probability, _OTHERWISE), known.other_size,
            known.size,
        )  # fmt: skip

    def _measured(self, end: End) -> _Measured:
        contest = self.contest
        evidence = contest.evidence(end.polished.transform, end.fit)
        size, error, similarity = contest.better_size(end)
        other = abs(np.log(size)) > _OTHER_SIZE and _fits_better(contest.evidence(similarity), evidence)
        return _Measured(evidence, size, error, size if other else 1.0)

    def doubt(self, best: End) -> str:
        """Say why the answer is one of several, or nothing; what is believed much less is no other answer."""
        free = self.contest.slides(best, _SLIDES)
        if free:
            ways = "one way" if free == 1 else f"{free} ways"
            return f"the surfaces slide on each other in {ways}, as spheres and bodies of revolution do"
        probability = self.of(best).probability
        odds = _MUCH_LESS * probability / max(1.0 - probability, 1e-9)
        for other in self.contest.rivals(best):
            if best.rank - other.rank >= _EQUAL_RANKS:
                break
            if probability >= _BELIEVED and self._is_no_match(other, odds):
                continue
            angle = rotation_angle_deg(other.polished.transform, best.polished.transform)
            ranks = f"{best.rank:.3f} and {other.rank:.3f}"
            return f"another motion, {angle:.0f} degrees away, fits as well (ranks {ranks})"
        return ""

    def _is_no_match(self, end: End, odds: float) -> bool:
        """Whether an end is no match by itself, or its odds are below those given."""
        settled = self.contest.whole(end)
        least = max(NO_MATCH, odds / (1.0 + odds))
        return not self._could_be(settled, least) or self.of(settled).probability < least

    def _could_be(self, end: End, least: float = _BELIEVED) -> bool:
        """Whether an end would be believed so much if no other size fitted better: it is believed less."""
        evidence = self.contest.evidence(end.polished.transform, end.fit)
        return believed(descriptors(evidence, self._rival(end), 1.0, 0.0)) >= least

    def _rival(self, end: End) -> float:
        rivals = self.contest.rivals(end)
        return rivals[0].rank / end.rank if rivals else 0.0

    def _is_there(self, end: End) -> bool:
        return any(other is end for other in self.contest.ends)


def _fits_better(resized: Evidence, evidence: Evidence) -> bool:
    return resized.systematic < 0.6 * evidence.systematic and resized.agreement >= evidence.agreement - 0.02
