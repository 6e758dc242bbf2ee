"""What of a data set an earlier run has computed already, told by keys, stamps and hashes alone."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel import run_table
from voxkernel._extras import optional
from voxkernel.evaluation.file_stamp import STAMP_COLUMNS, FileStamp, are_untouched, stamp_of
from voxkernel.evaluation.inputs import Item, content_hash
from voxkernel.evaluation.later_stamps import LaterStamps
from voxkernel.evaluation.settings import EvaluateSettings, settings_hash
from voxkernel.run_index import RunIndex

__all__ = ["COLUMNS", "Failures", "Resumed", "count_rows", "failures_of", "resumed"]

COLUMNS = ("label", "status", "view", *STAMP_COLUMNS)  # beside the keys
_AT_ONCE = 1000  # files that a thread reads in one go
_WAITING = 16
_Seen = tuple[str, FileStamp | None]  # hash and stamp
_FIRST = 10  # failures that are told one by one
_QUICK = 1e-4  # seconds to read and hash a small file, and no more


class Resumed(NamedTuple):
    """Meshes to compute, how many need not be, how many failed before, and rows whose label is another now."""

    fresh: list[Item]
    n_reused: int
    n_failed: int
    n_units: int  # that need not be: meshes, and objects of label images
    n_wanted: int  # of these, to compute; a label image of which nothing is known is one
    failed: list[str]  # images of which objects failed, others are to be computed
    places: NDArray[np.int64]
    labels: list[str | None]


def resumed(
    items: Sequence[Item], index: RunIndex, settings: EvaluateSettings, later: LaterStamps | None = None
) -> Resumed:
    """Divide meshes into those to compute and those whose rows are there: same content, same settings.

    Of a label image only the objects are computed that have no rows, or none that counts.

    Files that have to be hashed to be known get their stamps of now, which the next resume asks for.
    """
    known, compute = _Known(index), optional("pyarrow.compute")
    place = known.find([item.name for item in items])
    first = np.maximum(place, 0)
    wanted, is_whole = place >= 0, np.ones(len(items), bool)
    if len(index):
        wanted &= known.mask(compute.equal(index.keys["settings_hash"], settings_hash(settings)))[first]
        is_whole = known.is_whole[first] & ~(known.failed[first] & settings.retry_failed)
        wanted &= is_whole | known.has_objects[first]
        views = np.fromiter((item.view for item in items), bool, len(items))
        wanted &= ~views | known.needs_no_view[first]
    candidates = np.flatnonzero(wanted)
    is_same = np.zeros(len(candidates), bool)
    if len(candidates) and not settings.rehash:
        stamps = index.keys.select(STAMP_COLUMNS).take(optional("pyarrow").array(first[candidates]))
        paths = ["" if items[i].data is not None else items[i].url for i in candidates.tolist()]
        is_same = are_untouched(paths, stamps)
        rest = np.flatnonzero(~is_same)
        if len(rest) and later is not None:
            names = [items[i].name for i in candidates[rest].tolist()]
            hashes = index.keys["content_hash"].take(optional("pyarrow").array(first[candidates[rest]]))
            is_same[rest] = later.are_untouched(names, hashes, [paths[k] for k in rest.tolist()])
    to_read = candidates[~is_same]
    found = list(_same(items, to_read, first, index.keys["content_hash"]))
    is_same[~is_same] = np.fromiter((same for same, _ in found), bool, len(to_read))
    if later is not None and not settings.rehash:
        _keep_stamps(items, to_read, found, later)
    there = np.zeros(len(items), bool)
    there[candidates[is_same]] = True
    places, labels = known.relabelled(items, np.flatnonzero(there), first)
    reused = there & is_whole
    n_failed = int(known.failed[first[reused]].sum()) if len(index) else 0
    n_units = int(known.n_units[first[reused]].sum()) if len(index) else 0
    fresh: list[Item] = []
    failed: list[str] = []
    n_wanted = int((~reused).sum())
    for i in np.flatnonzero(~reused).tolist():
        fresh.append(known.going_on(items[i], first[i], settings) if there[i] else items[i])
        done = fresh[-1].done
        if there[i] and done is not None:
            n_units += len(done)
            n_wanted += int(known.n_objects[first[i]]) - len(done) - 1
            if known.failed[first[i]] and not settings.retry_failed:
                failed.append(items[i].name)
    return Resumed(fresh, int(reused.sum()), n_failed + len(failed), n_units, n_wanted, failed, places, labels)


def count_rows(items: Sequence[Item], index: RunIndex) -> int:
    """Count the rows of these meshes."""
    pa, compute = optional("pyarrow"), optional("pyarrow.compute")
    names = pa.array([item.name for item in items], pa.string())
    files = run_table.without_marks(index.keys)["file"]
    return int(compute.sum(compute.is_in(files, value_set=names)).as_py() or 0)


class Failures(NamedTuple):
    """The first rows that failed (file, object, reason), how many did, and the files they are of."""

    first: tuple[tuple[str, int | None, str], ...]
    n_rows: int
    files: set[str]


def failures_of(items: Sequence[Item], index: RunIndex) -> Failures:
    """Tell what failed of these meshes, from an index that has their `status`."""
    pa, compute, keys = optional("pyarrow"), optional("pyarrow.compute"), index.keys
    names = pa.array([item.name for item in items], pa.string())
    failed = compute.and_(compute.equal(keys["status"], "failed"), compute.is_in(keys["file"], value_set=names))
    places = np.flatnonzero(failed.fill_null(False).to_numpy())
    rows = index.rows(places[:_FIRST]).select(["file", "object", "reason"]).to_pylist()
    files = set(compute.unique(keys["file"].take(pa.array(places))).to_pylist())
    return Failures(tuple((row["file"], row["object"], row["reason"] or "") for row in rows), len(places), files)


def _same(
    items: Sequence[Item], candidates: NDArray[np.int64], first: NDArray[np.int64], stored: Any
) -> Iterator[tuple[bool, _Seen]]:
    """Say of each candidate whether its content is the stored one, and what it was seen with.

    Files that are large or far away are read by several threads at the same time; with small ones that are at hand,
    threads would only be in each other's way.
    """
    take = optional("pyarrow").array
    some_of = (candidates[k : k + _AT_ONCE] for k in range(0, len(candidates), _AT_ONCE))
    batches = (([items[i] for i in ids.tolist()], stored.take(take(first[ids]))) for ids in some_of)
    with ThreadPoolExecutor(8) as readers:  # SHA-256 and reading do not hold the interpreter
        while some := list(islice(batches, _WAITING)):
            begin = time.perf_counter()
            same = _same_of_some(some[0])
            is_quick = time.perf_counter() - begin < _QUICK * len(same)
            yield from same
            for same in (map if is_quick else readers.map)(_same_of_some, some[1:]):
                yield from same


def _same_of_some(batch: tuple[Sequence[Item], Any]) -> list[tuple[bool, _Seen]]:
    items, stored = batch
    found: list[tuple[bool, _Seen]] = []
    for item, known in zip(items, stored.to_pylist(), strict=True):
        stamp = None if item.data is not None else stamp_of(item.url)  # before it is read
        seen = content_hash(item)
        found.append((seen == known, (seen, stamp)))
    return found


def _keep_stamps(
    items: Sequence[Item], read: NDArray[np.int64], found: list[tuple[bool, _Seen]], later: LaterStamps
) -> None:
    kept = [
        (items[i].name, seen, stamp)
        for i, (is_same, (seen, stamp)) in zip(read.tolist(), found, strict=True)
        if is_same and stamp is not None
    ]
    later.add([name for name, _, _ in kept], [seen for _, seen, _ in kept], [stamp for _, _, stamp in kept])


class _Known:
    """The first row of each file of a run, and what is asked about it, by its place in the table."""

    def __init__(self, index: RunIndex) -> None:
        compute, keys = optional("pyarrow.compute"), index.keys
        self._keys = keys
        files = keys["file"].combine_chunks()
        n = len(index)
        is_first = np.append(True, compute.not_equal(files[1:], files[:-1]).to_numpy(zero_copy_only=False))[:n]
        self._first = np.flatnonzero(is_first)
        self._n_rows = np.zeros(n, np.int64)
        self._n_rows[self._first] = np.diff(np.append(self._first, n))
        self._files = files if is_first.all() else files.take(optional("pyarrow").array(self._first))
        self._row_failed = self.mask(compute.equal(keys["status"], "failed"))
        self.failed = self._row_failed.copy()  # of the first row of a file: whether one of its rows has
        if n:
            self.failed[self._first] = np.logical_or.reduceat(self._row_failed, self._first)
        objects = self.n_objects = keys["n_objects"].fill_null(-1).to_numpy()
        # Else it is a label image of which objects are missing; one without objects has a row that marks it.
        self.is_whole = (objects <= 0) | (objects == self._n_rows)
        self.has_objects = objects > 0
        self.n_units = np.where(self.has_objects, self._n_rows, 1)
        single = compute.and_(compute.and_(keys["cell"].is_null(), keys["object"].is_null()), objects < 0)
        may_view = compute.and_(compute.equal(keys["status"], "ok"), single)
        has_view = compute.not_equal(keys["view"].fill_null(""), "")
        self.needs_no_view = self.mask(compute.or_(has_view, compute.invert(may_view)))

    def mask(self, column: Any) -> NDArray[np.bool_]:
        """Null counts as false."""
        return np.asarray(column.fill_null(False).to_numpy(), bool)

    def find(self, names: Sequence[str]) -> NDArray[np.int64]:
        """Give the place of the first row of each file, -1 where there is none."""
        pa, compute = optional("pyarrow"), optional("pyarrow.compute")
        given = pa.array(names, pa.string())
        if given.equals(self._files):  # both are sorted: the same data set again
            return self._first.astype(np.int64)
        found = compute.index_in(given, value_set=self._files).fill_null(-1).to_numpy()
        return np.append(self._first, -1)[found].astype(np.int64)

    def going_on(self, item: Item, first: int, settings: EvaluateSettings) -> Item:
        """Give an image with what its rows share and the objects that need no other row."""
        own = self._keys.slice(first, int(self._n_rows[first]))
        ids = own["object"].to_numpy()
        if settings.retry_failed:
            ids = ids[~self._row_failed[first : first + len(ids)]]
        stamp = [own[name][0].as_py() for name in STAMP_COLUMNS]
        return replace(
            item, known_hash=own["content_hash"][0].as_py(), finished=own["finished"][0].as_py(),
            known_stamp=None if None in stamp else FileStamp(*stamp), done=frozenset(ids.tolist()),
        )  # fmt: skip

    def relabelled(
        self, items: Sequence[Item], reused: NDArray[np.int64], first: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], list[str | None]]:
        """Give the places of rows whose label is another now, and that label."""
        pa, compute = optional("pyarrow"), optional("pyarrow.compute")
        begin, count = first[reused], self._n_rows[first[reused]]
        places = np.repeat(begin, count) + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        own = pa.array([items[i].label for i in reused.tolist()], pa.string()).take(
            pa.array(np.repeat(np.arange(len(reused)), count))
        )
        before = self._keys["label"].take(pa.array(places))
        is_same = compute.or_(
            compute.equal(own, before).fill_null(False), compute.and_(own.is_null(), before.is_null())
        )
        changed = np.flatnonzero(~self.mask(is_same))
        return places[changed], own.take(pa.array(changed)).to_pylist()
