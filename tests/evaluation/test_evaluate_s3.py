"""A data set in and a run out at `s3://`, by the protocol: a server of this machine answers as S3 does."""

from contextlib import closing

import pytest
import shapes

from voxkernel import as_mesh, run_table, write_report
from voxkernel.evaluation import EvaluateSettings, evaluate
from voxkernel.evaluation.analysis import analyse
from voxkernel.evaluation.inputs import Item, content_hash, find_items
from voxkernel.evaluation.resume import COLUMNS, resumed
from voxkernel.evaluation.store import RunStore
from voxkernel.evaluation.worker import Outcome

for needed in ("s3fs", "moto", "flask", "flask_cors"):
    pytest.importorskip(needed, reason=f"`{needed}` is not installed; CI installs it")

ONE = EvaluateSettings(workers=1)


@pytest.fixture(scope="module")
def server():
    from moto.server import ThreadedMotoServer

    made = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    made.start()
    yield "http://{}:{}".format(*made.get_host_and_port())
    made.stop()


@pytest.fixture
def bucket(server, monkeypatch):
    """An empty bucket, found by what the environment says, also by worker processes."""
    import s3fs

    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_ENDPOINT_URL", server)
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    fs = s3fs.S3FileSystem()
    fs.invalidate_cache()
    if fs.exists("shapes"):
        fs.rm("shapes", recursive=True)
    fs.mkdir("shapes")
    return fs


def rows_of(run):
    return {row["file"]: row for row in run_table.read_rows(run).to_pylist()}


def test_a_data_set_and_its_run(bucket, tmp_path):
    """The same rows as of the same files in a folder, and one of a bucket that is not there; resumed, and a report."""
    made = {"cube": shapes.cube(), "torus": shapes.torus(n_major=8, n_minor=6)}
    (tmp_path / "in").mkdir()
    for name, shape in made.items():
        as_mesh(shape).write(tmp_path / "in" / f"{name}.ply")
    (tmp_path / "in" / "broken.ply").write_text("ply\nnonsense")
    (tmp_path / "in" / "notes.txt").write_text("no mesh")
    bucket.put(f"{tmp_path}/in", "shapes/in", recursive=True)
    given = ["s3://shapes/in", "s3://nowhere/x.ply"]
    there = evaluate(given, output="s3://shapes/run", settings=ONE, labels="folders")
    assert (there.n_ok, there.n_failed, there.left_out) == (2, 2, ((".txt", 1),))
    remote = rows_of("s3://shapes/run")
    nowhere = remote.pop("s3://nowhere/x.ply")
    assert nowhere["status"] == "failed"
    assert nowhere["reason"].startswith("'s3://nowhere/x.ply' cannot be read: ")
    assert sorted(remote) == [f"s3://shapes/in/{name}.ply" for name in ("broken", "cube", "torus")]
    for name in made:
        file = tmp_path / "in" / f"{name}.ply"
        (row,) = run_table.to_table(analyse(str(file), ONE, name="").rows).to_pylist()
        found = remote[f"s3://shapes/in/{name}.ply"]
        own = {k for k in row if row[k] is not None and "seconds" not in k} - {"file", "finished", "reason"}
        assert {k: found[k] for k in own} == {k: row[k] for k in own}
        assert (found["label"], found["content_hash"]) == ("in", content_hash(Item("", str(file))))
    assert "s3://shapes/in/broken.ply" in remote["s3://shapes/in/broken.ply"]["reason"]

    # Resumed: nothing is computed again, but for what has changed.
    again = evaluate("s3://shapes/in/*.ply", output="s3://shapes/run", settings=ONE, labels="folders")
    assert (again.n_ok, again.n_failed, again.n_reused) == (2, 1, 3)
    assert len(bucket.find("shapes/run/rows")) == 1
    bucket.cp_file("shapes/in/torus.ply", "shapes/in/cube.ply")
    with closing(RunStore("s3://shapes/run").compact(COLUMNS)) as index:
        before = resumed(find_items(["s3://shapes/in/*.ply"]), index, ONE)
    assert ([item.name for item in before.fresh], before.n_reused) == (["s3://shapes/in/cube.ply"], 2)
    summary = write_report(tmp_path / "report.html", "s3://shapes/run")
    assert (summary["counts"]["not star-shaped"], summary["counts"]["failed"]) == (1, 2)


def test_two_runs_at_once_lose_no_row(bucket):
    """There are no locks: what two runs have written is there, whichever makes parts one first."""
    first, second = RunStore("s3://shapes/run"), RunStore("s3://shapes/run")
    for k in range(6):
        store = (first, second)[k % 2]
        store.add(Outcome(f"{k}", ({"file": f"{k}", "status": "ok", "content_hash": "c", "settings_hash": "s"},)))
        store.flush()
        if k == 3:
            first.compact().close()
    second.compact().close()
    assert sorted(rows_of("s3://shapes/run")) == [f"{k}" for k in range(6)]
    assert len(bucket.find("shapes/run/rows")) == 1


def test_a_run_that_is_not_there(bucket, tmp_path):
    with pytest.raises(FileNotFoundError, match="`run` must be the output of an evaluation; got 's3://shapes/no'"):
        write_report(tmp_path / "report.html", "s3://shapes/no")
