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
    as_mesh((mesh.vertices, mesh.faces[:, ::-1])).write(folder / "inside_out.ply")
    assert main(["register", f"{folder}/source.ply", f"{folder}/inside_out.ply", "--json", "-q"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["converged"] is False
    assert document["reason"]


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
