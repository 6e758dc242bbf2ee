"""Kernel grids as VTK's files: what VTK reads there is what the grid says, and ParaView finds the arrays."""

import dataclasses
import json
import shutil
import subprocess

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import KernelGrid, SparseGrid
from voxkernel.cli.main import main

pyvista = pytest.importorskip("pyvista")
L_SHAPE = shapes.l_prism()


@pytest.mark.parametrize("options", [{}, {"tolerance": 0.3, "domain": "ball"}, {"frame": "principal"}])
def test_cells_carry_state_level_and_violation(tmp_path, options):
    grid = voxkernel.voxel_kernel(L_SHAPE, depth=5, **options)
    grid.write(tmp_path / "k.vtu", surface=L_SHAPE)
    cells = pyvista.read(tmp_path / "k.vtu")
    assert set(cells.cell_data) == {"state", "level", "violation"}
    volumes = cells.compute_cell_sizes()["Volume"]
    low, high = grid.volume_bounds
    voxel = grid.voxel_size**3
    np.testing.assert_allclose(volumes, voxel * 8.0 ** (grid.depth - cells["level"].astype(float)), rtol=1e-9)
    assert volumes[cells["state"] == 1].sum() == pytest.approx(grid.active_voxel_count * voxel, rel=1e-9)
    assert volumes[cells["state"] == 0].sum() == pytest.approx(grid.boundary.active_voxel_count * voxel, rel=1e-9)
    assert low <= volumes[cells["state"] == 1].sum() * (1 + 1e-9)
    assert high <= volumes.sum() * (1 + 1e-9)
    centres = cells.cell_centers().points
    assert (grid.classify(centres) == cells["state"]).all()
    np.testing.assert_allclose(cells["violation"], voxkernel.violation(L_SHAPE, centres), atol=1e-15)
    assert (cells["violation"][cells["state"] == 1] <= grid.tolerance).all()


def test_faces_carry_the_same(tmp_path):
    grid = voxkernel.voxel_kernel(L_SHAPE, depth=6)
    grid.write(tmp_path / "k.vtp", surface=L_SHAPE)
    faces = pyvista.read(tmp_path / "k.vtp")
    assert faces.volume == pytest.approx(grid.active_voxel_count * grid.voxel_size**3, rel=1e-9)
    assert (faces["state"] == 1).all()
    assert (faces["violation"] == 0).all()
    assert (faces["level"] == 6).all()  # tiles lie deeper


def test_faces_of_tiles_have_the_level_of_the_tile(tmp_path):
    """Four tiles of 8^3 voxels under a sheet of 16 x 16 voxels."""
    inside = SparseGrid.from_dense(np.ones((16, 16, 9), dtype=bool), voxel_size=0.5, origin=[3, 4, 5])
    rest = dataclasses.replace(
        inside, tile_ijk=inside.tile_ijk[:0], tile_log2=inside.tile_log2[:0], leaf_mask=np.zeros_like(inside.leaf_mask)
    )
    KernelGrid(inside, rest, 4, (288.0, 288.0), 3, None, "").write(tmp_path / "k.vtp")
    faces = pyvista.read(tmp_path / "k.vtp")
    assert set(faces.cell_data) == {"state", "level"}
    in_sheet = faces.cell_centers().points[:, 2] > 5 + 8 * 0.5
    assert in_sheet.sum() == 2 * (256 + 4 * 16)
    assert (faces["level"] == np.where(in_sheet, 4, 1)).all()


@pytest.mark.parametrize("suffix", [".vtu", ".vtp"])
def test_an_empty_grid_is_a_file_without_cells(tmp_path, suffix):
    grid = voxkernel.voxel_kernel(shapes.two_boxes(), depth=4)
    grid.write(tmp_path / f"k{suffix}")
    read = pyvista.read(tmp_path / f"k{suffix}")
    assert read.n_cells == 0


def test_what_has_no_place_is_refused(tmp_path):
    grid = voxkernel.voxel_kernel(L_SHAPE, depth=4)
    with pytest.raises(ValueError, match=r"`surface` must be left out of a \.npz; got tuple"):
        grid.write(tmp_path / "k.npz", surface=L_SHAPE)
    with pytest.raises(ValueError, match=r"`metadata` must be left out of a \.vtu; got \['a'\]"):
        grid.write(tmp_path / "k.vtu", metadata={"a": 1})
    assert not list(tmp_path.iterdir())


def test_the_command_line_writes_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    voxkernel.as_mesh(L_SHAPE).write("l.ply")
    kernel = voxkernel.exact_kernel(L_SHAPE)
    assert main(["kernel", "l.ply", "-o", "k.vtp", "-q"]) == 0
    exact = pyvista.read("k.vtp")
    assert exact["input_facet"].tolist() == kernel.face_facets.tolist()
    assert exact.volume == pytest.approx(kernel.volume, rel=1e-9)
    assert main(["kernel", "l.ply", "-o", "k.vtp", "--depth", "5", "-q"]) == 0
    assert set(pyvista.read("k.vtp").cell_data) == {"state", "level", "violation"}
    for more in ([], ["--depth", "5"]):
        assert main(["kernel", "l.ply", "-o", "k.glb", "-q", *more]) == 0
        capsys.readouterr()
        assert main(["info", "k.glb", "--json"]) == 0
        low, high = voxkernel.voxel_kernel(L_SHAPE, depth=5).volume_bounds
        assert low * (1 - 1e-6) <= json.loads(capsys.readouterr().out)["volume"] <= high


@pytest.mark.paraview
def test_paraview_finds_the_arrays(tmp_path):
    """Debian's `pvpython` (apt-get install python3-paraview) opens the file with ParaView's own reader."""
    pvpython = shutil.which("pvpython")
    if pvpython is None:
        pytest.skip("pvpython not found; apt-get install python3-paraview")
    grid = voxkernel.voxel_kernel(L_SHAPE, depth=5)
    grid.write(tmp_path / "k.vtu", surface=L_SHAPE)
    script = (
        "from paraview.simple import *\nimport json, sys\n"
        "reader = OpenDataFile(sys.argv[1]); reader.UpdatePipeline()\n"
        "info = reader.GetDataInformation()\n"
        "arrays = {a.Name: list(a.GetRange(0)) for a in reader.CellData}\n"
        "print('\\n' + json.dumps([arrays, info.GetNumberOfCells(), list(info.GetBounds())]))\n"
    )
    (tmp_path / "open.py").write_text(script)
    words = [pvpython, "--force-offscreen-rendering", tmp_path / "open.py", tmp_path / "k.vtu"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=True)
    arrays, n_cells, bounds = json.loads(done.stdout.splitlines()[-1])
    assert set(arrays) == {"state", "level", "violation"}
    assert arrays["state"] == [0, 1]
    cells = pyvista.read(tmp_path / "k.vtu")
    assert n_cells == cells.n_cells
    np.testing.assert_allclose(bounds, cells.bounds, rtol=1e-6)
