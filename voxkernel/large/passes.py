"""One pass over the chunks of a stream: on one thread, on several, or on the workers of a Dask cluster.

What is made of the chunks is merged in a tree, neighbours first. Merging has to be associative: then it matters
neither how many chunks there are nor where and when they are worked on.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple, Protocol

from voxkernel._dask_client import client_of, result_of
from voxkernel._extras import optional
from voxkernel.errors import SolverError
from voxkernel.large.chunks import Chunk, Piece

__all__ = ["HERE", "Merge", "Part", "Place", "Task", "Workers", "workers_of"]

_PAUSE = 0.05  # only the main thread hears signals, and on some systems only between two waits
_AHEAD = 2  # chunks a thread is ahead of the merging
_WIDTH = 8  # results merged at a time on a cluster
_MOST_AT_ONCE = 512  # chunks on a cluster, so that those sent there do not fill its scheduler
_NO_WORKERS = 120.0  # seconds without any worker until a pass is given up


class Place(NamedTuple):
    """Where a chunk begins: its number, its first facet, and the number of the first facet of it with a plane."""

    number: int
    facet: int
    plane: int


class Part(NamedTuple):
    """A piece of a stream and where it begins."""

    place: Place
    piece: Piece


Task = Callable[[Place, Chunk], Any]
Merge = Callable[[Any, Any], Any]


class Workers(Protocol):
    """What makes a pass. A task or a merger that returns None has seen enough: the pass may end, with None."""

    def folded(self, parts: Iterator[Part], task: Task, merge: Merge) -> Any:
        """What `task` makes of every chunk, merged; None where there is no chunk."""
        ...


class _Tree:
    """Results in their order, merged when two are made of equally many."""

    def __init__(self, merge: Merge) -> None:
        self._merge = merge
        self._found: list[tuple[int, Any]] = []

    def add(self, found: Any) -> bool:
        """Take in the next; False when the pass may end."""
        size = 1
        while self._found and self._found[-1][0] == size and found is not None:
            found = self._merge(self._found.pop()[1], found)
            size *= 2
        self._found.append((size, found))
        return found is not None

    def result(self) -> Any:
        """All of them merged."""
        if not self._found:
            return None
        found = self._found.pop()[1]
        while self._found and found is not None:
            found = self._merge(self._found.pop()[1], found)
        return found


class _Here:
    """One thread: this one."""

    def folded(self, parts: Iterator[Part], task: Task, merge: Merge) -> Any:
        """Take chunk after chunk."""
        tree = _Tree(merge)
        for place, piece in parts:
            if not tree.add(task(place, piece.read())):
                break
        return tree.result()


HERE = _Here()


class _Threads(NamedTuple):
    """Several threads, which read and work; this one merges."""

    n: int

    def folded(self, parts: Iterator[Part], task: Task, merge: Merge) -> Any:
        tree, waiting = _Tree(merge), deque[Future[Any]]()
        with ThreadPoolExecutor(self.n) as pool:
            try:
                for place, piece in parts:
                    waiting.append(pool.submit(_worked, task, place, piece))
                    if len(waiting) > _AHEAD * self.n and not tree.add(_waited(waiting.popleft())):
                        return None
                while waiting:
                    if not tree.add(_waited(waiting.popleft())):
                        return None
            finally:
                for future in waiting:
                    future.cancel()
        return tree.result()


def _waited(future: Future[Any]) -> Any:
    while True:
        try:
            return future.result(_PAUSE)
        except TimeoutError:
            if future.done():
                raise


def _worked(task: Task, place: Place, piece: Piece) -> Any:
    return task(place, piece.read())


class _Cluster(NamedTuple):
    """The workers of a cluster, which read files themselves; other chunks are sent to them.

    Dask does the chunks and merged results of a lost worker anew.
    """

    client: Any

    def folded(self, parts: Iterator[Part], task: Task, merge: Merge) -> Any:
        room = threading.Semaphore(_MOST_AT_ONCE)
        levels: list[list[Any]] = []  # of futures; those of later levels stand for earlier chunks
        every: list[Any] = []
        failed: list[Any] = []

        def ended(future: Any) -> None:
            if future.status == "error":
                failed.append(future)
            room.release()

        def add(future: Any) -> None:
            for level in range(len(levels) + 1):
                if level == len(levels):
                    levels.append([])
                levels[level].append(future)
                if len(levels[level]) < _WIDTH:
                    return
                future = self.client.submit(_merged, merge, *levels[level], pure=False)
                levels[level] = []

        try:
            for place, piece in parts:
                self._wait(room.acquire)
                if failed:
                    return self._result(failed[0])
                # A partial, so that nobody looks for futures in the arrays of a chunk.
                future = self.client.submit(partial(_worked, task, place, piece), pure=False)
                future.add_done_callback(ended)
                add(future)
            every = [future for level in reversed(levels) for future in level]
            if not every:
                return None
            last = self.client.submit(_merged, merge, *every, pure=False)
            every.append(last)
            done = threading.Event()

            def is_over(_: Any) -> None:
                done.set()

            last.add_done_callback(is_over)
            self._wait(done.wait)
            return self._result(last)
        except BaseException:
            self.client.cancel([future for level in levels for future in level] + every, force=True)
            raise

    def _wait(self, wait: Callable[..., bool]) -> None:
        """Wait; a cluster without workers is given up."""
        from time import monotonic

        seen = monotonic()
        while not wait(timeout=1.0):
            if self.client.status != "running":
                raise SolverError("the scheduler cannot be reached any more")
            if self.client.nthreads():
                seen = monotonic()
            elif monotonic() - seen > _NO_WORKERS:
                raise SolverError(f"the cluster has had no workers for {_NO_WORKERS:g} seconds")

    def _result(self, future: Any) -> Any:
        from concurrent.futures import CancelledError

        killed = optional("distributed.scheduler").KilledWorker
        try:
            return result_of(self.client, future)
        except killed:
            raise SolverError("workers were lost again and again while they worked on one chunk") from None
        except CancelledError:
            raise SolverError("the scheduler has lost its work") from None


def _merged(merge: Merge, *found: Any) -> Any:
    tree = _Tree(merge)
    for one in found:
        if not tree.add(one):
            return None
    return tree.result()


@contextmanager
def workers_of(threads: int, scheduler: str | None = None) -> Generator[Workers]:
    """Choose what makes the passes; a connection to a scheduler is closed at the end."""
    if scheduler is not None:
        quiet = {"distributed.admin.large-graph-warning-threshold": "1GB"}  # chunks are sent with their tasks
        with client_of(scheduler) as client, optional("dask").config.set(quiet):
            yield _Cluster(client)
    else:
        yield HERE if threads == 1 else _Threads(threads)
