"""`voxkernel register` as a user calls it."""

import json

import numpy as np
import pytest

from voxkernel import as_mesh, repair
from voxkernel.cli.main import main
from voxkernel.demo_shapes import face


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("register")
    mesh = repair(face(), decimate_to=1200).mesh
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    mesh.write(folder / "source.ply")
    as_mesh((mesh.vertices @ turn.T + [5, 6, 7], mesh.faces)).write(folder / "target.ply")
    return folder, turn


def test_motion_moved_source_and_pictures(files, capsys):
    folder, turn = files
    outputs = ["-o", f"{folder}/T.json", "--apply", f"{folder}/moved.ply"]
    for suffix in ("html", "png"):
        picture = folder / f"picture.{suffix}"
        pair = [f"{folder}/source.ply", f"{folder}/target.ply"]
        assert main(["register", *pair, *outputs, "--picture", str(picture)]) == 0
        assert picture.stat().st_size > 10_000
    out = capsys.readouterr().out
    assert "90 degrees about" in out
    assert "ambiguous" in out
    document = json.loads((folder / "T.json").read_text())
    motion = np.array(document["T_target_source"])
    np.testing.assert_allclose(motion[:3, :3], turn, atol=1e-9)
    np.testing.assert_allclose(motion[:3, 3], [5, 6, 7], atol=1e-6)
    np.testing.assert_allclose(
        as_mesh(folder / "moved.ply").vertices, as_mesh(folder / "target.ply").vertices, atol=1e-6
    )
    assert "<script" in (folder / "picture.html").read_text(encoding="utf-8")


def test_json_and_exit_code_of_a_misfit(files, capsys):
    folder, _ = files
    mesh = as_mesh(folder / "target.ply")
    as_mesh((mesh.vertices * 3.0, mesh.faces)).write(folder / "large.ply")
    pair = ["register", f"{folder}/source.ply", f"{folder}/large.ply", "--json", "-q"]
    assert main(pair) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"] == "no match"
    assert "at a scale of 3" in document["reason"]
    assert main([*pair, "--estimate-scale"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"] == "right"
    assert document["scale"] == pytest.approx(3.0, rel=1e-3)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--margins", "2"], "must be between 0 and 1"),
        (["--max-distance", "0"], "must be > 0"),
        (["-o", "T.txt"], ".json"),
        (["--apply", "SOURCE"], "output must not be an input"),
    ],
)
def test_bad_usage(files, capsys, extra, message):
    folder, _ = files
    extra = [f"{folder}/source.ply" if e == "SOURCE" else e for e in extra]
    try:
        code = main(["register", f"{folder}/source.ply", f"{folder}/target.ply", *extra])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    assert message in capsys.readouterr().err


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Two overlapping parts of a face in other poses, and what is no mesh."""
    folder = tmp_path_factory.mktemp("together")
    mesh = face(hook=0.2, rings=30, sectors=60)
    middles = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    as_mesh((mesh.vertices, mesh.faces[middles < 0.45])).write(folder / "a.ply")
    as_mesh((mesh.vertices @ turn.T + [5, 6, 7], mesh.faces[middles > -0.45])).write(folder / "b.ply")
    (folder / "c.ply").write_text("ply")
    return folder, turn


def test_together_on_a_scheduler(parts, capsys, monkeypatch):
    distributed = pytest.importorskip("distributed")
    folder, turn = parts
    monkeypatch.chdir(folder)
    files = [f"{folder}/{name}.ply" for name in "abc"]
    outputs = ["-o", "poses.json", "--merged", "all.ply", "--picture"]
    quiet = {"dashboard_address": None, "silence_logs": 60, "n_workers": 1, "threads_per_worker": 1}
    quiet |= {"scheduler_kwargs": {"dashboard": False, "dashboard_address": "127.0.0.1:0"}}
    with distributed.LocalCluster(processes=False, **quiet) as cluster:
        where = ["--scheduler", cluster.scheduler_address]
        assert main(["register", *files, "--together", *where, *outputs]) == 1
    said = capsys.readouterr()
    assert "2 of 3 belong together" in said.out
    assert "a.ply - b.ply\n" in said.out  # the folder they have in common is named once
    assert f"{folder}\n" in said.out
    assert "c.ply" in said.out.split("apart 2")[1]
    document = json.loads((folder / "poses.json").read_text())
    assert document["apart"] == [2]
    assert document["poses"][2] is None
    np.testing.assert_allclose(np.array(document["poses"][1])[:3, :3], turn.T, atol=0.01)
    assert len(as_mesh(folder / "all.ply").faces) == sum(len(as_mesh(f).faces) for f in files[:2])
    assert (folder / "registration.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["a.ply"], "one TARGET or --together must be given; got 2 targets"),
        (["--merged", "all.ply"], "--merged must be given with --together"),
        (["--together", "--apply", "x.ply"], "--apply must be given without --together"),
        (["--together", "--overlap-steps", "1"], "--overlap-steps must be given without --together"),
        (["--together", "--refine", "none"], "--refine must be point_to_plane with --together; got none"),
    ],
)
def test_bad_usage_of_many(files, capsys, extra, message):
    folder, _ = files
    assert main(["register", f"{folder}/source.ply", f"{folder}/target.ply", *extra]) == 2
    assert message in capsys.readouterr().err
