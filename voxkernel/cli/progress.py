"""The progress of an evaluation on stderr: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from voxkernel._extras import optional
from voxkernel.evaluation.progress import EvaluationProgress, clock

__all__ = ["shown"]

_PLAIN_SECONDS = 10.0


@contextmanager
def shown(*, quiet: bool) -> Generator[Callable[[EvaluationProgress], None] | None]:
    """Give what shows progress on stderr: a bar on a terminal if `rich` is there, else lines; nothing when quiet."""
    if quiet:
        yield None
    elif sys.stderr.isatty() and find_spec("rich") is not None:
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
    console, rich = optional("rich.console").Console(stderr=True), optional("rich.progress")
    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TextColumn("{task.fields[words]}"))
    with rich.Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=None, words="starting")

        def show(state: EvaluationProgress) -> None:
            words = f"[red]{state.failed} failed[/red]" if state.failed else "0 failed"
            words += f", {state.rate:.3g} per second" if state.rate else ""
            words += "" if state.remaining is None else f", {clock(state.remaining)} remaining"
            progress.update(task, total=state.total, completed=state.done, words=words)

        yield show
