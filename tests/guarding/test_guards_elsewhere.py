"""Guards in a score, in a run, on the command line and in pictures."""

import json

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.cli import main as cli
from voxkernel.evaluation.analysis import analyse
from voxkernel.pictures import guards_picture

COMB = shapes.prism([(0, 0), (7, 0), (7, 4), (6, 4), (6, 1), (4, 1), (4, 4), (3, 4), (3, 1), (1, 1), (1, 4), (0, 4)])


@pytest.fixture(scope="module")
def found():
    return voxkernel.guards(COMB, coverage=0.8)


def test_a_score_with_guards():
    score = voxkernel.starshapeness(shapes.l_prism(), detail="guards")
    assert len(score.guards) == 1
    assert score.visible is None
    assert score.to_dict()["guards"]["certified"] == 1.0
    assert voxkernel.starshapeness(shapes.l_prism()).guards is None
    with pytest.raises(ValueError, match="`detail` must be one of 'guards'; got 'all'"):
        voxkernel.starshapeness(shapes.l_prism(), detail="all")


def test_a_column_of_a_run(tmp_path):
    voxkernel.as_mesh(shapes.l_prism()).write(tmp_path / "l.ply")
    voxkernel.as_mesh(shapes.moebius_band()).write(tmp_path / "band.ply")
    settings = voxkernel.EvaluateSettings(guards=0.99)
    (row,) = analyse(str(tmp_path / "l.ply"), settings, name="l").rows
    assert (row["guards"], row["guards_seen"], row["guards_certified"], row["guards_reason"]) == (1, 1.0, 1.0, "")
    (row,) = analyse(str(tmp_path / "band.ply"), settings, name="band").rows
    assert "`surface` must have an inner side" in row["guards_reason"]
    (row,) = analyse(str(tmp_path / "l.ply"), voxkernel.EvaluateSettings(), name="l").rows
    assert "guards" not in row
    for wrong in (0.0, 1.5):
        with pytest.raises(ValueError, match="`guards` must"):
            voxkernel.EvaluateSettings(guards=wrong)


def test_settings_without_guards_are_those_of_earlier_runs():
    assert "guards" not in voxkernel.EvaluateSettings().of_results()
    assert voxkernel.EvaluateSettings(guards=0.9).of_results()["guards"] == 0.9


def test_the_command_writes_pieces_and_numbers(tmp_path, capsys):
    mesh = tmp_path / "comb.ply"
    voxkernel.as_mesh(COMB).write(mesh)
    pieces, page = tmp_path / "pieces", tmp_path / "guards.html"
    words = ["guards", str(mesh), "--coverage", "0.8", "-o", str(pieces), "--picture", str(page), "--json"]
    assert cli.main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(list(pieces.iterdir())) == len(document["pieces"])
    assert document["seen"] >= 0.8
    assert "<title>comb.ply</title>" in page.read_text(encoding="utf-8")
    assert cli.main(["guards", str(mesh), "--distance", "3"]) == 2
    assert "--distance must be given with --outside" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--coverage", "2"], "--coverage must be in (0, 1]; got 2"),
        (["--coverage", "nan"], "--coverage must be in (0, 1]; got nan"),
        (["--coverage", "0"], "--coverage must be in (0, 1]; got 0"),
        (["--coverage", "most"], "invalid float value: 'most'"),
        (["--max-guards", "0"], "--max-guards must be at least 1; got 0"),
        (["--threads", "0"], "--threads must be at least 1; got 0"),
        (["--time-limit", "-1"], "--time-limit must be > 0 and finite; got -1"),
        (["--outside", "--distance", "0"], "--distance must be > 0 and finite; got 0"),
    ],
)
def test_wrong_numbers_are_bad_usage_before_the_mesh_is_read(words, message, capsys):
    try:
        code = cli.main(["guards", "no_such_mesh.ply", *words])
    except SystemExit as ended:  # argparse
        code = ended.code
    assert code == 2
    assert message in capsys.readouterr().err


def test_pictures(found, tmp_path):
    guards_picture(tmp_path / "a.png", found, title="comb", size=(400, 360))
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    guards_picture(tmp_path / "a.html", found)
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert page.count("guard 0") == 1
    if (found.first_seen < 0).any():
        assert "rgb(211,32,47)" in page
    with pytest.raises(ValueError, match="`path` must end in"):
        guards_picture(tmp_path / "a.gif", found)


def test_a_long_flat_surface_is_shown_whole(tmp_path):
    """Ten times as wide as high, its guard off it: white at the rims of the panels, and surface close to them."""
    x = np.linspace(0.0, 10.0, 21)
    vertices = np.array([(a, b, 0.3 * np.sin(a)) for a in x for b in (0.0, 1.0)])
    at = 2 * np.arange(20)[:, None]
    faces = np.concatenate([at + np.array([0, 2, 3]), at + np.array([0, 3, 1])])
    found = voxkernel.guards((vertices, faces))
    guards_picture(tmp_path / "a.png", found, size=(800, 700))
    page = np.asarray(pytest.importorskip("PIL.Image").open(tmp_path / "a.png").convert("L"))[160:600]
    for panel in (page[:, :400], page[:, 400:]):
        drawn = np.flatnonzero((panel < 250).any(axis=0))
        assert 4 <= drawn[0] <= 40
        assert 360 <= drawn[-1] <= 395
