"""Send meshes to Dask workers, one task per worker at a time, and find out which mesh a lost worker was at."""

from __future__ import annotations

import math
import queue
import signal
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel.errors import SolverError
from voxkernel.evaluation.cluster import Cluster
from voxkernel.evaluation.inputs import Item, content_hash, with_data
from voxkernel.evaluation.label_parts import n_units
from voxkernel.evaluation.object_group import Pace
from voxkernel.evaluation.settings import EvaluateSettings
from voxkernel.evaluation.worker import Analyse, Outcome, failed_outcome, run_batch

__all__ = ["Dispatcher"]

_BATCH_SECONDS = 0.5
_BATCH = 64
_POLL = 0.25
_GRACE = 1.5  # seconds between a worker's disappearance and taking its task for lost
_NO_WORKERS = 120.0  # seconds without any worker until the run is given up
_START = 120.0  # seconds a worker may take to load or compile the loops
_WATCHDOG_EXIT = 1
_TRIES = 2  # for a mesh that was alone when its worker died
_OBJECTS = 1000  # of label images, at most in a task


@dataclass(frozen=True, slots=True)
class _Job:
    future: Any
    items: list[Item]
    address: str
    begin: float


class Dispatcher:
    """Evaluates items on a cluster and yields what comes out as it does.

    A worker holds one task at a time, so that when it dies it is known whose task that was. The meshes of such a
    task, or the objects of label images, are sent again, each alone; one that loses its worker twice while alone has
    failed.
    """

    def __init__(self, cluster: Cluster, items: Sequence[Item], settings: EvaluateSettings, analysis: Analyse) -> None:
        self._cluster, self._settings, self._analysis = cluster, settings, analysis
        self._fresh = deque(items)
        self._alone: deque[Item] = deque()
        self._losses: dict[tuple[str, int], int] = {}
        self._running: dict[str, _Job] = {}
        self._done: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._given_up: set[str] = set()
        self._gone: dict[str, float] = {}
        self._workers: set[str] = set()
        self._seen, self._last_worker = 0.0, time.monotonic()
        self._mean_seconds = 0.0  # of a mesh
        self._pace, self._n_objects = Pace(), n_units([item for item in items if item.group is not None])

    def outcomes(self) -> Iterator[Outcome | None]:
        """Yield outcomes; None from time to time when there is none."""
        while self._fresh or self._alone or self._running:
            yield from self._look_at_workers()
            yield from self._send()
            try:
                address = self._done.get(timeout=_POLL)
            except queue.Empty:
                yield None
                continue
            job = self._running.pop(address, None)
            if job is not None:
                outcomes = list(self._finished(job))
                yield from self._send()  # before the outcomes are written, which takes a while
                yield from outcomes

    def stop(self) -> None:
        """Cancel what runs."""
        futures = [job.future for job in self._running.values()]
        if futures:
            self._cluster.client.cancel(futures, force=True)
        self._running.clear()

    def _look_at_workers(self) -> Iterator[Outcome]:
        """Notice workers that are gone or do not answer, also where the scheduler does not tell."""
        now = time.monotonic()
        if now - self._seen < _POLL:
            return
        self._seen = now
        self._workers = self._cluster.workers()
        self._given_up &= self._workers
        if self._workers - self._given_up:
            self._last_worker = now
        elif now - self._last_worker > _NO_WORKERS:
            raise SolverError(f"the cluster has had no workers for {_NO_WORKERS:g} seconds")
        for address, job in list(self._running.items()):
            if address not in self._workers:
                self._gone.setdefault(address, now)
            late = self._is_late(job, now)
            # The scheduler's own word on a lost task comes through the future; it gets a moment to arrive.
            if late or (now - self._gone.get(address, now) > _GRACE and not job.future.done()):
                job.future.cancel(force=True)
                self._running.pop(address)
                if late:
                    self._given_up.add(address)
                yield from self._lost(job)

    def _is_late(self, job: _Job, now: float) -> bool:
        """Whether a worker should long have been ended by its own watchdog."""
        limit = self._settings.timeout
        return limit is not None and now - job.begin > _START + 1.5 * limit * len(job.items)

    def _send(self) -> Iterator[Outcome]:
        """Give every idle worker a task."""
        for address in sorted(self._workers - self._running.keys() - self._given_up):
            items: list[Item] = []
            for item in self._next_batch():
                try:
                    items.append(with_data(item))
                except Exception as error:
                    reason = f"cannot be read: {error or type(error).__name__}"
                    yield failed_outcome(item, self._settings, reason, known_hash="", seconds=0.0)
            if not items:
                if not self._fresh and not self._alone:
                    return
                continue
            future = self._cluster.client.submit(
                run_batch, items, self._settings, self._analysis, workers=[address], allow_other_workers=False,
                pure=False, retries=0,
            )  # fmt: skip
            self._running[address] = _Job(future, items, address, time.monotonic())
            future.add_done_callback(partial(_announce, self._done, address))

    def _next_batch(self) -> list[Item]:
        """Take one mesh to be alone, or as many as make about half a second."""
        if self._alone:
            return [self._alone.popleft()]
        if not self._fresh:
            return []
        if self._fresh[0].group is not None:
            return self._next_objects()
        wanted = 1 if self._mean_seconds == 0.0 else max(1, int(_BATCH_SECONDS / self._mean_seconds))
        fair = math.ceil(len(self._fresh) / (2 * max(1, len(self._workers))))
        batch: list[Item] = []
        while self._fresh and self._fresh[0].group is None and len(batch) < min(wanted, _BATCH, fair):
            batch.append(self._fresh.popleft())
        return batch

    def _next_objects(self) -> list[Item]:
        """Take objects of one label image or several, as many as make about a second."""
        batch: list[Item] = []
        budget = self._pace.budget()
        most = min(_OBJECTS, math.ceil(self._n_objects / (2 * max(1, len(self._workers)))))
        while self._fresh and most and len(batch) < _BATCH:
            item = self._fresh[0]
            if item.group is None or (batch and item.group.work[0] > budget):
                break
            within = int(np.searchsorted(np.cumsum(item.group.work[:most]), budget, side="right"))
            n = max(1, within)
            self._fresh.popleft()
            if n < len(item.group):
                self._fresh.appendleft(replace(item, group=item.group.cut(n, len(item.group))))
            batch.append(replace(item, group=item.group.cut(0, n)))
            budget -= float(item.group.work[:n].sum())
            most -= n
            self._n_objects -= n
        return batch

    def _finished(self, job: _Job) -> Iterator[Outcome]:
        """Take the result of a task, or find out why there is none."""
        from concurrent.futures import CancelledError

        killed = optional("distributed.scheduler").KilledWorker

        try:
            outcomes = self._cluster.result_of(job.future, timeout=30)
        except (killed, CancelledError, TimeoutError, OSError):
            yield from self._lost(job)
            return
        except Exception as error:
            raise SolverError(f"the workers cannot run the evaluation: {type(error).__name__}: {error}") from error
        finally:
            job.future.release()
        self._note_pace(job, outcomes)
        for item, outcome in zip(job.items, outcomes, strict=True):
            if not outcome.is_ok and item.group is not None and len(item.group) > 1:
                self._alone.extend(_each_alone(item))
                continue
            self._mean_seconds += (0.2 if self._mean_seconds else 1.0) * (outcome.seconds - self._mean_seconds)
            yield outcome

    def _note_pace(self, job: _Job, outcomes: Sequence[Outcome]) -> None:
        """Note how long objects have taken, without the reading of a file, which is done once."""
        groups = [item.group for item in job.items if item.group is not None]
        if not groups or not all(outcome.is_ok for outcome in outcomes):
            return
        seconds = sum(outcome.seconds for outcome in outcomes)
        if not groups[0].rows:
            seconds -= sum(row.get("seconds_read") or 0.0 for outcome in outcomes for row in outcome.rows)
        self._pace.note(sum(float(group.work.sum()) for group in groups), max(seconds, 1e-9))

    def _lost(self, job: _Job) -> Iterator[Outcome]:
        """Send the meshes of a lost task again, each alone; one that was alone may have failed."""
        self._workers.discard(job.address)
        apart = [one for item in job.items for one in _each_alone(item)]
        if len(apart) > 1:
            self._alone.extend(apart)
            return
        item, seconds = job.items[0], self._gone.pop(job.address, time.monotonic()) - job.begin
        end = self._cluster.end_of(job.address)
        limit = self._settings.timeout
        is_hang = limit is not None and seconds >= limit and (end is None or end[0] == _WATCHDOG_EXIT)
        key = item.name, -1 if item.group is None else int(item.group.ids[0])
        self._losses[key] = self._losses.get(key, 0) + 1
        if not is_hang and self._losses[key] < _TRIES:
            self._alone.append(item)
            return
        reason = f"took longer than {limit:g} s: its worker was killed" if is_hang else _crash(end, self._settings)
        yield failed_outcome(
            item, self._settings, reason, known_hash=item.known_hash or content_hash(item), seconds=seconds
        )


def _each_alone(item: Item) -> list[Item]:
    if item.group is None:
        return [item]
    return [replace(item, group=item.group.cut(k, k + 1)) for k in range(len(item.group))]


def _announce(done: queue.SimpleQueue[str], address: str, _: Any) -> None:
    done.put(address)


def _crash(end: tuple[int, bool] | None, settings: EvaluateSettings) -> str:
    """Say how a worker ended."""
    if end is None:
        return f"its worker was lost {_TRIES} times"
    code, was_too_large = end
    if was_too_large:
        limit = settings.memory_limit
        return "out of memory: its worker was killed" + (f" at the limit of {limit}" if limit is not None else "")
    if code >= 0:
        return f"its worker process ended with exit code {code}, {_TRIES} times"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"its worker process was killed by {name}, {_TRIES} times"
