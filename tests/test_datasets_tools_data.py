"""The scripts of `datasets_tools` that read data: BU-3DFE, Thingi10K, manifests, comparison, classification."""

import csv
import json
import shutil
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from tables import read_rows

from voxkernel import VoxKernelError, as_mesh, defect_profile, exact_kernel, spherical_map, starshapeness

TOOLS = Path(__file__).resolve().parent.parent / "datasets_tools"


pytestmark = pytest.mark.usefixtures("datasets_tools")


# ---------------------------------------------------------------- BU-3DFE


def _write_wrl(path, surface):
    """VRML 2 as face scanners write it; coordinates with 6 digits."""
    points = ",\n".join(" ".join(f"{v:.6f}" for v in point) for point in surface[0])
    faces = ",\n".join(", ".join(map(str, [*face, -1])) for face in surface[1])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        "#VRML V2.0 utf8\nShape {\n geometry IndexedFaceSet {\n  coord Coordinate { point [\n"
        f"{points}\n] }}\n  coordIndex [\n{faces}\n]\n }}\n}}\n",
        encoding="ascii",
    )


FACES = (
    "F0001/F0001_NE00WH_F3D.wrl", "F0001/F0001_AN01WH_F3D.wrl", "F0001/F0001_AN01WH_RAW.wrl",
    "F0056/F0056_DI04AE_F3D.wrl", "M0001/M0001_FE02AM_F3D.wrl", "M0044/M0044_HA03LA_F3D.wrl",
    "M0044/M0044_SA04LA_F3D.wrl", "extra/M0002/M0002_SU01IN_RAW.WRL", "extra/M0003/M0003_NE00BL_F3D.wrl",
)  # fmt: skip


@pytest.fixture
def bu3dfe(tmp_path):
    """A tree with the names of BU-3DFE, each file a face-like surface by formula."""
    from shape_families import make_shape

    folder = tmp_path / "BU_3DFE"
    for number, file in enumerate(FACES):
        _write_wrl(folder / file, make_shape("open", 3 * number + 1, seed=1, facets=50)[1].surface)
    (folder / "F0001" / "F0001_AN01WH_F3D.bnd").write_text("0 0 0\n")
    (folder / "readme.txt").write_text("not a mesh")
    return folder


def test_bu3dfe_manifest(bu3dfe, tmp_path, capsys):
    from prepare_bu3dfe import COLUMNS, main

    assert main([str(bu3dfe), "-o", str(tmp_path / "faces.csv")]) == 0
    assert capsys.readouterr().err == "9 meshes of 6 subjects\n"
    rows = read_rows(tmp_path / "faces.csv")
    assert tuple(rows[0]) == COLUMNS
    assert [row["file"] for row in rows] == sorted(FACES)
    found = {row["file"]: row for row in rows}
    assert found["F0056/F0056_DI04AE_F3D.wrl"] == {
        "file": "F0056/F0056_DI04AE_F3D.wrl", "label": "disgust", "subject": "F0056", "gender": "female",
        "expression": "DI", "intensity": "4", "ethnicity": "AE", "kind": "F3D",
    }  # fmt: skip
    assert found["extra/M0002/M0002_SU01IN_RAW.WRL"]["kind"] == "RAW"
    assert found["M0044/M0044_HA03LA_F3D.wrl"]["gender"] == "male"
    assert {row["intensity"] for row in rows if row["expression"] == "NE"} == {"0"}


def test_bu3dfe_conversion(bu3dfe, tmp_path):
    from prepare_bu3dfe import main

    target = tmp_path / "ply"
    argv = [str(bu3dfe), "-o", str(tmp_path / "a.csv"), "--kind", "F3D", "--expressions", "ne,ha", "--ply", str(target)]
    assert main([*argv, "--quiet"]) == 0
    rows = read_rows(tmp_path / "a.csv")
    assert [row["expression"] for row in rows] == ["NE", "HA", "NE"]
    for row in rows:
        assert Path(row["ply"]) == target / Path(row["file"]).with_suffix(".ply")
        one, other = as_mesh(bu3dfe / row["file"]), as_mesh(row["ply"])
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)
        assert exact_kernel(other, domain="box").unclipped_dimension == 3


def test_bu3dfe_names_files_it_cannot_use(bu3dfe, tmp_path, capsys):
    from prepare_bu3dfe import main

    (bu3dfe / "F0001" / "F0001_NE00WH_F3D.wrl").write_text("#VRML V2.0 utf8\n")
    strange = ("F0057_AN01WH_F3D", "M0045_AN01WH_F3D", "F0002_XX01WH_F3D", "F0002_AN05WH_F3D", "F0002_NE01WH_F3D",
               "F0002_AN00WH_F3D", "F0002_AN01XX_F3D", "F0002_AN01WH_F2D", "F0000_AN01WH_F3D")  # fmt: skip
    for name in strange:
        (bu3dfe / f"{name}.wrl").touch()
    argv = [str(bu3dfe), "-o", str(tmp_path / "a.csv"), "--ply", str(tmp_path / "ply"), "--quiet"]
    assert main(argv) == 1
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == len(strange) + 1
    assert all(any(name in line for line in errors) for name in strange)
    assert "F0001_NE00WH_F3D.wrl" in errors[-1]
    rows = read_rows(tmp_path / "a.csv")
    assert len(rows) == 9
    assert [row["file"] for row in rows if not row["ply"]] == ["F0001/F0001_NE00WH_F3D.wrl"]


def test_bu3dfe_in_an_empty_folder(tmp_path, capsys):
    from prepare_bu3dfe import main

    assert main([str(tmp_path), "-o", str(tmp_path / "a.csv"), "--quiet"]) == 1
    assert "no file like F0001_AN01WH_F3D.wrl" in capsys.readouterr().err


# ---------------------------------------------------------------- Thingi10K


class FakeThingi10K(types.ModuleType):
    """The interface of the package `thingi10k` on a few models made by formula."""

    def __init__(self, folder):
        super().__init__("thingi10k")
        self.asked, self.filters, self.entries = None, None, []
        from shape_families import make_shape

        for number, (family, license_) in enumerate(
            [("star", "Creative Commons - Attribution"), ("open", "BSD (3-clause)"), ("convex", "BSD (3-clause)")]
        ):
            vertices, faces = make_shape(family, number, seed=2, facets=50)[1].surface
            path = folder / f"{900 - number}.npz"
            np.savez(path, vertices=vertices, facets=faces.astype(np.int32))
            closed = family != "open"
            self.entries.append({
                "file_id": 900 - number, "thing_id": 7000 + number, "file_path": str(path), "author": "someone",
                "date": None, "license": license_, "category": "Art", "subcategory": "Math Art", "name": f"a, {family}",
                "tags": ["x"], "num_vertices": len(vertices), "num_facets": len(faces), "num_components": 1,
                "num_boundary_edges": 0 if closed else 40, "closed": closed, "self_intersecting": None,
                "vertex_manifold": True, "edge_manifold": closed, "oriented": True, "PWN": closed, "solid": closed,
                "euler": 2 if closed else 1,
            })  # fmt: skip

    def init(self, variant=None, cache_dir=None, force_redownload=False):
        self.asked = (variant, cache_dir)

    def dataset(self, **filters):
        assert self.asked, "Dataset is not initialized. Call init() first."
        self.filters = filters
        exact = {k: v for k, v in filters.items() if k in ("closed", "oriented", "solid")}
        return [e for e in self.entries if all(e[k] == v for k, v in exact.items())]

    def load_file(self, path):
        with np.load(path) as data:
            return np.asarray(data["vertices"], np.float64), np.asarray(data["facets"], np.int32)


@pytest.fixture
def thingi10k(tmp_path, monkeypatch):
    fake = FakeThingi10K(tmp_path)
    monkeypatch.setitem(sys.modules, "thingi10k", fake)
    return fake


def test_thingi10k_manifest(thingi10k, tmp_path):
    from prepare_thingi10k import COLUMNS, main

    assert main(["-o", str(tmp_path / "things.csv"), "--cache", "there", "--quiet"]) == 0
    assert thingi10k.asked == ("npz", "there")
    assert thingi10k.filters == {}
    rows = read_rows(tmp_path / "things.csv")
    assert tuple(rows[0]) == COLUMNS
    assert [row["file_id"] for row in rows] == ["898", "899", "900"]
    assert [row["closed"] for row in rows] == ["yes", "no", "yes"]
    assert [row["manifold"] for row in rows] == ["yes", "no", "yes"]
    assert {row["self_intersecting"] for row in rows} == {""}
    assert rows[2]["license"] == "Creative Commons - Attribution"
    assert rows[2]["name"] == "a, star"
    assert rows[2]["thing_id"] == "7000"


def test_thingi10k_filters_and_conversion(thingi10k, tmp_path):
    from prepare_thingi10k import main

    argv = ["-o", str(tmp_path / "things.csv"), "--ply", str(tmp_path / "ply"), "--closed"]
    argv += ["--facets", "10:500", "--components", "1", "--license", "BSD (3", "--ids", "1,2", "--limit", "1"]
    assert main([*argv, "--quiet"]) == 0
    assert thingi10k.filters == {
        "closed": True, "num_facets": (10, 500), "num_components": (1, 1), "license": r"BSD\ \(3", "file_id": [1, 2],
    }  # fmt: skip
    (row,) = read_rows(tmp_path / "things.csv")
    entry = thingi10k.entries[0]
    mesh = as_mesh(row["file"])
    assert Path(row["file"]) == tmp_path / "ply" / "900.ply"
    assert mesh.facts().is_closed
    assert np.array_equal(mesh.faces, thingi10k.load_file(entry["file_path"])[1])


def test_thingi10k_models_that_hold_no_surface(thingi10k, tmp_path, capsys):
    from prepare_thingi10k import main

    np.savez(tmp_path / "900.npz", vertices=np.zeros((0, 3)), facets=np.zeros((0, 3), np.int32))
    assert main(["-o", str(tmp_path / "things.csv"), "--ply", str(tmp_path / "ply"), "--quiet"]) == 1
    assert "900.npz" in capsys.readouterr().err
    assert [row["file_id"] for row in read_rows(tmp_path / "things.csv")] == ["898", "899"]


def test_thingi10k_without_the_package(tmp_path, monkeypatch, capsys):
    from prepare_thingi10k import main

    monkeypatch.setitem(sys.modules, "thingi10k", None)
    assert main(["-o", str(tmp_path / "things.csv")]) == 1
    assert "pip install thingi10k" in capsys.readouterr().err


# ---------------------------------------------------------------- check_manifest


@pytest.fixture
def made(tmp_path):
    """A folder of make_shapes: two or three shapes of each family, and broken files."""
    from make_shapes import write_shapes

    folder = tmp_path / "shapes"
    folder.mkdir()
    write_shapes(folder, count=4, facets=40, seed=3, broken=6)
    return folder


def test_check_manifest_agrees_with_make_shapes(made, capsys):
    from check_manifest import main

    assert main([str(made / "manifest.csv")]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("38 meshes, ")
    assert ", 0 differences" in err


@pytest.mark.parametrize(
    ("column", "change"),
    [
        ("kernel_volume", lambda v: repr(float(v) * (1 + 1e-5))),
        ("defect", lambda v: repr(float(v) * 1.01)),
        ("dimension", lambda v: str(int(v) + 1)),
        ("truth", lambda v: "degenerate"),
        ("is_star_shaped", lambda v: "no" if v == "yes" else "yes"),
        ("facets", lambda v: "many"),
    ],
)
def test_check_manifest_finds_an_altered_value(made, column, change, capsys):
    from check_manifest import main

    file = made / "manifest.csv"
    rows = read_rows(file)
    kind = "near-star/shelf-00001.ply" if column == "defect" else "star/notched-box-00003.ply"
    (row,) = (row for row in rows if row["file"] == kind)
    listed = row[column]
    row[column] = change(listed)
    with file.open("w", newline="") as lines:
        writer = csv.DictWriter(lines, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    assert main([str(file), "--columns", f"{column},vertices", "--json", "--quiet"]) == 1
    found = json.loads(capsys.readouterr().out)
    (difference,) = found["differences"]
    assert (difference["file"], difference["column"], difference["listed"]) == (kind, column, row[column])
    other = "truth" if column == "facets" else "facets"
    assert main([str(file), "--columns", other, "--quiet"]) == 0


def test_check_manifest_of_missing_broken_and_mended_files(made, capsys):
    from check_manifest import main

    (made / "convex" / "box-00000.ply").unlink()
    shutil.copy(made / "convex" / "prism-00002.ply", made / "broken" / "nan-00003.ply")
    assert main([str(made / "manifest.csv"), "--columns", "facets", "--quiet"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert lines[1].startswith("convex/box-00000.ply")
    assert lines[2].split() == ["broken/nan-00003.ply", "truth", "broken", "a", "mesh"]


def test_check_manifest_without_columns_to_compare(tmp_path, capsys):
    from check_manifest import main

    (tmp_path / "a.csv").write_text("name,colour\na,red\n")
    assert main([str(tmp_path / "a.csv")]) == 1
    assert "must have rows with `file`" in capsys.readouterr().err
    assert main([str(tmp_path / "none.csv")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_check_manifest_of_real_data(data_dir, tmp_path, capsys):
    """A part of the data, each column; the two known ways of counting are notes."""
    from check_manifest import main

    wanted = ("real_leeperrysmith_face", "ir_leeperrysmith_head", "sorgente_star", "fandisk", "vase1", "ict05_smile",
              "scan_ict08", "pmp_hemisphere")  # fmt: skip
    with (data_dir / "manifest.csv").open(newline="") as lines:
        head, *rows = lines.read().splitlines()
    for folder in ("closed", "faces", "open", "scans", "polyhedral"):
        (tmp_path / folder).symlink_to(data_dir / folder)
    part = [row for row in rows if any(name in row.split(",")[0] for name in wanted) and "smooth" not in row]
    (tmp_path / "part.csv").write_text("\n".join([head, *part]) + "\n")
    assert main([str(tmp_path / "part.csv"), "--notes"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert f"{len(part)} meshes" in err
    assert "boundary_loops is 8, here 9" in err
    assert "euler is 7, here 4" in err
    assert main([str(data_dir / "asteroids" / "manifest.csv"), "--columns", "vertices,kernel_volume", "--quiet"]) == 0
    assert main([str(data_dir / "polyhedral" / "cells.csv"), "--columns", "orientation,volume", "--quiet"]) == 0


# ---------------------------------------------------------------- compare_methods


def test_compare_methods_on_shapes(capsys):
    """SciPy and cutting with VTK agree on all but flat kernels."""
    from compare_methods import COLUMNS, main

    assert main(["--shapes", "3", "--facets", "20", "--repeat", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    rows = found["rows"]
    assert tuple(rows[0]) == COLUMNS
    assert {row["method"] for row in rows} == {"voxkernel", "scipy", "pyvista"}
    assert len(rows) == 3 * 24
    for row in rows:
        if row["method"] == "voxkernel":
            verdict = row["verdict"]
            assert row["agrees"]
        elif row["agrees"] is not None:
            assert row["agrees"] or verdict == "degenerate", row
    assert sum(row["agrees"] is True for row in rows) > 55
    assert [line["method"] for line in found["summary"]] == ["voxkernel", "scipy", "pyvista"]


def test_compare_methods_on_files(made, capsys):
    from compare_methods import main

    files = [str(made / "star" / "notched-box-00003.ply"), str(made / "broken" / "nan-00003.ply")]
    assert main([*files, "--methods", "voxkernel,scipy", "--repeat", "1", "--csv"]) == 1
    out, err = capsys.readouterr()
    rows = list(csv.DictReader(out.splitlines()))
    assert [row["method"] for row in rows] == ["voxkernel", "scipy"]
    assert [row["agrees"] for row in rows] == ["yes", "yes"]
    assert err.count("\n") == 1
    assert "nan-00003.ply" in err


def test_compare_methods_names_disagreement_and_failure(monkeypatch, capsys):
    import compare_methods

    def wrong(mesh, most):
        return "star-shaped", 1.0

    def broken(mesh, most):
        raise RuntimeError("no\nkernel")

    monkeypatch.setitem(compare_methods.METHODS, "wrong", ("numpy", wrong))
    monkeypatch.setitem(compare_methods.METHODS, "broken", ("numpy", broken))
    monkeypatch.setitem(compare_methods.METHODS, "absent", ("no_such_package", wrong))
    assert compare_methods.installed() == ["voxkernel", "scipy", "pyvista", "wrong", "broken"]
    assert compare_methods.main(["--shapes", "1", "--facets", "20", "--methods", "voxkernel,wrong,broken"]) == 1
    out = capsys.readouterr().out
    assert out.count(" NO") == 8
    assert out.count("failed: no kernel") == 8


# ---------------------------------------------------------------- classify


def _row(folder, file):
    """A row as the engine writes it, from direct calls."""
    row = {"file": f"{folder}/{file}", "status": "failed", "seconds": 0.5}
    try:
        score = starshapeness(folder / file)
    except VoxKernelError:
        return row
    low, high = score.violation_bounds
    energies = spherical_map(folder / file, center=score.star_center).harmonics(6).energies
    return row | {
        "status": "ok", "verdict": score.verdict, "volume": score.volume, "violation_lower": low,
        "violation_upper": high, "certificate_verified": score.certificate.verify(),
        "profile_shares": defect_profile(folder / file, depth=4, tolerances=[0, 0.1, 0.3]).volume_share.tolist(),
        "energies": energies.tolist(),
    }  # fmt: skip


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    sys.path.insert(0, str(TOOLS))
    try:
        from make_shapes import write_shapes
    finally:
        sys.path.remove(str(TOOLS))
    folder = tmp_path_factory.mktemp("evaluated") / "shapes"
    folder.mkdir()
    families = ["convex", "near-star", "thin", "noise"]
    sys.path.insert(0, str(TOOLS))
    try:
        write_shapes(folder, families=families, count=12, facets=40, seed=3, broken=2)
    finally:
        sys.path.remove(str(TOOLS))
    listed = read_rows(folder / "manifest.csv")
    return folder, [_row(folder, entry["file"]) for entry in listed], listed


def test_classification_of_shapes(evaluated):
    from classification import classification

    _, rows, listed = evaluated
    found = classification(rows, listed)
    verdicts = found["verdicts"]
    assert found["meshes"] == len(listed) == 50
    assert found["missing"] == found["not_in_manifest"] == verdicts["wrong"] == []
    assert verdicts["right"] == verdicts["known"] == sum(1 for entry in listed if entry["truth"])
    assert verdicts["certificates"] == verdicts["verified"] == 48
    assert verdicts["confusion"]["broken"]["failed"] == 2
    assert found["volumes"]["count"] == 12 + 4
    assert found["volumes"]["largest"] < 1e-9
    assert found["defects"]["near-star"]["within_bounds"] == found["defects"]["near-star"]["count"] == 12
    assert found["defects"]["near-star"]["spearman_upper"] > 0.99
    assert found["retrieval"]["count"] == 48
    label = found["retrieval"]["label"]
    assert set(label) == {"defect profile", "spherical energies", "both"}
    assert label["both"]["count"] == 36
    assert label["both"]["accuracy"] > label["both"]["chance"]
    assert found["retrieval"]["series"]["noise"]["count"] == 12
    assert found["seconds"]["sum"] == pytest.approx(25.0)


def test_classification_sees_what_is_wrong(evaluated):
    from classification import classification

    _, rows, listed = evaluated
    rows = [dict(row) for row in rows]
    rows[0]["verdict"] = "not star-shaped"
    rows[1]["certificate_verified"] = False
    rows[3] = {"file": rows[3]["file"], "status": "failed", "verdict": None}
    rows[4]["file"] = "elsewhere/mesh.ply"
    for row in rows[12:24]:
        row["violation_upper"] = 1.0 - row.get("violation_upper", 0.0)
    found = classification(rows, listed)
    assert found["verdicts"]["wrong"] == [listed[0]["file"], listed[3]["file"]]
    assert found["verdicts"]["verified"] == found["verdicts"]["certificates"] - 1
    assert found["missing"] == [listed[4]["file"]]
    assert found["not_in_manifest"] == ["elsewhere/mesh.ply"]
    assert found["defects"]["near-star"]["spearman_upper"] < -0.99


def test_nearest_neighbours_by_hand():
    """Two classes on a line: 0, 1, 5 and 4, 9. Neighbours: 1, 0, 4 (wrong); 5 (wrong), 5 (wrong)."""
    from classification import classification

    def row(k, value):
        return {"file": f"{k}.ply", "status": "ok", "verdict": "star-shaped", "volume": 1.0, "profile_shares": [value]}

    rows = [row(k, v) for k, v in enumerate([0.0, 1.0, 5.0, 4.0, 9.0])]
    listed = [{"file": f"{k}.ply", "label": "ab"[k > 2]} for k in range(5)]
    found = classification(rows, listed)["retrieval"]["label"]
    assert set(found) == {"defect profile"}
    assert found["defect profile"]["accuracy"] == pytest.approx(2 / 5)
    assert found["defect profile"]["chance"] == pytest.approx((3 * 2 + 2 * 1) / 20)
    assert found["defect profile"]["classes"]["a"] == {"count": 3, "accuracy": pytest.approx(2 / 3)}


def test_truth_of_other_manifests():
    from classification import classification

    rows = [{"file": f"run/closed/{k}.ply", "status": "ok", "verdict": v} for k, v in enumerate(["star-shaped"] * 2)]
    rows = [row | {"volume": 1.0} for row in rows]
    listed = [{"file": f"closed/{k}.ply", "kernel_nonempty": v} for k, v in enumerate(["yes", "no"])]
    found = classification(rows, listed)
    assert found["verdicts"]["wrong"] == ["closed/1.ply"]
    assert set(found["verdicts"]["labels"]) == {"closed"}


def test_spearman_of_few_or_equal_values():
    from classification import spearman

    assert spearman([1, 2], [1, 2]) is None
    assert spearman([1, 1, 1], [1, 2, 3]) is None
    assert spearman([1, 2, 3], [10, 30, 20]) == pytest.approx(0.5)


def test_classify_reads_a_run_and_writes_both_files(evaluated, tmp_path, capsys):
    """Through the table's own format, with a hostile label."""
    from classify import main

    from voxkernel import run_table

    folder, rows, listed = evaluated
    fs, path = run_table.open_run(str(tmp_path / "run"))
    run_table.write_part(fs, path, rows)
    report = tmp_path / "report.md"
    argv = [str(tmp_path / "run"), "--manifest", str(folder / "manifest.csv")]
    assert main([*argv, "-o", str(report), "--title", "Shapes"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert "known verdicts are right" in err
    text, numbers = report.read_text(), json.loads(report.with_suffix(".json").read_text())
    assert text.startswith("## Shapes\n")
    assert "### Known defects" in text
    assert numbers["verdicts"]["right"] == numbers["verdicts"]["known"]
    assert main([*argv, "--json", "--quiet", "--no-retrieval"]) == 0
    assert json.loads(capsys.readouterr().out)["retrieval"] == {}
    hostile = [entry | {"label": "<b>|x|</b>"} for entry in listed]
    with (tmp_path / "hostile.csv").open("w", newline="") as lines:
        writer = csv.DictWriter(lines, hostile[0])
        writer.writeheader()
        writer.writerows(hostile)
    assert main([argv[0], "--manifest", str(tmp_path / "hostile.csv"), "--quiet"]) == 0
    out = capsys.readouterr().out
    assert "<b>" not in out.replace(r"\<b\>", "")


def test_classify_says_what_it_cannot_use(evaluated, tmp_path, capsys):
    from classify import main

    folder, _, _ = evaluated
    assert main([str(tmp_path / "nothing"), "--manifest", str(folder / "manifest.csv")]) == 1
    assert "must be a run directory" in capsys.readouterr().err
