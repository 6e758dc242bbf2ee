"""The parts of a run while it grows: few, of a bounded size, and never without a row that was computed."""

import fsspec
import pytest

from voxkernel import run_table
from voxkernel.evaluation import store as store_module
from voxkernel.evaluation.worker import Outcome


@pytest.fixture
def small(monkeypatch):
    """Parts of twelve rows are large."""
    monkeypatch.setattr(store_module, "_PARTS", 3)
    monkeypatch.setattr(store_module, "_LARGE", 12)


@pytest.fixture
def run(tmp_path):
    """In memory, where nothing waits for a disk."""
    yield f"memory:/{tmp_path}/run"
    fsspec.filesystem("memory").rm(str(tmp_path), recursive=True)


def row(k, **more):
    return {"file": f"{k:03}", "status": "ok", "content_hash": "c", "settings_hash": "s", **more}


def grown(run, rows):
    store = store_module.RunStore(run)
    store.compact().close()
    for one in rows:
        store.add(Outcome(one["file"], (one,)))
        store.flush()
    return store


def sizes(store):
    index = store.compact()
    index.close()
    return [n for n, _ in index.part_sizes()]


def test_large_parts_stay_as_they_are(run, small):
    store = grown(run, [row(k) for k in range(40)])
    names = run_table.part_names(store.fs, store.path)
    large = [n for n in names if run_table.open_part(store.fs, n).num_rows >= 12]
    assert len(names) < 10
    assert len(large) >= 2
    assert all(n < 24 for n in sizes(store))
    assert set(large) <= set(run_table.part_names(store.fs, store.path))
    assert len(sizes(grown(run, [row(k) for k in range(40, 60)]))) <= 5
    assert run_table.read_rows(run)["file"].to_pylist() == [f"{k:03}" for k in range(60)]


def test_a_small_run_is_one_part_in_order(run, small):
    store = grown(run, [row(k) for k in (5, 3, 9, 1)])
    assert sizes(store) == [4]
    (name,) = run_table.part_names(store.fs, store.path)
    assert run_table.read_part(run_table.open_part(store.fs, name))["file"].to_pylist() == ["001", "003", "005", "009"]


@pytest.mark.parametrize("is_killed", [False, True])
def test_what_was_replaced_goes_when_it_is_much(run, small, monkeypatch, is_killed):
    """Also when the process ends between writing and deleting; later rows count, whatever part they are in."""
    assert sum(sizes(grown(run, [row(k, ratio=0.25) for k in range(26)]))) == 26
    store = grown(run, [row(k, ratio=0.75, content_hash="d") for k in range(18)])
    before = run_table.read_rows(run)
    if is_killed:
        with monkeypatch.context() as stopped:
            stopped.setattr(run_table, "remove_parts", lambda fs, names: None)
            store.compact().close()
        assert run_table.read_rows(run) == before
    assert sum(sizes(store)) == 26
    assert run_table.read_rows(run) == before
    assert before["ratio"].to_pylist() == [0.75] * 18 + [0.25] * 8


def test_a_clock_that_was_set_back(run, small, monkeypatch):
    grown(run, [row(k, ratio=0.25) for k in range(14)]).compact().close()
    monkeypatch.setattr(run_table.time, "time_ns", lambda: 1)
    grown(run, [row(k, ratio=0.75) for k in range(14)]).compact().close()
    assert run_table.read_rows(run)["ratio"].to_pylist() == [0.75] * 14
