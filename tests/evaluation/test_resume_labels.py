"""A run over one label image goes on with the objects that are missing, and ends as one that was never interrupted."""

import shutil
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest

import voxkernel
from voxkernel import run_table
from voxkernel.cli.main import main
from voxkernel.evaluation import EvaluateSettings
from voxkernel.evaluation.inputs import Item
from voxkernel.evaluation.label_rows import most_pictures
from voxkernel.evaluation.object_group import ObjectGroup, Pace
from voxkernel.evaluation.worker import failed_outcome
from voxkernel.report import write_report
from voxkernel.run_table import read_rows

SETTINGS = EvaluateSettings(spacing=(1, 1, 1), n_rays=(8, 32), workers=1, thumbnails=True)
N = 96


def many(n=N):
    """Cubes, every third of them with a corner cut off the line of sight: Ls of two bars."""
    image = np.zeros((5, 6 * 16 + 1, 6 * -(-n // 16) + 1), np.uint16)
    for k in range(n):
        j, i = 6 * (k % 16) + 1, 6 * (k // 16) + 1
        image[1:4, j : j + 5, i : i + 5] = k + 1
        if k % 3 == 0:
            image[1:4, j + 1 : j + 5, i + 1 : i + 5] = 0
    return image


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    np.save(folder / "many.npy", many())
    seen = []
    result = voxkernel.evaluate(
        folder / "many.npy", output=folder / "run", settings=SETTINGS, progress=lambda state: seen.append(state)
    )
    return folder, result, seen


def interrupted(whole, tmp_path, change):
    """A copy of the run of which only what `change` leaves of the table is there."""
    shutil.copytree(whole[0] / "run", tmp_path / "run")
    fs, path = run_table.open_run(str(tmp_path / "run"))
    names = run_table.part_names(fs, path)
    table = change(run_table.read_parts(fs, names))
    run_table.remove_parts(fs, names)
    run_table.write_table_part(fs, path, table)
    return table


def rows_of(run):
    return {row["object"]: row for row in read_rows(str(run)).to_pylist()}


def without_times(rows):
    return [{k: v for k, v in row.items() if not k.startswith("seconds")} for _, row in sorted(rows.items())]


def gone_on(whole, tmp_path, **changes):
    settings = replace(SETTINGS, **changes)
    return voxkernel.evaluate(whole[0] / "many.npy", output=tmp_path / "run", settings=settings)


def set_column(table, name, values):
    at = table.schema.get_field_index(name)
    return table.set_column(at, table.schema.field(at), pa.array(values, table.schema.field(at).type))


def test_only_objects_without_rows_are_computed(whole, tmp_path):
    kept = interrupted(
        whole, tmp_path, lambda table: table.filter(pc.not_equal(pc.bit_wise_and(table["object"], 3), 1))
    )
    before = {row["object"]: row for row in kept.to_pylist()}
    assert len(before) == N - 24
    states = []
    result = voxkernel.evaluate(
        whole[0] / "many.npy", output=tmp_path / "run", settings=SETTINGS, progress=lambda state: states.append(state)
    )
    assert (result.n_rows, result.n_ok, result.n_reused) == (N, 1, 0)
    after, uninterrupted = rows_of(tmp_path / "run"), rows_of(whole[0] / "run")
    assert without_times(after) == without_times(uninterrupted)
    assert all(after[number] == row for number, row in before.items())  # with the seconds they took
    assert all(after[number] != uninterrupted[number] for number in uninterrupted.keys() - before.keys())
    assert (states[0].done, states[0].total, states[0].reused) == (N - 24, N, N - 24)
    assert states[-1].done == states[-1].total
    assert voxkernel.evaluate(whole[0] / "many.npy", output=tmp_path / "run", settings=SETTINGS).n_reused == 1


def test_only_pictures_that_are_missing_are_drawn(whole, tmp_path):
    drawn = [row["object"] for row in rows_of(whole[0] / "run").values() if row["thumbnail"]]
    assert 0 < len(drawn) == most_pictures(N) == 30 < N // 3

    def change(table):
        names = [None if name and k % 2 else name for k, name in enumerate(table["thumbnail"].to_pylist())]
        return set_column(table, "thumbnail", names)

    interrupted(whole, tmp_path, change)
    result = gone_on(whole, tmp_path)
    assert (result.n_rows, result.n_reused) == (N, 1)
    assert rows_of(tmp_path / "run") == rows_of(whole[0] / "run")
    assert all(
        (tmp_path / "run" / row["thumbnail"]).exists() for row in rows_of(tmp_path / "run").values() if row["thumbnail"]
    )


def failed_ones(table):
    """Objects 5 and 9 failed, 12 to 40 were not reached."""
    numbers = table["object"].to_pylist()
    table = set_column(table, "status", ["failed" if n in (5, 9) else "ok" for n in numbers])
    table = set_column(table, "kind", [None if n in (5, 9) else "label" for n in numbers])
    table = set_column(table, "reason", ["took too long" if n in (5, 9) else "" for n in numbers])
    return table.filter(pa.array([not 12 <= n <= 40 for n in numbers]))


def test_objects_that_failed_are_tried_again_when_asked_for(whole, tmp_path):
    interrupted(whole, tmp_path, failed_ones)
    result = gone_on(whole, tmp_path)
    assert (result.n_rows, result.n_ok, result.n_failed, result.n_reused) == (N, 0, 1, 0)
    rows = rows_of(tmp_path / "run")
    assert [number for number, row in rows.items() if row["status"] == "failed"] == [5, 9]
    assert (gone_on(whole, tmp_path).n_reused, gone_on(whole, tmp_path).n_failed) == (1, 1)
    result = gone_on(whole, tmp_path, retry_failed=True)
    assert (result.n_rows, result.n_ok, result.n_failed, result.n_reused) == (N, 1, 0, 0)
    assert without_times(rows_of(tmp_path / "run")) == without_times(rows_of(whole[0] / "run"))


def test_the_command_counts_objects_that_failed(whole, tmp_path, capsys):
    interrupted(whole, tmp_path, failed_ones)
    words = ["labels", str(whole[0] / "many.npy"), "--spacing", "1,1,1", "--rays", "8,32", "--workers", "1", "-q"]
    assert main([*words, "-o", str(tmp_path / "run")]) == 1
    said = capsys.readouterr()
    assert f"run: {N - 2} objects, " in said.out
    assert said.out.endswith("; 2 objects failed\n")
    lines = [f"voxkernel: error: {whole[0] / 'many.npy'}, object {number}: took too long" for number in (5, 9)]
    assert said.err.splitlines() == lines


def test_other_settings_or_another_image_replace_all_rows(whole, tmp_path):
    interrupted(whole, tmp_path, lambda table: table.slice(50))
    result = gone_on(whole, tmp_path, n_rays=(8, 64), thumbnails=False)
    assert (result.n_rows, result.n_reused) == (N, 0)
    assert {tuple(row["n_rays"]) for row in rows_of(tmp_path / "run").values()} == {(8, 64)}
    shutil.copy(whole[0] / "many.npy", tmp_path / "many.npy")
    run, plain = tmp_path / "other", replace(SETTINGS, thumbnails=False)
    voxkernel.evaluate(tmp_path / "many.npy", output=run, settings=plain)
    image = many(90)
    image[image == 7] = 0
    np.save(tmp_path / "many.npy", image)
    result = voxkernel.evaluate(tmp_path / "many.npy", output=run, settings=plain)
    assert (result.n_rows, result.n_reused) == (89, 0)
    assert rows_of(run).keys() == set(range(1, 91)) - {7}


def test_progress_counts_objects(whole):
    _, result, seen = whole
    assert (result.n_rows, result.n_ok, result.n_reused) == (N, 1, 0)
    assert seen[-1].done == seen[-1].total == N + most_pictures(N)
    assert max(state.total for state in seen if state.done < N) <= N


def test_the_pace_of_objects():
    group = ObjectGroup(np.arange(5), np.ones(5), 9)
    assert (len(group), group.cut(1, 3).ids.tolist(), group.cut(1, 3).n_objects) == (5, [1, 2], 9)
    pace = Pace()
    assert pace.budget() == 0.0  # one object
    pace.note(100.0, 1e-6)
    assert pace.budget() == 400.0
    pace.note(1e6, 2.0)
    assert 1e5 < pace.budget() < 4e6


def test_a_report_of_objects_that_failed(whole, tmp_path):
    interrupted(whole, tmp_path, failed_ones)
    summary = write_report(tmp_path / "page.html", tmp_path / "run")
    assert [row["object"] for row in summary["failures"]["rows"]] == [5, 9]
    assert summary["objects"]["n"] == N - 29 - 2


def test_a_picture_that_cannot_be_drawn_costs_no_numbers():
    base = {"object": 3, "status": "ok", "notes": None, "thumbnail": None, "voxels_seen": 0.5}
    group = ObjectGroup(np.array([3]), np.ones(1), 9, (base,))
    outcome = failed_outcome(Item("a.npy", "a.npy", group=group), SETTINGS, "gone", known_hash="", seconds=1.0)
    assert outcome.is_ok
    assert outcome.rows == ({**base, "thumbnail": "", "notes": ["no picture: gone"]},)
