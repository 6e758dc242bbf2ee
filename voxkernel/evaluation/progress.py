"""How far an evaluation is: numbers for any caller, a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

__all__ = ["EvaluationProgress", "Speed", "shown"]

_PLAIN_SECONDS = 10.0
_WINDOW = 30.0


@dataclass(frozen=True, slots=True)
class EvaluationProgress:
    """How far an evaluation is.

    Attributes
    ----------
    total, done, failed, reused : int
        Meshes given; with a row on disk, of which failed, and of which were there before this run.
    rate : float
        Meshes per second lately; 0 at first.
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


@contextmanager
def shown(*, quiet: bool) -> Generator[Callable[[EvaluationProgress], None] | None]:
    """Give what shows progress on stderr: a bar on a terminal, lines elsewhere, nothing when quiet."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        yield _lines()


def _lines() -> Callable[[EvaluationProgress], None]:
    """Print a line every ten seconds or tenth of the work, and the last one."""
    last: list[Any] = [time.monotonic(), 0]

    def show(state: EvaluationProgress) -> None:
        now, tenth = time.monotonic(), 10 * state.done // max(1, state.total)
        if now - last[0] >= _PLAIN_SECONDS or tenth > last[1]:
            last[:] = now, tenth
            sys.stderr.write(f"voxkernel: {state}\n")
            sys.stderr.flush()

    return show


@contextmanager
def _bar() -> Generator[Callable[[EvaluationProgress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[words]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=None, words="starting")

        def show(state: EvaluationProgress) -> None:
            words = f"[red]{state.failed} failed[/red]" if state.failed else "0 failed"
            words += f", {state.rate:.3g} per second" if state.rate else ""
            words += "" if state.remaining is None else f", {clock(state.remaining)} remaining"
            progress.update(task, total=state.total, completed=state.done, words=words)

        yield show
