"""The scripts of `datasets_tools`: help, exit codes, and the shapes by formula against the library."""

import ast
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tables import read_rows

from voxkernel import as_mesh, best_center, exact_kernel

TOOLS = Path(__file__).resolve().parent.parent / "datasets_tools"
SCRIPTS = (
    "check_manifest", "classify", "compare_methods", "evaluate_registration", "evaluate_together",
    "fit_registration_verdict", "make_labels", "make_shapes", "prepare_bu3dfe", "prepare_thingi10k",
)  # fmt: skip
PARTS = (
    "classification", "faulty_shapes", "known_shapes", "label_formulas", "registration_changes", "registration_methods",
    "registration_pairs", "registration_rows", "registration_shapes", "scan_sets", "shape_families", "shape_formulas",
    "tool",
)  # fmt: skip


pytestmark = pytest.mark.usefixtures("datasets_tools")


def test_csv_has_no_formulas_and_is_read_as_it_was(tmp_path):
    import tool

    texts = ["=1", "'=1", "-a", "\t=1", "'quoted'", "plain", ""]
    tool.write_csv(tmp_path / "a.csv", ["text", "number"], [{"text": text, "number": -0.5} for text in texts])
    assert [row["text"] for row in read_rows(tmp_path / "a.csv")] == ["'" + text for text in texts[:4]] + texts[4:]
    found = tool.read_csv(tmp_path / "a.csv")
    assert [row["text"] for row in found] == texts
    assert {row["number"] for row in found} == {"-0.5"}


# ---------------------------------------------------------------- every script


@pytest.mark.parametrize("name", SCRIPTS)
def test_help_needs_no_library(name):
    """`-S` hides installed packages: numpy, voxkernel and the rest cannot have been imported."""
    env = {key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"}  # they import one another
    command = [sys.executable, "-S", str(TOOLS / f"{name}.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=env)
    assert done.returncode == 0, done.stderr
    assert "examples:" in done.stdout
    assert f"{name}.py" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("name", SCRIPTS)
def test_examples_of_the_help_parse(name, monkeypatch):
    """Every example line of a script is accepted by its own parser."""
    import importlib
    import shlex

    module, tool = importlib.import_module(name), importlib.import_module("tool")
    parsed = []
    monkeypatch.setattr(tool, "run", lambda work, args: parsed.append(args) or 0)
    for line in module.EXAMPLES:
        command, *argv = shlex.split(line.partition(" #")[0])
        if command == f"{name}.py":
            assert module.main(argv) == 0
    assert parsed


@pytest.mark.parametrize(
    ("name", "argv"),
    [
        ("make_shapes", ["{tmp}/shapes", "--families", "spheres"]),
        ("make_shapes", ["{tmp}/shapes", "--seed", "-1"]),
        ("make_shapes", ["{tmp}/no/shapes"]),
        ("prepare_bu3dfe", ["{tmp}/none", "-o", "{tmp}/a.csv"]),
        ("prepare_bu3dfe", ["{tmp}", "-o", "{tmp}/a.csv", "--expressions", "XX"]),
        ("prepare_thingi10k", ["-o", "{tmp}/a.csv", "--ids", "one"]),
        ("check_manifest", ["{tmp}/a.csv", "--columns", "colour"]),
        ("check_manifest", ["{tmp}/a.csv", "--rtol", "0"]),
        ("compare_methods", []),
        ("evaluate_registration", ["--data", "{tmp}"]),
        ("compare_methods", ["a.ply", "--methods", "magic"]),
        ("classify", ["{tmp}", "--manifest", "{tmp}/a.csv", "-o", "{tmp}/report.html"]),
    ],
)
def test_bad_usage(name, argv, tmp_path, capsys):
    import importlib

    assert importlib.import_module(name).main([a.format(tmp=tmp_path) for a in argv]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "argv"),
    [
        ("make_shapes", ["shapes", "--count", "0"]),
        ("prepare_thingi10k", ["-o", "a.csv", "--facets", "many"]),
        ("prepare_thingi10k", ["-o", "a.csv", "--facets", ":"]),
        ("compare_methods", ["--repeat", "x"]),
        ("evaluate_registration", ["--pairs", "0"]),
        ("evaluate_registration", ["--methods", "magic"]),
        ("classify", ["run"]),
    ],
)
def test_arguments_that_do_not_parse(name, argv, capsys):
    import importlib

    with pytest.raises(SystemExit, match="2"):
        importlib.import_module(name).main(argv)
    assert capsys.readouterr().err.count("\n") == 1


def test_scripts_import_nothing_private_of_the_library():
    """Only the public names, and the reader of runs and its CSV lines."""
    for path in (TOOLS / f"{name}.py" for name in (*SCRIPTS, *PARTS)):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("voxkernel._"):
                assert path.name in ("classify.py", "tool.py")
                assert node.module == "voxkernel.run_table"


# ---------------------------------------------------------------- make_shapes: truth by formula, library as the oracle


def _families():
    sys.path.insert(0, str(TOOLS))
    try:
        from shape_families import FAMILIES, SERIES
    finally:
        sys.path.remove(str(TOOLS))
    return FAMILIES, SERIES


FAMILIES, SERIES = _families()


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("facets", [1, 300])
def test_truth_of_shapes(family, facets):
    """Dimension and volume of the kernel by formula against `exact_kernel`."""
    from shape_families import make_shape

    for index in range(12 if family in SERIES else 2 * len(FAMILIES[family])):
        _, shape = make_shape(family, index, seed=5, facets=facets)
        kernel = exact_kernel(shape.surface)
        if shape.dimension is not None:
            assert kernel.unclipped_dimension == shape.dimension, (family, index)
            assert kernel.certificate.verify()
            assert shape.is_star_shaped is (shape.dimension >= 0)
        if shape.kernel_volume is not None:
            assert kernel.volume == pytest.approx(shape.kernel_volume, rel=1e-9, abs=0), (family, index)
        if shape.dimension is not None and shape.dimension >= 0:
            assert shape.defect == 0


@pytest.mark.parametrize("family", ["near-star", "non-star"])
def test_defect_of_shapes(family):
    """Smallest violation by construction against the certain bounds of `best_center`."""
    from shape_families import make_shape

    known = 0
    for index in range(2 * len(FAMILIES[family])):
        _, shape = make_shape(family, index, seed=8, facets=60)
        if shape.defect is None:
            continue
        low, high = best_center(shape.surface, relative_gap=1e-3).violation_bounds
        assert low * (1 - 1e-9) <= shape.defect <= high * (1 + 1e-9), (family, index)
        assert high - low <= 1.1e-3 * high
        known += 1
    assert known >= 4


def test_shut_shapes_have_their_defect():
    """The least violated points are beside two planes almost at one place: only the upper bound is met."""
    from faulty_shapes import THIN

    shape = THIN["shut"](np.random.default_rng(0), 1)
    low, high = best_center(shape.surface).violation_bounds
    assert low <= shape.defect == pytest.approx(high, rel=1e-9)


def test_star_shapes_are_not_convex():
    from shape_families import make_shape

    for index in range(len(FAMILIES["star"])):
        kind, shape = make_shape("star", index, seed=1, facets=300)
        mesh = as_mesh(shape.surface)
        assert mesh.facts().is_closed
        assert mesh.facts().is_outward
        assert exact_kernel(mesh).volume < 0.99 * mesh.facts().volume, kind


def test_closed_families_are_closed_and_outward():
    from shape_families import make_shape

    for family in ("convex", "star", "non-star", "near-star", "noise"):
        for index in range(len(FAMILIES[family])):
            kind, shape = make_shape(family, index, seed=2, facets=200)
            facts = as_mesh(shape.surface).facts()
            assert facts.is_closed, (family, kind)
            assert facts.is_oriented is (kind != "flipped-bump")
            assert facts.volume > 0 or kind == "flipped-bump"
            assert len(facts.degenerate_facets) == 0


def test_facets_are_near_the_target():
    from shape_families import make_shape

    for facets in (500, 3000):
        for family, kinds in FAMILIES.items():
            for index in range(len(kinds) if family != "retriangulated" else 0):  # these start with a 16th
                kind, shape = make_shape(family, index, seed=3, facets=facets)
                assert 0.3 * facets <= len(shape.surface[1]) <= 3.1 * facets, (family, kind)


def test_levels_of_a_series_are_one_surface():
    """Re-triangulated shapes have one kernel; noise of level 0 is the base, and the base is the same for all."""
    from shape_families import make_shape

    shapes = [make_shape("retriangulated", index, seed=4, facets=300)[1] for index in range(6)]
    kernels = [exact_kernel(shape.surface) for shape in shapes]
    assert len({len(shape.surface[1]) for shape in shapes}) >= 4
    assert {shape.kernel_volume for shape in shapes} == {shapes[0].kernel_volume}
    for kernel in kernels:
        assert kernel.volume == pytest.approx(kernels[0].volume, rel=1e-9)
    first, second = (make_shape("noise", index, seed=4, facets=300)[1].surface[0] for index in (0, 1))
    assert 0 < np.abs(first - second).max() < 0.1


def test_thin_shapes_are_written_exactly(tmp_path):
    """Reading a file back gives the doubles, so flat kernels stay flat."""
    from make_shapes import write_shapes

    rows = write_shapes(tmp_path, families=["thin"], count=12, facets=100)
    assert {row["dimension"] for row in rows} == {-1, 0, 1, 2, 3}
    for row in rows:
        assert exact_kernel(tmp_path / row["file"]).dimension == row["dimension"]


def _digests(folder):
    return {p.relative_to(folder): hashlib.sha256(p.read_bytes()).digest() for p in folder.rglob("*") if p.is_file()}


def test_shapes_depend_on_the_seed_alone(tmp_path):
    from make_shapes import main

    for name, options in {"a": [], "b": [], "seed": ["--seed", "9"], "more": ["--count", "9"]}.items():
        assert main([str(tmp_path / name), "--count", "7", "--facets", "60", "--quiet", *options]) == 0
    a, b, other, more = (_digests(tmp_path / name) for name in ("a", "b", "seed", "more"))
    assert a == b
    assert a.keys() == other.keys()
    assert sum(a[name] == other[name] for name in a) == 0
    del a[Path("manifest.csv")]
    assert a.items() <= more.items()


def test_manifest_and_broken_files(tmp_path, capsys):
    from make_shapes import BROKEN, main

    from voxkernel import VoxKernelError

    folder = tmp_path / "shapes"
    assert main([str(folder), "--families", "star,open", "--count", "3", "--facets", "60", "--broken", "6"]) == 0
    assert capsys.readouterr().out == ""
    rows = read_rows(folder / "manifest.csv")
    assert [row["label"] for row in rows] == ["star"] * 3 + ["open"] * 3 + ["broken"] * 6
    assert sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*.ply")) == sorted(r["file"] for r in rows)
    assert tuple(row["kind"] for row in rows[6:]) == BROKEN
    for row in rows[:6]:
        assert as_mesh(folder / row["file"]).n_facets == int(row["facets"])
        assert json.loads(row["parameters"])
        assert row["truth"] == "star-shaped"
    for row in rows[6:]:
        with pytest.raises(VoxKernelError):
            as_mesh(folder / row["file"])


def test_list_of_families(capsys):
    from make_shapes import main

    with pytest.raises(SystemExit, match="0"):
        main(["--list"])
    out = capsys.readouterr().out
    assert all(family in out for family in FAMILIES)
    assert "stellated-cube" in out


# ---------------------------------------------------------------- evaluate_registration


def test_pairs_and_errors_of_registration():
    """The true motion has no error; turning it by an angle has that error."""
    from evaluate_registration import Outcome, errors, table
    from registration_pairs import cropped, formula_pairs, motion
    from scipy.spatial.transform import Rotation

    pairs = list(formula_pairs(2))
    assert [p.row for p in pairs[:3]] == ["formula, 1 % noise", "formula, 400 facets", "formula, 20 % cropped"]
    assert len({p.T_target_source.tobytes() for p in pairs}) == len(pairs)
    again = next(formula_pairs(1))
    np.testing.assert_array_equal(again.target[0], pairs[0].target[0])
    pair = pairs[0]
    assert max(errors(pair.T_target_source, pair)) < 1e-9
    turned = pair.T_target_source @ motion(Rotation.from_rotvec([0, 0.03, 0]).as_matrix(), np.zeros(3))
    assert errors(turned, pair)[0] == pytest.approx(np.degrees(0.03))
    vertices, faces = pair.source
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept = cropped(pair.source, 0.3, 0)[1]
    left = vertices[kept]
    assert np.linalg.norm(np.cross(left[:, 1] - left[:, 0], left[:, 2] - left[:, 0]), axis=1).sum() == pytest.approx(
        0.7 * areas.sum(), rel=1e-3
    )
    outcome = Outcome("a|b", 0, "kernels", 5.0, 0.1, 1.0, 0.001, 0.2, led_by="kernels")
    assert outcome.success
    assert "**1** of 1" in table([outcome], ["kernels"])


def test_registration_is_measured_and_written(tmp_path, capsys):
    import evaluate_registration

    argv = ["--pairs", "1", "--methods", "kernels", "icp", "-q", "--json", str(tmp_path / "raw.json")]
    argv += ["--outcomes", str(tmp_path / "lines.jsonl")]
    assert evaluate_registration.main(argv) == 0
    out = capsys.readouterr().out
    assert "| formula, 20 % cropped | **1** of 1" in out
    outcomes = json.loads((tmp_path / "raw.json").read_text())
    assert len(outcomes) == 6
    assert all(o["final_deg"] < 2 for o in outcomes if o["method"] == "kernels")
    # What is known is not measured again: seconds stay.
    before = (tmp_path / "lines.jsonl").read_text()
    assert [json.loads(line) for line in before.splitlines()] == outcomes
    assert evaluate_registration.main(argv) == 0
    assert (tmp_path / "lines.jsonl").read_text() == before
    assert json.loads((tmp_path / "raw.json").read_text()) == outcomes
    # Only the rows with a word, of what is known.
    assert evaluate_registration.main([*argv, "--only", "cropped"]) == 0
    assert {o["row"] for o in json.loads((tmp_path / "raw.json").read_text())} == {"formula, 20 % cropped"}
    capsys.readouterr()
    assert evaluate_registration.main([*argv, "--only", "shoulders"]) == 2
    assert "--only must have a word of a row; got 'shoulders'" in capsys.readouterr().err
