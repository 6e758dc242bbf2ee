"""`voxkernel kernel -o kernel.vdb` and `voxkernel info kernel.vdb`, the latter beside OpenVDB's own `vdb_print -l`."""

import dataclasses
import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from grids import random_frame, random_grid, with_inactive_tiles

import voxkernel
from voxkernel.cli.main import main
from voxkernel.demo_shapes import s_prism, star_prism
from voxkernel.grid import SparseGrid
from voxkernel.vdb import read_vdb, write_vdb


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    star_prism().write(tmp_path / "star.ply")
    return tmp_path


def run(capsys, *words):
    code = main(list(words))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


# -- kernel ---------------------------------------------------------------------


def test_kernel_file_has_both_grids_and_typed_metadata(folder, capsys):
    assert run(capsys, "kernel", "star.ply", "-o", "k.vdb", "--depth", "6", "-q")[0] == 0
    grid = voxkernel.voxel_kernel("star.ply", depth=6)
    file = read_vdb("k.vdb")
    assert file.names == ("inside", "boundary")
    assert file.value_types == ("bool", "bool")
    for one, other in ((file["inside"], grid.inside), (file["boundary"], grid.boundary)):
        assert one == dataclasses.replace(other, name=one.name)
    assert file.metadata == {
        "source": "star.ply", "volume_bounds": grid.volume_bounds, "alpha": 0.0, "depth": 6, "dimension": 3,
        "voxkernel_version": voxkernel.__version__,
    }  # fmt: skip
    assert type(file.metadata["depth"]) is int
    assert type(file.metadata["alpha"]) is float


def test_metadata_of_a_relaxed_kernel(folder, capsys):
    words = ("kernel", "star.ply", "-o", "k.vdb", "--depth", "5", "--tolerance", "0.25", "--domain", "box")
    assert run(capsys, *words)[0] == 0
    about = read_vdb("k.vdb").metadata
    assert (about["alpha"], about["depth"], about["domain"]) == (0.25, 5, "box")
    grid = voxkernel.voxel_kernel("star.ply", depth=5, tolerance=0.25, domain="box")
    assert about["volume_bounds"] == grid.volume_bounds


@pytest.mark.parametrize("text", ["-0.1", "1.5", "nan", "few"])
def test_tolerance_is_a_share(folder, capsys, text):
    with pytest.raises(SystemExit) as caught:
        run(capsys, "kernel", "star.ply", f"--tolerance={text}")
    assert caught.value.code == 2
    assert f"must be a number from 0 to 1; got {text}" in capsys.readouterr().err


def test_empty_kernel_and_its_reason_are_written(folder, capsys):
    s_prism().write("flat.ply")
    assert run(capsys, "kernel", "flat.ply", "-o", "k.vdb", "--depth", "5")[0] == 0
    file, grid = read_vdb("k.vdb"), voxkernel.voxel_kernel("flat.ply", depth=5)
    assert file["inside"].active_voxel_count == 0
    assert file.metadata["dimension"] == 2
    assert file.metadata.get("reason", "") == grid.reason
    code, out, _ = run(capsys, "info", "k.vdb")
    assert code == 0
    assert "  Tree is empty!" in out.splitlines()


@pytest.mark.skipif(os.name == "nt", reason="file names of arbitrary bytes are a matter of POSIX")
def test_source_that_is_no_text_is_escaped(folder, capsys):
    name = os.fsdecode(b"star-\xff.ply")
    try:
        shutil.copy("star.ply", name)
    except OSError:
        pytest.skip("this file system takes only UTF-8 names")
    assert run(capsys, "kernel", name, "-o", "k.vdb", "--depth", "4")[0] == 0
    assert read_vdb("k.vdb").metadata["source"] == "star-\\udcff.ply"


# -- info -----------------------------------------------------------------------


def test_info_json(folder, capsys):
    grid = with_inactive_tiles(random_grid(3, has_values=True, n_cells=12), 3)
    write_vdb("a.vdb", {"field": grid, "mask": grid.to_mask()}, metadata={"alpha": 0.5})
    code, out, _ = run(capsys, "info", "a.vdb", "--json")
    assert code == 0
    document = json.loads(out)
    assert document["metadata"] == {"alpha": 0.5}
    assert [g["name"] for g in document["grids"]] == ["field", "mask"]
    field = document["grids"][0]
    assert field["active_voxel_count"] == grid.active_voxel_count
    assert field["active_bbox"] == grid.active_bbox.tolist()
    active = grid.values_at(grid.to_ijk())
    assert field["value_range"] == [active.min(), active.max()]
    assert field["metadata"]["file_voxel_count"] == grid.active_voxel_count
    np.testing.assert_array_equal(field["linear"], grid.linear)


def test_info_reports_damage_and_skipped_grids_in_one_line(folder, capsys):
    Path("a.vdb").write_bytes(b"no grid")
    code, out, err = run(capsys, "info", "a.vdb")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "must be a .vdb file" in err
    write_vdb("a.vdb", SparseGrid.from_ijk([[0, 0, 0]], name="a"))
    Path("a.vdb").write_bytes(Path("a.vdb").read_bytes().replace(b"Tree_bool_5_4_3", b"Tree_boot_5_4_3"))
    code, out, _ = run(capsys, "info", "a.vdb")
    assert code == 0
    assert out.splitlines()[-1] == "Skipped: 'a' (Tree_boot_5_4_3)"


def cases():
    """Grids of every kind: tiles of all sizes, values, odd frames, nothing at all."""
    for seed in range(6):
        grid = random_grid(seed, has_values=seed % 2 == 1, n_cells=25, background=-1.5 if seed == 3 else 0.0)
        if seed % 2:
            grid = with_inactive_tiles(grid, seed)
        entries = {"alpha": 0.03125, "n": seed, "yes": True, "v": (1, 2, 3), "w": (0.5, 1.0, 1e-9)}
        yield f"random {seed}", dataclasses.replace(grid, metadata=entries, **random_frame(seed))
    yield "empty", SparseGrid.from_ijk(np.zeros((0, 3), int))
    corners, log2 = [[0, 0, 0], [8192, 0, 0], [-128, 0, 0]], [12, 13, 7]
    linear = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    yield "large", SparseGrid.from_tiles_and_leaves(corners, log2, [], [], linear=linear)


@pytest.mark.parametrize("compression", ["none", "zip"])
def test_info_prints_what_vdb_print_prints(folder, capsys, compression):
    tool = shutil.which("vdb_print")
    if not tool:
        pytest.skip("vdb_print not found; apt-get install libopenvdb-tools")
    n_lines = 0
    for name, grid in cases():
        kinds = ("bool", "mask", "float", "half") if grid.is_mask else ("float", "half")
        for kind in kinds:
            grids = {"inside": grid, "boundary": grid}
            write_vdb("a.vdb", grids, metadata={"source": name}, value_type=kind, compression=compression)
            theirs = subprocess.run([tool, "-l", "a.vdb"], capture_output=True, text=True, check=True).stdout
            code, ours, _ = run(capsys, "info", "a.vdb")
            assert code == 0
            assert [line.rstrip() for line in theirs.splitlines()] == ours.splitlines(), (name, kind)
            n_lines += len(ours.splitlines())
    assert n_lines > 1000
