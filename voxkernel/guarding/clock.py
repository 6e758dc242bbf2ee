"""What a long search says while it runs, and when it must end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

from voxkernel._notebook import InNotebooks

__all__ = ["Clock", "GuardsProgress"]


@dataclass(frozen=True, slots=True)
class GuardsProgress(InNotebooks):
    """Where a search for guards is.

    Attributes
    ----------
    stage : {"search", "confirm", "certify", "bound"}
        What is being done.
    n_guards : int
        Guards so far.
    seen : float
        Share of the samples that they see, in [0, 1].
    seconds : float
        Since the start.
    """

    stage: str
    n_guards: int
    seen: float
    seconds: float

    def __str__(self) -> str:
        """Say it in a line."""
        return f"{self.stage}: {self.n_guards} guards see {100.0 * self.seen:.2f} %, {self.seconds:.1f} s"


class Clock:
    """Tells a callback what happens, and whether the time is up."""

    def __init__(self, time_limit: float | None, progress: Callable[[GuardsProgress], object] | None) -> None:
        self._start = perf_counter()
        self._limit = time_limit
        self._progress = progress
        self._last = ("", 0, 0.0)

    @property
    def is_endless(self) -> bool:
        """Whether there is no limit."""
        return self._limit is None

    @property
    def is_over(self) -> bool:
        """Whether the time limit has passed."""
        return self._limit is not None and perf_counter() - self._start >= self._limit

    @property
    def left(self) -> float:
        """Seconds until the time limit; infinite without one."""
        return float("inf") if self._limit is None else max(0.0, self._limit - (perf_counter() - self._start))

    def tell(self, stage: str, n_guards: int | None = None, seen: float | None = None) -> None:
        """Call the callback; what is not given is as before."""
        n, share = self._last[1:]
        self._last = stage, n if n_guards is None else n_guards, share if seen is None else seen
        if self._progress is not None:
            self._progress(GuardsProgress(*self._last, perf_counter() - self._start))
