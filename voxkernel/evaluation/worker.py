"""The task that runs in a Dask worker: some meshes one after the other, each with a time and a memory limit.

A mesh that raises costs its row. A mesh that takes the process down (a reader that segfaults, the time limit)
loses this task; the dispatcher then sends its meshes again, one by one.
"""

from __future__ import annotations

import atexit
import faulthandler
import os
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from time import perf_counter
from typing import Any

from voxkernel._extras import optional
from voxkernel._fork_server import OWN_WORKER
from voxkernel.errors import VoxKernelError
from voxkernel.evaluation.analysis import Analysis, analyse, warm_up
from voxkernel.evaluation.file_stamp import STAMP_COLUMNS, FileStamp, stamp_of
from voxkernel.evaluation.inputs import Item, content_hash, local_copy
from voxkernel.evaluation.settings import EvaluateSettings, settings_hash, settings_text, versions_text
from voxkernel.labels import is_label_file

__all__ = ["Outcome", "failed_outcome", "run_batch"]

Analyse = Callable[..., Analysis]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came out for one mesh, or some objects: rows, the files they name, seconds, how many were worked on."""

    name: str
    rows: tuple[Mapping[str, Any], ...]
    files: Mapping[str, bytes] = field(default_factory=dict[str, bytes])
    seconds: float = 0.0
    units: int = 1

    @property
    def is_ok(self) -> bool:
        """Whether the mesh was evaluated."""
        return all(row["status"] == "ok" for row in self.rows)


def run_batch(items: Sequence[Item], settings: EvaluateSettings, analysis: Analyse = analyse) -> list[Outcome]:
    """Evaluate meshes, in a worker."""
    _end_at_once()
    if analysis is analyse:
        _warm_once()
    return [_evaluated(item, settings, analysis) for item in items]


def failed_outcome(
    item: Item,
    settings: EvaluateSettings,
    reason: str,
    *,
    known_hash: str,
    seconds: float,
    stamp: FileStamp | None = None,
) -> Outcome:
    """Give the row of a mesh, or of each of some objects, that could not be evaluated."""
    row = {**_about(item, settings, known_hash, seconds, stamp), "status": "failed", "reason": reason}
    if item.group is None:
        return Outcome(item.name, (row,), seconds=seconds)
    n = len(item.group)
    if item.group.rows:  # only its picture is missing
        rows = [
            {**row, "thumbnail": "", "notes": [*(row["notes"] or ()), f"no picture: {reason}"]}
            for row in item.group.rows
        ]
    else:
        row |= {"n_objects": item.group.n_objects, "seconds": seconds / n}
        rows = [{**row, "object": number} for number in item.group.ids.tolist()]
    return Outcome(item.name, tuple(rows), seconds=seconds, units=n)


@cache
def _warm_once() -> None:
    warm_up()


@cache
def _end_at_once() -> None:
    """Let a worker process of ours end without destructors: PyMeshLab's crash when another thread has used it."""
    if OWN_WORKER in os.environ:
        atexit.register(os._exit, 0)


@cache
def _versions() -> str:
    return versions_text()


def _about(
    item: Item, settings: EvaluateSettings, known_hash: str, seconds: float, stamp: FileStamp | None
) -> dict[str, Any]:
    """Give the columns every row has."""
    return {
        "file": item.name,
        "label": item.label,
        "content_hash": known_hash,
        **(dict(zip(STAMP_COLUMNS, stamp, strict=True)) if stamp and known_hash else {}),
        "settings_hash": settings_hash(settings),
        "settings": settings_text(settings),
        "versions": _versions(),
        "finished": item.finished or datetime.now(UTC).isoformat(timespec="milliseconds"),
        "seconds": seconds,
    }


def _evaluated(item: Item, settings: EvaluateSettings, analysis: Analyse) -> Outcome:
    begin = perf_counter()
    known_hash, path = "", ""
    is_known = item.group is not None or item.data is not None
    stamp = item.known_stamp if is_known else stamp_of(item.url)  # before it is read
    try:
        with _limited(settings), local_copy(item, _worker_folder()) as (path, known_hash):
            picture = f"{(known_hash or 'unreadable')[:24]}-{settings_hash(settings)[:8]}"
            options: dict[str, Any] = {}
            if item.group is not None:
                options = {"rows": item.group.rows} if item.group.rows else {"ids": item.group.ids}
            done = analysis(path, settings, name=picture, view=item.view, **options)
    except Exception as error:  # whatever a reader or a bug throws is this mesh's reason
        seconds = perf_counter() - begin
        reason = _reason(error, settings)
        reason = reason.replace(path, item.name) if path else reason
        known_hash = known_hash or content_hash(item)
        return failed_outcome(item, settings, reason, known_hash=known_hash, seconds=seconds, stamp=stamp)
    seconds = perf_counter() - begin
    about = _about(item, settings, known_hash, seconds / max(1, len(done.rows)), stamp)
    rows = tuple({**about, "status": "ok", "reason": "", **row} for row in done.rows)
    if not rows and not is_label_file(path):
        return failed_outcome(item, settings, "holds no cells", known_hash=known_hash, seconds=seconds, stamp=stamp)
    if not rows:  # a label image without objects is an answer: no rows but a mark that it was looked at
        rows = ({**about, "status": "ok", "reason": "", "kind": "label", "n_objects": 0},)
    return Outcome(item.name, rows, done.files, seconds, 1 if item.group is None else len(item.group))


def _reason(error: Exception, settings: EvaluateSettings) -> str:
    if isinstance(error, MemoryError):
        limit = settings.memory_limit
        within = "" if limit is None else f", within the {limit} that a worker may use"
        return f"out of memory{': ' if str(error) else ''}{error}{within}"
    text = " ".join(str(error).split())[:500]
    return text if isinstance(error, VoxKernelError) and text else f"{type(error).__name__}: {text}".removesuffix(": ")


@contextmanager
def _limited(settings: EvaluateSettings) -> Generator[None]:
    """Limit time and memory of what runs inside.

    A compiled function that hangs with the interpreter's lock held can only be ended with its process: a watchdog
    thread in C does that. It is set only where a nanny starts another process.
    """
    limit, watched = settings.memory_bytes(), settings.timeout is not None and _has_nanny()
    with open(os.devnull, "w") as nowhere:
        if watched and settings.timeout is not None:
            faulthandler.dump_traceback_later(settings.timeout, exit=True, file=nowhere)
        before = _limit_memory(limit)
        try:
            yield
        finally:
            _restore_memory(before)
            if watched:
                faulthandler.cancel_dump_traceback_later()


def _worker() -> Any:
    """Give the Dask worker this runs in, None elsewhere."""
    distributed = optional("distributed")
    try:
        return distributed.get_worker()
    except ValueError:
        return None


def _has_nanny() -> bool:
    worker = _worker()
    return worker is not None and worker.nanny is not None


def _worker_folder() -> str | None:
    """Give the folder of a worker, where what a killed one leaves is removed."""
    worker = _worker()
    return None if worker is None else str(worker.local_directory)


def _limit_memory(limit: int | None) -> tuple[int, int] | None:
    """Let allocations beyond the limit raise MemoryError, where the system can; else the nanny ends the process."""
    if limit is None:
        return None
    try:
        import resource
    except ImportError:  # Windows
        return None
    before = resource.getrlimit(resource.RLIMIT_DATA)
    soft = limit if before[1] == resource.RLIM_INFINITY else min(limit, before[1])
    resource.setrlimit(resource.RLIMIT_DATA, (soft, before[1]))
    return before


def _restore_memory(before: tuple[int, int] | None) -> None:
    if before is not None:
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, before)
