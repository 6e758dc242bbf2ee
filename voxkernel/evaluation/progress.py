"""How far an evaluation is, in numbers for any caller."""

from __future__ import annotations

import time
from dataclasses import dataclass

__all__ = ["EvaluationProgress", "Speed", "clock"]

_WINDOW = 30.0


@dataclass(frozen=True, slots=True)
class EvaluationProgress:
    """How far an evaluation is.

    Attributes
    ----------
    total, done, failed, reused : int
        Meshes given; with a row on disk, of which failed, and of which were there before this run. Objects of label
        images count by themselves, and once more if they are drawn; `failed` counts files.
    rate : float
        Of these, per second lately; 0 at first.
    remaining : float or None
        Estimated seconds; None while nothing is known.
    """

    total: int
    done: int
    failed: int
    reused: int
    rate: float
    remaining: float | None

    def __str__(self) -> str:
        """Say it in one line."""
        text = f"{self.done} of {self.total} done, {self.failed} failed"
        text += f", {self.reused} from before" if self.reused else ""
        if self.rate:
            text += f", {self.rate:.3g} per second"
        return text if self.remaining is None else f"{text}, {clock(self.remaining)} remaining"


class Speed:
    """Meshes per second over the last half minute."""

    def __init__(self) -> None:
        self._marks: list[tuple[float, int]] = [(time.monotonic(), 0)]

    def at(self, count: int) -> float:
        """Note how many are done and give the rate."""
        now = time.monotonic()
        if count == 0:  # the cluster starts, or loops are compiled
            self._marks.clear()
        self._marks.append((now, count))
        while len(self._marks) > 2 and self._marks[1][0] < now - _WINDOW:
            self._marks.pop(0)
        begin, before = self._marks[0]
        return (count - before) / (now - begin) if now > begin else 0.0


def clock(seconds: float) -> str:
    """Write a duration as m:ss or h:mm:ss."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
