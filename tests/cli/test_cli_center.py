"""`voxkernel center`, and relaxed kernels from the command line."""

import json

import pytest
import shapes

import voxkernel
from voxkernel.cli.main import main


@pytest.fixture
def torus(tmp_path):
    path = tmp_path / "torus.ply"
    voxkernel.TriangleMesh.from_triangles(*shapes.torus()).write(path)
    return path


def test_center(torus, tmp_path, capsys):
    assert main(["center", str(torus), "-q"]) == 0
    out = capsys.readouterr().out
    assert "turned away  25.5" in out
    assert "star-shaped  no" in out
    target = tmp_path / "center.json"
    command = ["center", str(torus), "--visible", "--profile", "--gap", "0.01", "--threads", "2", "--json", "-q"]
    assert main([*command, "-o", str(target)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads(target.read_text())
    low, high = document["violation_bounds"]
    assert high - low <= 0.01 + 1e-12
    assert document["visible"]["fraction"] <= 1 - low
    assert len(document["profile"]["tolerances"]) == 26


def test_relaxed_kernel(torus, tmp_path, capsys):
    assert main(["kernel", str(torus), "--tolerance", "0.3", "--depth", "5", "-o", str(tmp_path / "k.npz"), "-q"]) == 0
    out = capsys.readouterr().out
    assert "tolerance         0.3" in out
    assert "exact kernel      empty" in out
    assert voxkernel.KernelGrid.read(tmp_path / "k.npz").tolerance == 0.3
    assert main(["kernel", str(torus), "--margin", "0.05", "--depth", "5", "--threads", "2", "--json", "-q"]) == 0
    document = json.loads(capsys.readouterr().out)
    least = voxkernel.best_center(shapes.torus()).violation_bounds[1]
    assert document["tolerance"] == pytest.approx(least + 0.05)
    assert document["active_voxel_count"] > 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["center", "x.ply", "--gap", "0"], "must be a number between 0 and 1; got 0"),
        (["center", "x.ply", "--weights", "volume"], "invalid choice: 'volume'"),
        (["kernel", "x.ply", "--tolerance", "0.1", "--margin", "0.1"], "not allowed with argument"),
        (["center", "x.ply", "--threads", "0"], "must be a whole number from 1 to 256; got 0"),
        (["kernel", "x.ply", "--threads", "0"], "must be a whole number from 1 to 256; got 0"),
    ],
)
def test_bad_usage(words, message, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert message in capsys.readouterr().err
