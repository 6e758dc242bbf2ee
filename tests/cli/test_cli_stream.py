"""--stream: the answers of memory, and what a stream cannot do."""

import json

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.cli.main import main


@pytest.fixture
def star(tmp_path):
    path = tmp_path / "star.ply"
    voxkernel.as_mesh(shapes.star_prism()).write(path)
    return str(path)


def said(capsys, *words):
    assert main([*words, "-q"]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    "command", [["kernel"], ["kernel", "--threads", "2"], ["kernel", "--depth", "5"], ["score"], ["center"]]
)
def test_answers_are_those_of_memory(star, command, capsys):
    name, *options = command
    for form in ([], ["--json"]):
        whole = said(capsys, name, star, *options, *form)
        streamed = said(capsys, name, star, "--stream", *options, *form)
        if name == "score" and form:  # sizes are compared with those of other meshes in memory only
            (row,) = json.loads(whole)
            assert row.pop("diagonal") > 0
            assert json.loads(streamed) == [row]
        else:
            assert streamed == whole


def test_a_folder_of_tiles(tmp_path, capsys):
    vertices, faces = shapes.star_prism()
    for k, part in enumerate(np.array_split(faces, 2)):
        voxkernel.as_mesh((vertices, part)).write(tmp_path / f"{k}.ply")
    document = json.loads(said(capsys, "kernel", str(tmp_path), "--stream", "--json"))
    assert document["volume"] == voxkernel.exact_kernel((vertices, faces)).volume
    assert document["domain"] is None


def test_a_note_says_that_most_facets_stay(tmp_path, capsys):
    voxkernel.as_mesh(shapes.icosphere(2)).write(tmp_path / "ball.ply")
    assert main(["kernel", str(tmp_path / "ball.ply"), "--stream"]) == 0
    assert "voxkernel: most of 320 facets may bound the kernel: it is found in memory" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["kernel", "x.ply", "--stream", "--picture", "x.png"], "--picture must not be given with --stream"),
        (["kernel", "x.ply", "--scheduler", "tcp://x:1"], "--scheduler must be given with --stream and without a"),
        (["kernel", "x.ply", "--stream", "--scheduler", "tcp://x:1", "--depth", "5"], "--scheduler must be given with"),
        (["center", "x.ply", "--stream", "--visible"], "--visible and --profile must not be given with --stream"),
    ],
)
def test_what_wants_the_mesh_is_refused(words, message, capsys):
    assert main(words) == 2
    assert message in capsys.readouterr().err


def test_a_file_that_cannot_be_streamed(tmp_path, capsys):
    (tmp_path / "a.off").write_text("OFF")
    assert main(["kernel", str(tmp_path / "a.off"), "--stream"]) == 1
    assert "must be a file ending in .parquet .ply .stl to be streamed" in capsys.readouterr().err
