"""Runs with more rows than a page holds: its numbers are of all rows, its table shows a part, all are beside it."""

import importlib
import json
import re

import numpy as np
import pytest
from report_runs import load_rows, surface_row

from voxkernel import run_table, write_report
from voxkernel.report.columns import Texts, cross_counts
from voxkernel.report.compare import matched
from voxkernel.report.large_run import rows_to_show
from voxkernel.report.rows import open_run_index
from voxkernel.report.statistics import confusion_counts

MOST = 60


@pytest.fixture
def run(tmp_path, rng):
    """Five hundred rows in three parts, some of which are replaced by later ones."""
    fs, path = run_table.open_run(str(tmp_path / "run"))
    kinds = ("star-shaped", "not star-shaped", "degenerate")
    rows = [surface_row(f"in/{k:03}.ply", rng, ("star", "not")[k % 2], kinds[k % 3]) for k in range(500)]
    for k in range(0, 500, 25):
        rows[k] = {"file": rows[k]["file"], "status": "failed", "reason": "no mesh"}
    for part in (rows[:200], rows[150:300], rows[250:]):
        run_table.write_part(fs, path, part)
    return tmp_path / "run"


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(importlib.import_module("voxkernel.report.write_report"), "MOST_ROWS", MOST)


def test_the_page_shows_a_part_and_counts_all(run, few, tmp_path, monkeypatch):
    summary = write_report(tmp_path / "a page.html", run)
    text = (tmp_path / "a page.html").read_text()
    assert summary["n_rows"] == 500
    assert summary["counts"]["failed"] == 20
    assert re.search(r"The table shows 60 of 500 rows", text)
    assert 'href="a%20page.rows.parquet"' in text
    beside = run_table.read_part(run_table.open_part(*run_table.open_run(str(tmp_path / "a page.rows.parquet"))))
    table = run_table.read_rows(str(run))
    assert beside.sort_by("file").equals(table)
    assert write_report(tmp_path / "s.json", run) == summary
    monkeypatch.undo()
    assert write_report(tmp_path / "whole.html", run) == summary
    assert not (tmp_path / "whole.rows.parquet").exists()
    assert len(text) < len((tmp_path / "whole.html").read_text())


def test_classes_and_another_run_are_told_of_the_rows_that_are_shown(run, few, tmp_path):
    write_report(tmp_path / "page.html", run, classes=["near: defect<0.1"], compare=run)
    text = (tmp_path / "page.html").read_text()
    data = json.loads(re.search(r'<script type="application/json" id="rows">(.*?)</script>', text, re.DOTALL)[1])
    columns = {column["key"]: [column["words"][k] for k in column["values"]] if "words" in column else column["values"]
               for column in data["columns"]}  # fmt: skip
    assert data["n"] == len(columns["file"]) == MOST
    assert columns["before"] == columns["outcome"]
    for verdict, name, defect in zip(columns["outcome"], columns["class"], columns["violation_upper"], strict=True):
        assert name == ("failed" if verdict == "failed" else "near" if (defect or 0.0) < 0.1 else "none of these")
    assert {"failed", "near", "none of these"} <= set(columns["class"])


def test_rows_that_are_shown(run):
    """The failed and the worst ones, and from the others every so many."""
    rows = load_rows(str(run))
    ids = rows_to_show(rows, MOST).tolist()
    assert len(ids) == len(set(ids)) == MOST
    assert ids == sorted(ids)
    assert sum(rows.outcome[i] == "failed" for i in ids) == MOST // 4
    worst = np.argsort(-np.nan_to_num(rows.numbers["violation_upper"]), kind="stable")[: MOST // 4]
    assert set(worst.tolist()) <= set(ids)
    assert max(np.diff(ids)) < 30
    shown = rows.taken(np.array(ids))
    assert shown.texts["file"] == [rows.texts["file"][i] for i in ids]
    assert shown.lists["profile_shares"][3] == rows.lists["profile_shares"][ids[3]]


@pytest.mark.parametrize("folders", [("in/", "in/"), ("here/", "over/there/")])
def test_rows_of_two_runs_are_matched_as_by_a_dictionary(tmp_path, rng, folders):
    """Files, cells and objects that are in both runs or in one of them; the folders are other ones or the same."""
    keys: list[list[tuple[str, int | None, int | None]]] = []
    for run, folder in zip(("now", "before"), folders, strict=True):
        names = [f"{k}.ply" for k in rng.permutation(40)[:30]] + ["a/x.ply", "b/x.ply"]
        rows = [
            {"file": folder + name, "cell": cell, "object": own, "status": "ok"}
            for name in names for cell in (None, 0, 7) for own in (None, 2) if rng.random() < 0.6
        ] + [{"file": folder + "sure.ply", "status": "ok"}]  # fmt: skip
        run_table.write_part(*run_table.open_run(str(tmp_path / run)), rows)
        table = run_table.read_rows(str(tmp_path / run)).select(["file", "cell", "object"]).to_pylist()
        keys.append([(row["file"].removeprefix(folder), row["cell"], row["object"]) for row in table])
    pairs, by = matched(*(load_rows(str(tmp_path / run)) for run in ("now", "before")))
    place = {key: j for j, key in enumerate(keys[1])}
    assert pairs.tolist() == [[i, place[key]] for i, key in enumerate(keys[0]) if key in place]
    assert 0 < len(pairs) < len(keys[0])
    assert by == ("name" if folders[0] == folders[1] else "name below the common folder")


def test_counts_by_codes_are_those_of_words(rng):
    words = ["", "a", "b", "c"]
    truths, answers = (Texts.of_words(rng.integers(0, 4, 300), words) for _ in range(2))
    for rows, columns in ((["a", "c"], ["b", "", "nowhere"]), ([], ["a"]), (words, words)):
        expected = confusion_counts(truths, answers, rows, columns)
        np.testing.assert_array_equal(cross_counts(truths, answers, rows, columns), expected)
    empty = Texts.of_words([], [])
    assert cross_counts(empty, empty, ["a"], ["b"]).tolist() == [[0]]
    assert (empty.counts(), empty.used(), empty.n_used(), empty.extent()) == ({}, [], 0, None)


def test_columns_that_are_forgotten_are_read_again(run):
    rows = load_rows(str(run))
    some = rows.taken(np.arange(5))
    ratio, name, file = some.numbers["ratio"], some.texts["verdict"], some.texts["file"]
    some.forget()
    assert rows.texts["file"] is rows.texts["file"]
    assert some.texts["file"] is file
    assert some.numbers["ratio"] is not ratio
    np.testing.assert_array_equal(some.numbers["ratio"], ratio)
    assert some.texts["verdict"] == name


def test_a_part_is_read_some_rows_at_a_time(run, monkeypatch):
    index = open_run_index(str(run))
    places = np.array([490, 3, 3, 260, 151, 499, 0])
    expected = index.table(run_table.schema().names).take(places)
    for size in (60, 1000):
        monkeypatch.setattr(run_table, "_BATCH", size)
        assert index.rows(places).equals(expected)
    index.close()
