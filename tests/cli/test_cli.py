import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import as_mesh, exact_kernel
from voxkernel.cli.commands import COMMANDS, parser
from voxkernel.cli.main import main
from voxkernel.cli.output import display, number, to_json


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Meshes by formula, and the folder they are in as the current one."""
    monkeypatch.chdir(tmp_path)
    for name, made in {
        "cube": shapes.cube(),
        "flat": shapes.s_tetromino(0.0),
        "torus": shapes.torus(n_major=8, n_minor=6),
        "field": shapes.height_field(n=3),
        "star": shapes.star_prism(),
    }.items():
        as_mesh(made).write(tmp_path / f"{name}.ply")
    return tmp_path


def run(capsys, *words):
    code = main([str(w) for w in words])
    said = capsys.readouterr()
    return code, said.out, said.err


def usage_error(capsys, *words):
    try:
        code = main([str(w) for w in words])
    except SystemExit as stop:
        code = stop.code
    said = capsys.readouterr()
    assert code == 2
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err.startswith("voxkernel: error: ")
    return said.err


def process(*words, **options):
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1]), **options.pop("env", {})}
    return subprocess.run([sys.executable, "-m", "voxkernel.cli.main", *words], capture_output=True, env=env, **options)


# ---------------------------------------------------------------- help, usage, errors


def test_help_names_every_command(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert all(f"    {name} " in out for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_command_help_has_examples_that_parse(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main([name, "--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    examples = import_module(f"voxkernel.cli.{name}").EXAMPLES
    assert examples
    for line in examples:
        assert line in out
        words = line.split(" > ")[0].split()
        assert words[0] == "voxkernel"
        assert parser().parse_args(words[1:]).command == name


def test_version(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"voxkernel {voxkernel.__version__}\n"


def test_help_loads_nothing_heavy():  # how long it takes is measured in benchmarks/test_import_time.py
    code = (
        "import sys; from voxkernel.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print({'numpy', 'scipy', 'open3d', 'pyvista', 'plotly', 'jinja2', 'PIL'} & set(sys.modules), file=sys.stderr)"
    )
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, check=True)
    assert "COMMAND" in done.stdout
    assert done.stderr.strip() == "set()"


def test_bad_usage(folder, capsys):
    assert "COMMAND" in usage_error(capsys)
    assert "invalid choice" in usage_error(capsys, "frobnicate")
    assert "3 to 20; got 2" in usage_error(capsys, "kernel", "cube.ply", "--depth", "2")
    assert "above 0; got nan" in usage_error(capsys, "kernel", "cube.ply", "--rtol", "nan")
    assert "not allowed with" in usage_error(capsys, "kernel", "cube.ply", "--depth", "5", "--voxel-size", "1")
    said = usage_error(capsys, "kernel", "cube.ply", "-o", "k.xyz")
    assert "must end in .ply, .json, .npz, .vdb, .vtu, .vtp, .glb; got 'k.xyz'" in said
    assert "must end in .png, .html" in usage_error(capsys, "kernel", "cube.ply", "--picture", "k.jpg")
    assert "must not be the mesh itself" in usage_error(capsys, "kernel", "cube.ply", "-o", "cube.ply")
    assert "required: MESH" in usage_error(capsys, "score")


def test_output_folder_is_checked_before_the_mesh_is_read(folder, capsys):
    assert "existing folder; got 'no/k.ply'" in usage_error(capsys, "kernel", "missing.ply", "-o", "no/k.ply")
    assert "existing folder" in usage_error(capsys, "kernel", "missing.ply", "--picture", "no/k.png")
    assert "existing folder" in usage_error(capsys, "demo", "-o", "no/such/place")
    assert "must be a folder; got the file" in usage_error(capsys, "demo", "-o", "cube.ply")
    (folder / "sub.ply").mkdir()
    assert "must be a file; got the folder" in usage_error(capsys, "kernel", "cube.ply", "-o", "sub.ply")


def test_known_errors_are_one_line(folder, capsys):
    code, out, err = run(capsys, "kernel", "missing.ply")
    assert (code, out) == (1, "")
    assert err == "voxkernel: error: 'missing.ply' does not exist\n"
    (folder / "empty.ply").write_bytes(b"")
    code, out, err = run(capsys, "info", "empty.ply")
    assert (code, out, err.count("\n")) == (1, "", 1)


def test_verbose_shows_the_traceback(folder):
    done = process("kernel", "missing.ply", "-v", text=True)
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    assert "MeshReadError" in done.stderr


# ---------------------------------------------------------------- score


def test_score_prints_one_aligned_row_per_mesh(folder, capsys):
    code, out, _ = run(capsys, "score", "cube.ply", "flat.ply", "torus.ply", "field.ply")
    assert code == 0
    rows = out.splitlines()
    assert len(rows) == 4
    assert rows[0].split() == ["cube.ply", "star-shaped", "1", "1", "enclosed", "volume"]
    assert [row[11:27].strip() for row in rows] == ["star-shaped", "degenerate", "not star-shaped", "star-shaped"]
    assert {row.index("volume") for row in rows} == {rows[0].index("volume"), rows[3].index("volume")}
    assert "inner side of facets" in rows[2]
    assert "domain volume" in rows[3]


def test_score_json(folder, capsys):
    code, out, _ = run(capsys, "score", "cube.ply", "torus.ply", "--json")
    assert code == 0
    cube, torus = json.loads(out, parse_constant=lambda text: pytest.fail(f"not JSON: {text}"))
    assert (cube["file"], cube["status"], cube["verdict"], cube["ratio"]) == ("cube.ply", "ok", "star-shaped", 1.0)
    assert (torus["verdict"], torus["center"], torus["clearance"]) == ("not star-shaped", None, None)
    assert len(torus["certificate"]["facet_ids"]) in (2, 3, 4)


def test_score_goes_on_after_a_failure(folder, capsys):
    (folder / "broken.ply").write_text("ply\nformat ascii 1.0\nend_header\n")
    code, out, err = run(capsys, "score", "missing.ply", "broken.ply", "cube.ply")
    assert code == 1
    rows = out.splitlines()
    assert [row.split()[1] for row in rows] == ["failed", "failed", "star-shaped"]
    assert err.splitlines()[-1] == "voxkernel: 2 of 3 meshes failed"
    code, out, err = run(capsys, "score", "missing.ply", "cube.ply", "--json", "--quiet")
    assert (code, err) == (1, "")
    failed, fine = json.loads(out)
    assert (failed["status"], fine["status"]) == ("failed", "ok")
    assert failed["reason"] == "'missing.ply' does not exist"


def test_score_takes_a_domain(folder, capsys):
    _, out, _ = run(capsys, "score", "field.ply", "--domain", "box", "--json")
    assert json.loads(out)[0]["domain"] == "box"


# ---------------------------------------------------------------- kernel


def test_kernel_prints_the_exact_kernel(folder, capsys):
    code, out, err = run(capsys, "kernel", "cube.ply", "-q")
    assert (code, err) == (0, "")
    rows = dict(line.split("  ", 1) for line in out.splitlines())
    assert {k: v.strip() for k, v in rows.items() if k in ("file", "kernel", "volume", "faces")} == {
        "file": "cube.ply", "kernel": "solid", "volume": "1", "faces": "6"
    }  # fmt: skip


def test_kernel_json_is_the_whole_result(folder, capsys):
    _, out, _ = run(capsys, "kernel", "star.ply", "--json", "-o", "k.json")
    document = json.loads(out)
    assert document == json.loads(Path("k.json").read_text())
    assert document.pop("file") == "star.ply"
    assert document == json.loads(to_json(exact_kernel("star.ply").to_dict()))
    assert document["certificate"]["kind"] == "solid"


def test_kernel_ply_keeps_polygons_and_their_facets(folder, capsys):
    run(capsys, "kernel", "cube.ply", "-o", "k.ply")
    kernel, mesh = exact_kernel("cube.ply"), as_mesh("k.ply")
    np.testing.assert_array_equal(mesh.vertices, kernel.vertices)
    assert mesh.n_facets == len(kernel.faces) == 6
    assert mesh.facts().volume == pytest.approx(1.0, abs=1e-15)
    head, _, body = Path("k.ply").read_bytes().partition(b"end_header\n")
    assert b"property int input_facet" in head
    assert np.frombuffer(body[8 * 24 :], "<i4").reshape(6, 6)[:, 5].tolist() == kernel.face_facets.tolist()


@pytest.mark.parametrize(("name", "corners", "faces"), [("flat", 4, 1), ("torus", 0, 0)])
def test_kernels_without_volume_are_written(folder, capsys, name, corners, faces):
    code, _, _ = run(capsys, "kernel", f"{name}.ply", "-o", "k.ply")
    assert code == 0
    head = Path("k.ply").read_bytes().partition(b"end_header\n")[0].decode()
    assert f"element vertex {corners}\n" in head
    assert f"element face {faces}\n" in head


def test_kernel_grid_options(folder, capsys):
    code, out, _ = run(capsys, "kernel", "star.ply", "--depth", "5", "--frame", "principal", "--json")
    assert code == 0
    document = json.loads(out)
    low, high = document["volume_bounds"]
    assert low <= exact_kernel("star.ply").volume <= high
    assert document["depth"] == 5
    code, out, _ = run(capsys, "kernel", "star.ply", "--rtol", "0.2", "--json")
    low, high = json.loads(out)["volume_bounds"]
    assert high - low <= 0.2 * high
    code, out, _ = run(capsys, "kernel", "star.ply", "--voxel-size", "0.25")
    assert code == 0
    assert "voxel size        0.25" in out


def test_kernel_npz_has_the_grid_and_info_reads_it(folder, capsys):
    code, _, err = run(capsys, "kernel", "star.ply", "-o", "k.npz", "--depth", "6")
    assert code == 0
    assert err.splitlines()[-1] == "voxkernel: wrote k.npz"
    grid = voxkernel.voxel_kernel("star.ply", depth=6)
    with np.load("k.npz", allow_pickle=False) as arrays:
        for name in ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_mask", "origin", "linear"):
            np.testing.assert_array_equal(arrays[f"0.{name}"], getattr(grid.inside, name))
            np.testing.assert_array_equal(arrays[f"1.{name}"], getattr(grid.boundary, name))
    code, out, _ = run(capsys, "info", "k.npz", "--json")
    assert code == 0
    document = json.loads(out)
    assert document["active_voxel_count"] == grid.active_voxel_count
    assert document["volume_bounds"] == list(grid.volume_bounds)
    np.savez("other.npz", a=np.zeros(3))
    code, out, err = run(capsys, "info", "other.npz")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "must be an .npz file of this library" in err


def test_kernel_vdb_and_info_reads_it(folder, capsys):
    assert run(capsys, "kernel", "star.ply", "-o", "k.vdb", "--depth", "6")[0] == 0
    grid = voxkernel.voxel_kernel("star.ply", depth=6)
    code, out, _ = run(capsys, "info", "k.vdb", "--json")
    assert code == 0
    inside, boundary = json.loads(out)["grids"]
    assert (inside["name"], inside["active_voxel_count"]) == ("inside", grid.inside.active_voxel_count)
    assert (boundary["name"], boundary["active_voxel_count"]) == ("boundary", grid.boundary.active_voxel_count)
    assert run(capsys, "info", "k.vdb")[1].count("Number of active voxels") == 2


def test_kernel_grid_as_mesh(folder, capsys):
    assert run(capsys, "kernel", "star.ply", "-o", "k.ply", "--depth", "5")[0] == 0
    low, _ = voxkernel.voxel_kernel("star.ply", depth=5).volume_bounds
    assert as_mesh("k.ply").facts().volume == pytest.approx(low, rel=1e-9)
    assert run(capsys, "kernel", "torus.ply", "-o", "empty.ply", "--depth", "5")[0] == 0
    assert b"element vertex 0\n" in Path("empty.ply").read_bytes()


def test_kernel_picture(folder, capsys):
    code, _, err = run(capsys, "kernel", "cube.ply", "--picture", "k.html", "--depth", "4", "--domain", "box")
    assert code == 0
    assert err.splitlines()[-1] == "voxkernel: wrote k.html"
    assert Path("k.html").stat().st_size > 1_000_000


# ---------------------------------------------------------------- info


def test_info(folder, capsys):
    code, out, _ = run(capsys, "info", "cube.ply")
    assert code == 0
    rows = {line[:23].strip(): line[23:].strip() for line in out.splitlines()}
    assert (rows["facets"], rows["closed"], rows["genus"], rows["volume"]) == ("12", "yes", "0", "1")
    document = json.loads(run(capsys, "info", "field.ply", "--json")[1])
    assert (document["closed"], document["volume"], document["outward"]) == (False, None, None)
    assert document["boundary_loops"] == 1


# ---------------------------------------------------------------- odd names, odd streams


def test_exotic_file_names(folder, capsys):
    for name in ("wörld 你好.ply", "-dash.ply", "two\nlines.ply", "%s{0}.ply"):
        (folder / name).write_bytes((folder / "cube.ply").read_bytes())
        code, out, _ = run(capsys, "score", "--", name)
        assert code == 0
        assert len(out.splitlines()) == 1
        code, out, _ = run(capsys, "kernel", "--json", "--", name)
        assert code == 0
        assert json.loads(out)["file"] == name
    assert run(capsys, "kernel", "cube.ply", "-o", "wörld\n你.json")[0] == 0


@pytest.mark.skipif(sys.platform != "linux", reason="file names of arbitrary bytes are a Linux matter")
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_file_names_that_are_no_text(folder, encoding):
    name = b"cube-\xff\xe9.ply"
    (folder / os.fsdecode(name)).write_bytes((folder / "cube.ply").read_bytes())
    env = {"PYTHONIOENCODING": encoding}
    done = process("score", os.fsdecode(name), os.fsdecode(b"missing-\xff.ply"), env=env, cwd=folder)
    assert done.returncode == 1
    assert b"Traceback" not in done.stderr
    assert len(done.stdout.splitlines()) == 2
    done = process("score", os.fsdecode(name), "--json", env=env, cwd=folder)
    assert json.loads(done.stdout)[0]["file"] == os.fsdecode(name)


def test_broken_pipe_is_silent(folder):
    reader, writer = os.pipe()
    os.close(reader)
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1])}
    words = [sys.executable, "-m", "voxkernel.cli.main", "score", "cube.ply", "star.ply", "--quiet"]
    try:
        done = subprocess.run(words, stdout=writer, stderr=subprocess.PIPE, env=env, cwd=folder)
    finally:
        os.close(writer)
    assert done.stderr == b""
    assert done.returncode in (0, 1)


# ---------------------------------------------------------------- demo


@pytest.mark.slow
def test_demo(tmp_path, monkeypatch, capsys):
    """Two of the shapes, so that it is quick; the whole demo is what CI runs first."""
    from voxkernel import demo_shapes

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo_shapes, "SHAPES", [s for s in demo_shapes.SHAPES if s.name in ("slit", "torus")])
    code, out, err = run(capsys, "demo", "-o", "out")
    assert code == 0
    made = {p.name for p in Path("out").iterdir()}
    assert made == {
        "index.html", "interactive.html", "slit.ply", "slit.png", "torus.ply", "torus.png", "kernels",
    }  # fmt: skip
    assert {p.name for p in Path("out/kernels").iterdir()} == {"slit.ply", "slit.json", "torus.ply", "torus.json"}
    assert "slit      star-shaped       ratio 0.002494" in out
    assert "report       out" in out
    assert err.splitlines()[-1].endswith("open " + str(Path("out/index.html")))
    page = Path("out/index.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 2
    assert "not star-shaped" in page
    assert "http://" not in page
    assert "https://" not in page
    assert as_mesh("out/kernels/slit.ply").facts().volume == pytest.approx(0.01, rel=1e-9)
    assert run(capsys, "demo", "-o", "out", "-q")[2] == ""  # again into the same folder


# ---------------------------------------------------------------- small parts


def test_number_and_display():
    assert [number(v) for v in (None, float("nan"), float("inf"), 1.0, 1 / 3)] == ["-", "-", "-", "1", "0.333333"]
    assert display("a\tb\x1b[31m") == r"a\tb\x1b[31m"
    assert display("grüße 你") == "grüße 你"
