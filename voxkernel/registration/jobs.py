"""Jobs that do not depend on each other: one after the other, in processes of this machine, or on Dask workers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

__all__ = ["Job", "Run", "at_once", "in_turn", "runner"]

Job = tuple[Callable[..., Any], tuple[Any, ...]]
Tick = Callable[[int], None]


class Run(Protocol):
    """What does jobs and gives their answers in their order; `tick` hears how many are done, from `done` on."""

    def __call__(self, jobs: Sequence[Job], tick: Tick, done: int) -> list[Any]:
        """Do the jobs."""
        ...


def in_turn(jobs: Sequence[Job], tick: Tick, done: int) -> list[Any]:
    """Do the jobs here, one after the other."""
    answers: list[Any] = []
    for count, (work, given) in enumerate(jobs, start=done + 1):
        answers.append(work(*given))
        tick(count)
    return answers


def at_once(pool: Any, jobs: Sequence[Job], tick: Tick, done: int) -> list[Any]:
    """Do the jobs in the processes of a `ProcessPoolExecutor`."""
    from concurrent.futures import as_completed

    tasks = [pool.submit(work, *given) for work, given in jobs]
    try:
        for count, _ in enumerate(as_completed(tasks), start=done + 1):
            tick(count)
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    return [task.result() for task in tasks]


def _on_cluster(client: Any, jobs: Sequence[Job], tick: Tick, done: int) -> list[Any]:
    """Do the jobs on the workers of a Dask client; what many jobs are given is sent there once."""
    from voxkernel._extras import optional

    counts: dict[int, int] = {}
    for _, given in jobs:
        for thing in given:
            counts[id(thing)] = counts.get(id(thing), 0) + 1
    sent: dict[int, Any] = {}

    def there(thing: Any) -> Any:
        if counts[id(thing)] < 2 or isinstance(thing, str | int | float | tuple | dict | None):
            return thing
        if id(thing) not in sent:
            sent[id(thing)] = client.scatter(thing, hash=False)
        return sent[id(thing)]

    tasks = [client.submit(work, *map(there, given), pure=False) for work, given in jobs]
    try:
        for count, _ in enumerate(optional("distributed").as_completed(tasks, loop=client.loop), start=done + 1):
            tick(count)
        return list(client.gather(tasks))
    except BaseException:
        client.cancel(tasks)
        raise


@contextmanager
def runner(workers: int, client: Any) -> Generator[Run]:
    """Choose where jobs are done: on the client's workers where one is given, else in that many processes."""
    if client is not None:
        yield lambda jobs, tick, done: _on_cluster(client, jobs, tick, done)
    elif workers == 1:
        yield in_turn
    else:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            yield lambda jobs, tick, done: at_once(pool, jobs, tick, done)
