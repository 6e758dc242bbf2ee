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
    "command",
    [
        ["kernel"],
        ["kernel", "--threads", "2"],
        ["kernel", "--depth", "5"],
        ["score"],
        ["center"],
        ["center", "--visible"],
    ],
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
        (["center", "x.ply", "--stream", "--profile"], "--profile must not be given with --stream"),
    ],
)
def test_what_wants_the_mesh_is_refused(words, message, capsys):
    assert main(words) == 2
    assert message in capsys.readouterr().err


def test_messages_name_files_and_options(tmp_path, capsys):
    vertices, faces = shapes.tetrahedron()
    text = "OFF\n4 4 6\n0 0 0\n1 0 0\n0 nan 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    (tmp_path / "nan.off").write_text(text)
    (tmp_path / "a.wrl").write_text("")
    (tmp_path / "none").mkdir()
    voxkernel.as_mesh((vertices, faces)).write(tmp_path / "cut.ply")
    (tmp_path / "cut.ply").write_bytes((tmp_path / "cut.ply").read_bytes()[:-20])
    for name, said in (
        ("nan.off", "nan.off', chunk 0, facet 0: "),
        ("a.wrl", "a.wrl' cannot be streamed: it must end in .glb .gltf"),
        ("none", "none' must hold .glb or .gltf"),
        ("missing.ply", "missing.ply' does not exist"),
        ("missing.zarr", "missing.zarr' does not exist"),
        ("cut.ply", "cut.ply', chunk 0, facet 2: the file ends before its 4 facets do"),
    ):
        for command in ("kernel", "score", "center"):
            assert main([command, str(tmp_path / name), "--stream"]) == 1
            found = capsys.readouterr()
            assert said in found.out + found.err
            assert "`source`" not in found.out + found.err
            assert "`surface`" not in found.out + found.err
