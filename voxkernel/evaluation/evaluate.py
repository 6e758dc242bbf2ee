"""Whole data sets: one row per mesh, on a Dask cluster, in a run that can be interrupted: `evaluate`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from voxkernel import run_table
from voxkernel._extras import check_installed
from voxkernel._notebook import InNotebooks
from voxkernel.evaluation.analysis import analyse
from voxkernel.evaluation.cluster import Cluster, connected
from voxkernel.evaluation.dispatch import Dispatcher
from voxkernel.evaluation.inputs import BadInput, Item, count_suffixes, find_items, labelled, read_labels
from voxkernel.evaluation.label_parts import in_parts, n_units
from voxkernel.evaluation.label_pictures import COLUMNS as PICTURED
from voxkernel.evaluation.label_pictures import undrawn
from voxkernel.evaluation.later_stamps import LaterStamps
from voxkernel.evaluation.progress import EvaluationProgress, Speed
from voxkernel.evaluation.resume import COLUMNS as RESUMED
from voxkernel.evaluation.resume import Failures, Resumed, count_rows, failures_of, resumed
from voxkernel.evaluation.run_lock import locked_run
from voxkernel.evaluation.settings import (
    PROFILE_TOLERANCES,
    EvaluateSettings,
    for_files,
    settings_hash,
    versions_text,
)
from voxkernel.evaluation.store import RunStore
from voxkernel.evaluation.worker import Analyse
from voxkernel.labels import is_label_file

__all__ = ["PROFILE_TOLERANCES", "EvaluateSettings", "EvaluationProgress", "EvaluationResult", "evaluate"]

Show = Callable[[EvaluationProgress], None]


@dataclass(frozen=True, slots=True, repr=False)
class EvaluationResult(InNotebooks):
    """What became of a data set.

    Attributes
    ----------
    run : str
        The run directory or URL.
    n_rows : int
        Rows of the meshes given; a polyhedral mesh has one per cell, a label image one per object.
    n_ok, n_failed, n_reused : int
        Meshes evaluated, meshes that failed (both counted whether now or in an earlier run), and meshes whose
        rows are from an earlier run.
    unmatched_labels : tuple of str
        Entries of the label table that no mesh matched.
    left_out : tuple of (str, int)
        Files in the folders and globs given that were left out for their suffix: each suffix (lower case, with the
        dot; "" for none) and how many have it, the most frequent first. Hidden files and the run itself are not
        counted.
    n_images_ok : int
        Of `n_ok`, the label images.
    failures : tuple of (str, int or None, str)
        The first ten rows that failed: file, number of the object where it is one of a label image, and reason.
    n_failed_rows : int
        How many there are.
    """

    run: str
    n_rows: int
    n_ok: int
    n_failed: int
    n_reused: int
    unmatched_labels: tuple[str, ...]
    left_out: tuple[tuple[str, int], ...] = ()
    n_images_ok: int = 0
    failures: tuple[tuple[str, int | None, str], ...] = ()
    n_failed_rows: int = 0

    def __repr__(self) -> str:
        """Name the run and the counts."""
        return (
            f"EvaluationResult({self.run!r}, rows={self.n_rows}, ok={self.n_ok}, failed={self.n_failed}, "
            f"reused={self.n_reused})"
        )

    def table(self) -> Any:
        """Read the table: a `pyarrow.Table` with one row per mesh, cell or object, sorted by these."""
        return run_table.read_rows(self.run)


def evaluate(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    output: str | os.PathLike[str],
    settings: EvaluateSettings | None = None,
    labels: str | os.PathLike[str] | None = None,
    progress: Show | None = None,
) -> EvaluationResult:
    """Evaluate many meshes: one table row each, whatever happens to the others.

    Parameters
    ----------
    paths : path, glob, URL, or several
        Mesh files, folders (searched with all folders in them), globs, and fsspec URLs such as ``s3://...``. A
        polyhedral mesh gives one row per cell: ``.hedra``, ``.mesh``, ``.vtu``, or a folder of numbered files that
        is called something with "cells" at the end. A label image gives one row per object (`read_labels`); the objects
        of one on this machine are shared out among the workers, as many at a time as make about a second of work.
    output : path or URL
        Directory of the run. If it holds an earlier run, that is continued.
    settings : EvaluateSettings, optional
        What to compute and how to run.
    labels : path, URL or "folders", optional
        A CSV with columns `file` and `label`, matched by path (also one relative to a folder above the mesh), file
        name or its stem; or the name of the folder each mesh is in.
    progress : callable, optional
        Called with an `EvaluationProgress` about four times a second.

    Returns
    -------
    EvaluationResult
        Counts, and the table on demand.

    Raises
    ------
    ValueError
        If there are no meshes, or labels or scheduler cannot be used.
    BlockingIOError
        If another process, or another call in this one, is writing to the run.
    OSError
        If the run or the labels cannot be read or written.
    SolverError
        If worker processes do not start, are all lost for two minutes, or cannot run this library.

    Notes
    -----
    Runs on Dask: worker processes on this machine, or a scheduler elsewhere whose workers have this library and one
    thread each. A mesh that cannot be read, raises, takes too long, needs too much memory or kills its worker gets a
    row with `status` "failed" and the `reason`. The time limit is enforced by killing the worker, which needs a nanny.

    Objects of label images on this machine stand for themselves: one that takes too long, or ends its worker, costs its
    own row, and an image that was interrupted goes on with the objects that have no rows. The worst objects are drawn
    when all have theirs.

    Rows are on disk about a second after they were computed, in Parquet parts that appear whole or not at all. A row
    is computed again when the SHA-256 of its file, the settings that decide what is in it, or the version of this
    library is another; failed ones only with `retry_failed`. A file whose size, times of modification and change, and
    inode are those in its row, or those it had when it was last found the same, is not read for that, unless with
    `rehash`. Rows of files that are not given this time stay.

    One process writes to a run at a time: a lock on the folder sees to it, which the system frees when the process
    ends, however it ends. Object stores have no such lock. The worker processes of this machine talk over TLS with
    a key of their own; a scheduler elsewhere can run code here and so has to be trusted.

    A script that calls this without `settings.scheduler` must do so under ``if __name__ == "__main__":``, because
    the worker processes import it.

    Examples
    --------
    >>> import voxkernel
    >>> cube = voxkernel.as_mesh(([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    ...                           [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cube.write(pathlib.Path(folder) / "tetrahedron.ply")
    ...     result = voxkernel.evaluate(folder, output=pathlib.Path(folder) / "run")
    ...     result.table().column("verdict").to_pylist()
    ['star-shaped']
    """
    given = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    return run_evaluation(given, os.fspath(output), settings or EvaluateSettings(), labels, progress, analyse)


def run_evaluation(
    paths: Sequence[str | os.PathLike[str]],
    run: str,
    settings: EvaluateSettings,
    labels: str | os.PathLike[str] | None,
    progress: Show | None,
    analysis: Analyse,
) -> EvaluationResult:
    """Evaluate with any `analysis(path, settings, *, name, view)`; it is pickled and runs in the workers."""
    for package in ("dask", "distributed", "fsspec", "pyarrow", *(["open3d"] if settings.visible else [])):
        check_installed(package)
    others: set[str] = set()
    items, unmatched = labelled(
        find_items(paths, others, label_images=settings.label_images), read_labels(labels), settings.views
    )
    if not items:
        raise BadInput(f"`paths` must lead to at least one mesh; got {', '.join(map(str, paths)) or 'none'}")
    settings = for_files(settings, len(items))
    left_out = count_suffixes(others, run=run)
    fs, run_path = run_table.open_run(run)
    with locked_run(fs, run_path) as is_locked:
        if is_locked:
            run_table.remove_unfinished(run_path)
        store = RunStore(run)
        with closing(store.compact(RESUMED)) as index:
            before = resumed(items, index, settings, LaterStamps(store.fs, store.path))
            store.replace(index, before.places, before.labels)
        run_table.write_settings(store.fs, store.path, _described(settings, paths, len(items), left_out))
        counts = _Counts(before, progress, store)
        counts.show()
        parts = in_parts(before.fresh, settings)
        counts.total = before.n_units + n_units(parts)
        _compute(items, parts, settings, analysis, store, counts)
        with closing(store.compact(["status"] if counts.n_failed else [])) as index:
            counts.show()
            failed = failures_of(items, index) if counts.n_failed else Failures((), 0, set())
            if settings.csv:
                run_table.write_csv(store.fs, store.path, map(run_table.without_marks, index.parts()))
            n_rows = count_rows(items, index)
    n_failed, n_reused = counts.n_failed, before.n_reused
    n_images_ok = sum(1 for item in items if is_label_file(item.url) and item.name not in failed.files)
    return EvaluationResult(
        run, n_rows, len(items) - n_failed, n_failed, n_reused, tuple(unmatched), left_out,
        n_images_ok=n_images_ok, failures=failed.first, n_failed_rows=failed.n_rows,
    )  # fmt: skip


class _Counts:
    """Counts what is on disk and tells the caller."""

    def __init__(self, before: Resumed, progress: Show | None, store: RunStore) -> None:
        self.total, self.n_reused = before.n_wanted + before.n_units, before.n_units
        self.n_failed = before.n_failed
        self._failed = set(before.failed)  # an image fails once, whichever of its objects do
        self._progress, self._store, self._speed = progress, store, Speed()

    def failed(self, name: str) -> None:
        """Count a file that failed."""
        self.n_failed += name not in self._failed
        self._failed.add(name)

    def show(self) -> None:
        """Call the caller's function."""
        if self._progress is None:
            return
        new = self._store.n_stored
        rate, done = self._speed.at(new), self.n_reused + new
        remaining = (self.total - done) / rate if rate else None
        self._progress(EvaluationProgress(self.total, done, self.n_failed, self.n_reused, rate, remaining))


def _compute(
    items: Sequence[Item], parts: Sequence[Item], settings: EvaluateSettings, analysis: Analyse, store: RunStore,
    counts: _Counts,
) -> None:  # fmt: skip
    """Compute what is missing, then pictures of the worst objects, which are known when all have their rows."""
    with ExitStack() as stack:
        cluster: Cluster | None = None
        for_analysis = analysis is analyse
        if parts:
            cluster = stack.enter_context(connected(settings, n_units(parts), for_analysis=for_analysis))
            _run(cluster, parts, settings, analysis, store, counts)
        if settings.thumbnails is False or not any(is_label_file(item.url) for item in items):
            return
        with closing(store.compact(PICTURED)) as index:
            pictures = undrawn(items, index)
        if pictures:
            counts.total += n_units(pictures)
            if cluster is None:
                cluster = stack.enter_context(connected(settings, n_units(pictures), for_analysis=for_analysis))
            _run(cluster, pictures, settings, analysis, store, counts)


def _run(
    cluster: Cluster, items: Sequence[Item], settings: EvaluateSettings, analysis: Analyse, store: RunStore,
    counts: _Counts,
) -> None:  # fmt: skip
    """Run the cluster; whatever stops this, rows that came in are written."""
    dispatcher = Dispatcher(cluster, items, settings, analysis)
    try:
        for outcome in dispatcher.outcomes():
            if outcome is not None:
                store.add(outcome)
                if not outcome.is_ok:
                    counts.failed(outcome.name)
            store.flush_if_due()
            counts.show()
    finally:
        store.flush()
        dispatcher.stop()


def _described(
    settings: EvaluateSettings, paths: Sequence[Any], n_meshes: int, left_out: Sequence[tuple[str, int]]
) -> dict[str, Any]:
    import json

    return {
        "settings": settings.of_results(),
        "settings_hash": settings_hash(settings),
        "views": settings.views,
        "timeout": settings.timeout,
        "memory_limit": settings.memory_limit,
        "threads": settings.threads,
        "workers": settings.workers,
        "paths": [os.fspath(p).encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace") for p in paths],
        "n_meshes": n_meshes,
        "left_out": dict(left_out),
        "versions": json.loads(versions_text()),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }
