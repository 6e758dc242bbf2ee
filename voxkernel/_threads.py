"""Parts of one computation on several threads, which stop when the thread that waits for them is interrupted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

from voxkernel._core import StopFlag

__all__ = ["run_parts"]

Part = TypeVar("Part")
Result = TypeVar("Result")
# Only the main thread of Python hears signals, and on some systems only between two waits.
_PAUSE = 0.05


def run_parts(work: Callable[[Part, StopFlag], Result], parts: Sequence[Part], threads: int) -> list[Result]:
    """Run `work(part, stop)` for every part and return the results in order; one thread starts none.

    `work` hands the flag on to the compiled loops it calls. The first error, an interrupt among them,
    stops all parts and is raised when they have ended.
    """
    stop = StopFlag()
    if threads == 1 or len(parts) <= 1:
        return [work(part, stop) for part in parts]
    with ThreadPoolExecutor(min(threads, len(parts))) as pool:
        futures = [pool.submit(work, part, stop) for part in parts]
        try:
            while wait(futures, timeout=_PAUSE).not_done:
                for future in futures:
                    if future.done():
                        future.result()
            return [future.result() for future in futures]
        except BaseException:
            stop.set()
            for future in futures:
                future.cancel()
            raise
