"""Why an object falls short: what is hidden is shared out among its causes, and few rays are told apart from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["ENOUGH", "SEEN_WHOLE", "Hidden", "best_overlap", "causes_in", "rays_needed", "reason_of"]

ENOUGH = (0.8, 0.9)  # overlaps that numbers of rays are given for
_USUAL = 96  # rays of StarDist by default
_MARKS = {"fragment": "fragments", "hole": "hidden behind", "hidden part": "hidden part", "elongated": "elongated",
          "few rays": "too few"}  # fmt: skip
_LONG = 2.0  # up to here 96 rays from the middle reach 0.8 of an ellipsoid, a rod and a plate


@dataclass(frozen=True, slots=True)
class Hidden:
    """Voxels of an object that its best voxel does not see, each counted for one cause."""

    voxels: int  # of the object
    n_fragments: int
    apart: int  # outside the largest fragment
    n_holes: int
    hole_voxels: int
    behind_holes: int  # seen if the holes were filled
    bent: int  # the rest: out of sight behind a bend

    @property
    def total(self) -> int:
        """All that is hidden."""
        return self.apart + self.behind_holes + self.bent


SEEN_WHOLE = Hidden(1, 1, 0, 0, 0, 0, 0)  # of any object that is: it is not held once for each


def rays_needed(n_rays: tuple[int, ...], iou: tuple[float, ...]) -> tuple[int, int]:
    """The smallest numbers of rays that reach an overlap of 0.8 and of 0.9; 0 for none."""
    first, second = (
        min((n for n, value in zip(n_rays, iou, strict=True) if value >= enough), default=0) for enough in ENOUGH
    )
    return first, second


def best_overlap(n_rays: Sequence[int], iou: Sequence[float]) -> tuple[int, float]:
    """How many rays are usual, the most that were tried where 96 were not, and the best overlap of up to so many."""
    most = _USUAL if _USUAL in n_rays else max(n_rays)
    return most, max(value for n, value in zip(n_rays, iou, strict=True) if n <= most)


def causes_in(detail: str) -> list[str]:
    """Name the causes that a detail gives in words, in its order."""
    return [next(name for name, mark in _MARKS.items() if mark in words) for words in detail.split("; ") if words]


def reason_of(hidden: Hidden, elongation: float, n_rays: tuple[int, ...], iou: tuple[float, ...]) -> tuple[str, str]:
    """The main cause, and all that hold in words, the main one first; the rule: `LabelStars`."""
    whole, seen = hidden.voxels, (hidden.voxels - hidden.total) / hidden.voxels
    causes: list[tuple[float, str, str]] = []
    if hidden.n_fragments > 1:
        words = f"{hidden.n_fragments} fragments, {_share(hidden.apart, whole)} outside the largest"
        causes.append((hidden.apart / whole, "fragment", words))
    if hidden.n_holes:
        holes = "hole" if hidden.n_holes == 1 else "holes"
        size = "1 voxel" if hidden.hole_voxels == 1 else f"{hidden.hole_voxels} voxels"
        words = f"{hidden.n_holes} {holes} of {size}, {_share(hidden.behind_holes, whole)} hidden behind"
        causes.append((hidden.behind_holes / whole, "hole", words))
    if hidden.bent:
        words = f"hidden part of {_share(hidden.bent, whole)}"
        causes.append((hidden.bent / whole, "hidden part", words))
    most, best = best_overlap(n_rays, iou)
    if best < ENOUGH[0] and (best < ENOUGH[0] * seen or seen - best > hidden.total / whole):
        reach = f"they reach an overlap of {math.floor(1000 * best) / 1000:.3f}"
        if causes and elongation < _LONG:  # from the middle they would do
            causes.append((0.0, "few rays", f"{most} rays are too few from the best voxel: {reach}"))
        else:
            cost = seen - best if seen >= ENOUGH[0] else 0.0  # less than that, and no rays would do
            causes.append((cost, "elongated", f"too elongated for {most} rays: {reach}"))
    if not causes:
        return "", ""
    causes.sort(key=lambda cause: -cause[0])  # equal ones stay in this order
    return causes[0][1], "; ".join(words for _, _, words in causes)


def _share(part: int, whole: int) -> str:
    """A share in percent, never 0.00% or 100.00% where it is not so."""
    if 0 < part < 5e-5 * whole:
        return "less than 0.01%"
    if 0 < whole - part < 5e-5 * whole:
        return "more than 99.99%"
    return f"{part / whole:.2%}"
