"""One label image whose run is ended on the way, and objects that end their worker: what that costs."""

import os
import signal
import sys

import pytest
from faulty_runs import OBJECTS, client, comparable, image_of_objects, n_on_disk, objects_evaluated

from voxkernel import run_table

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")


def rows_of(run):
    return {row["object"]: row for row in run_table.read_rows(str(run)).to_pylist()}


@pytest.mark.parametrize("end", ["SIGINT", "SIGKILL"])
def test_one_image_goes_on_where_it_was_ended(tmp_path, end):
    image, run = image_of_objects(tmp_path / "image.npy", 200), tmp_path / "run"
    script = tmp_path / "script.py"
    script.write_text(OBJECTS)
    process = client(script, image, run)
    while n_on_disk(run) < 30:
        assert process.poll() is None, process.communicate()[1]
    os.killpg(process.pid, getattr(signal, end))
    process.communicate(timeout=120)
    before = rows_of(run)
    assert 30 <= len(before) < 200
    process = client(script, image, run)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out.split()) == (0, ["200", "1", "0"]), err
    after = rows_of(run)
    assert before.items() <= after.items()  # the seconds they took are those of the first run
    assert len({row["finished"] for row in after.values()}) == 1
    assert objects_evaluated(image, tmp_path / "whole").n_rows == 200
    assert comparable(after) == comparable(rows_of(tmp_path / "whole"))


def test_an_object_that_ends_its_worker_costs_its_own_row(tmp_path):
    image, run = image_of_objects(tmp_path / "image.npy", 220), tmp_path / "run"
    result = objects_evaluated(image, run, timeout=3.0, workers=2)
    assert (result.n_rows, result.n_ok, result.n_failed) == (220, 0, 1)
    rows = rows_of(run)
    failed = {number: row["reason"] for number, row in rows.items() if row["status"] == "failed"}
    assert failed == {
        207: "RuntimeError: oh no", 211: "its worker process was killed by SIGSEGV, 2 times",
        213: "took longer than 3 s: its worker was killed",
    }  # fmt: skip
    assert {row["n_objects"] for row in rows.values()} == {220}
    assert all((row["kind"] is None) == (number in failed) for number, row in rows.items())
    again = objects_evaluated(image, run, timeout=3.0)
    assert (again.n_reused, again.n_failed) == (1, 1)
    assert rows_of(run) == rows
