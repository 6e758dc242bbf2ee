"""`evaluate`: the table and what is in it, resume, labels, remote paths, the command."""

import csv
import hashlib
import io
import json
import os
import shutil
import time
from contextlib import closing

import fsspec
import numpy as np
import pyarrow.parquet as pq
import pytest
import shapes

from voxkernel import as_mesh, run_table, write_report
from voxkernel import defect_profile as profile_of
from voxkernel import starshapeness as score_of
from voxkernel.cli import main as cli
from voxkernel.evaluation import PROFILE_TOLERANCES, EvaluateSettings, EvaluationProgress, evaluate, file_stamp, resume
from voxkernel.evaluation.analysis import analyse
from voxkernel.evaluation.inputs import Item, Labels, content_hash, count_suffixes, find_items, labelled, read_labels
from voxkernel.evaluation.later_stamps import LaterStamps
from voxkernel.evaluation.settings import FEW, for_files, settings_hash
from voxkernel.evaluation.worker import run_batch
from voxkernel.run_index import open_index

ONE = EvaluateSettings(workers=1)
MADE = {
    "cube": shapes.cube(),
    "flat": shapes.s_tetromino(0.0),
    "torus": shapes.torus(n_major=8, n_minor=6),
    "field": shapes.height_field(n=3),
    "star": shapes.star_prism(),
}
HOSTILE = "<img src=x onerror=alert(1)>\n'\"&;.ply"


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """Meshes by formula in two folders, one that is broken and one with a hostile name."""
    folder = tmp_path_factory.mktemp("meshes")
    for name, made in MADE.items():
        (folder / ("solids" if name != "field" else "fields")).mkdir(exist_ok=True)
        as_mesh(made).write(folder / ("solids" if name != "field" else "fields") / f"{name}.ply")
    (folder / "broken.ply").write_text("ply\nnonsense")
    shutil.copy(folder / "solids" / "cube.ply", folder / HOSTILE)
    (folder / "notes.txt").write_text("no mesh")
    (folder / ".hidden.ply").write_text("no mesh")
    return folder


@pytest.fixture(scope="module")
def full(meshes, tmp_path_factory):
    """Everything there is, once."""
    run = tmp_path_factory.mktemp("full") / "run"
    settings = EvaluateSettings(
        workers=1, visible=True, energies=4, thumbnails=True, views=3, csv=True, depth=5, tolerances=(0.0, 0.05, 0.5)
    )
    seen = []
    result = evaluate(meshes, output=run, settings=settings, labels="folders", progress=seen.append)
    return run, result, {os.path.basename(row["file"]): row for row in result.table().to_pylist()}, seen


def rows_of(run):
    return {os.path.basename(row["file"]): row for row in run_table.read_rows(str(run)).to_pylist()}


def without_times(table):
    skip = [n for n in table.column_names if n.startswith("seconds") or n == "finished"]
    return table.drop_columns(skip)


# ---------------------------------------------------------------- rows


def test_counts(full):
    _, result, rows, _ = full
    assert (result.n_rows, result.n_ok, result.n_failed, result.n_reused) == (7, 6, 1, 0)
    assert len(rows) == 7
    assert repr(result).endswith("rows=7, ok=6, failed=1, reused=0)")
    assert result.left_out == ((".txt", 1),)


@pytest.mark.parametrize("name", MADE)
def test_row_agrees_with_the_single_calls(full, meshes, name):
    row = full[2][f"{name}.ply"]
    mesh = as_mesh(next(meshes.rglob(f"{name}.ply")))
    score, facts = score_of(mesh), mesh.facts()
    assert row["status"] == "ok"
    assert row["reason"] == ""
    assert row["verdict"] == score.verdict
    assert row["verdict_reason"] == score.reason
    assert row["dimension"] == score.dimension
    assert row["ratio"] == score.ratio
    assert (row["volume"], row["volume_lower"], row["volume_upper"]) == (score.volume, *score.volume_bounds)
    assert (row["violation_lower"], row["violation_upper"]) == score.violation_bounds
    assert [row[f"star_center_{k}"] for k in "xyz"] == score.star_center.tolist()
    assert [row[f"center_{k}"] for k in "xyz"] == ([None] * 3 if score.center is None else score.center.tolist())
    assert row["certificate_kind"] == score.certificate.kind
    assert row["certificate_facets"] == list(score.certificate.facet_ids)
    assert row["certificate_verified"] is True
    assert row["notes"] == list(score.notes)
    assert (row["n_faces"], row["is_closed"], row["genus"]) == (facts.n_faces, facts.is_closed, facts.genus)
    assert row["enclosed_volume"] == (None if np.isnan(facts.volume) else facts.volume)
    profile = profile_of(mesh, tolerances=[0.0, 0.05, 0.5], depth=5)
    assert row["profile_tolerances"] == [0.0, 0.05, 0.5]
    assert row["profile_shares"] == profile.volume_share.tolist()
    assert row["visible_lower"] <= row["visible_fraction"] <= row["visible_upper"]
    assert len(row["energies"]) == 5
    assert row["seconds"] >= row["seconds_read"] + row["seconds_exact"] + row["seconds_relaxed"]
    assert json.loads(row["settings"])["depth"] == 5
    assert {"voxkernel", "numpy", "scipy", "python"} <= set(json.loads(row["versions"]))
    assert row["content_hash"] == content_hash(Item("", str(next(meshes.rglob(f"{name}.ply")))))


def test_failed_row_says_why_and_by_its_own_name(full):
    row = full[2]["broken.ply"]
    assert row["status"] == "failed"
    assert row["reason"].endswith("broken.ply' is not a readable .ply file: it has no end_header")
    assert row["verdict"] is None
    assert len(row["content_hash"]) == 64


def test_hostile_names_are_kept(full):
    assert full[2][HOSTILE]["verdict"] == "star-shaped"


def test_labels_from_folders(full, meshes):
    assert full[2]["cube.ply"]["label"] == "solids"
    assert full[2]["field.ply"]["label"] == "fields"
    assert full[2]["broken.ply"]["label"] == meshes.name


def test_pictures(full):
    from PIL import Image

    run, _, rows, _ = full
    for name in MADE:
        with Image.open(run / rows[f"{name}.ply"]["thumbnail"]) as picture:
            assert picture.size == (240, 180)
            assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 50
    # The first three by name: the hostile one, broken.ply, fields/field.ply.
    assert {name for name, row in rows.items() if row["view"]} == {HOSTILE, "field.ply"}
    with np.load(run / rows[HOSTILE]["view"]) as view:
        assert view["vertices"].shape == (8, 3)
        assert view["faces"].shape == (12, 3)
        assert view["kernel_faces"].shape == (12, 3)
        assert view["vertices"].dtype == view["kernel_vertices"].dtype == np.float32


def test_csv_beside_the_table(full):
    run, _, rows, _ = full
    with open(run / "rows.csv", newline="", encoding="utf-8") as stream:
        listed = list(csv.DictReader(stream))
    assert list(listed[0]) == list(run_table.COLUMNS)
    assert {os.path.basename(r["file"]) for r in listed} == set(rows)
    cube = next(r for r in listed if r["file"].endswith("cube.ply"))
    assert float(cube["ratio"]) == 1.0
    assert json.loads(cube["profile_tolerances"]) == [0.0, 0.05, 0.5]


FORMULAS = [f"{start}cmd|' /C calc'!A0.ply" for start in "=+-@\t\r\n＝"]


def test_no_cell_of_the_csv_is_a_formula(tmp_path):
    """The rule of OWASP: an apostrophe before what begins like a formula. Numbers and Parquet stay as they are."""
    rows = [{"file": name, "label": "'=x", "reason": "-", "status": "ok", "ratio": -0.5} for name in FORMULAS]
    fs, path = run_table.open_run(str(tmp_path))
    run_table.write_part(fs, path, rows)
    table = run_table.read_rows(str(tmp_path))
    run_table.write_csv(fs, path, [table])
    with open(tmp_path / "rows.csv", newline="", encoding="utf-8") as stream:
        listed = list(csv.DictReader(stream))
    assert {row["file"] for row in listed} == {"'" + name for name in FORMULAS}
    assert {row["reason"] for row in listed} == {"'-"}
    assert {row["label"] for row in listed} == {"''=x"}  # one apostrophe less is the text, always
    assert {float(row["ratio"]) for row in listed} == {-0.5}
    assert set(table.column("file").to_pylist()) == set(FORMULAS)


def test_texts_that_are_no_formulas_are_left():
    for text in ("", "a=b", "'quoted'", "1-2", " =1", "<b>", "0"):
        assert run_table.defused(text) == text


def test_labels_of_a_table_written_by_this_library(tmp_path):
    file = tmp_path / "rows.csv"
    file.write_text("file,label\n'=1.ply,one\n'+2,two\n")
    labels = read_labels(file)
    assert [labels.of(name)[0] for name in ("in/=1.ply", "+2.ply", "2.ply")] == ["one", "two", None]


def test_settings_beside_the_table(full):
    told = run_table.read_settings(str(full[0]))
    assert told["left_out"] == {".txt": 1}
    assert told["settings"]["energies"] == 4
    assert told["n_meshes"] == 7


def test_progress_ends_complete(full):
    seen = full[3]
    assert all(isinstance(s, EvaluationProgress) for s in seen)
    assert (seen[0].done, seen[-1].done, seen[-1].failed, seen[-1].total) == (0, 7, 1, 7)
    assert [s.done for s in seen] == sorted(s.done for s in seen)
    assert str(seen[-1]).startswith("7 of 7 done, 1 failed")


def test_large_surfaces_are_simplified_for_views():
    from voxkernel.evaluation.row_pictures import _clustered, pictures

    mesh = as_mesh(shapes.icosphere(5))  # 20,480 faces
    files = pictures(mesh, score_of(mesh), EvaluateSettings(), name="a", view=True)
    with np.load(io.BytesIO(files["views/a.npz"])) as view:
        assert 1000 < len(view["faces"]) <= 5000
        assert 100 < len(view["kernel_faces"]) <= 5000
        assert np.linalg.norm(view["vertices"], axis=1) == pytest.approx(1.0, abs=0.05)
    vertices, faces = _clustered(mesh.vertices, mesh.faces, 500)
    assert 100 < len(faces) <= 500
    assert faces.max() < len(vertices)


# ---------------------------------------------------------------- resume


def test_resume(meshes, tmp_path):
    work, run = tmp_path / "meshes", tmp_path / "run"
    shutil.copytree(meshes / "solids", work)
    shutil.copy(meshes / "broken.ply", work / "broken.ply")
    first = evaluate(work, output=run, settings=ONE)
    assert (first.n_ok, first.n_failed, first.n_reused) == (4, 1, 0)
    before = rows_of(run)

    again = evaluate(work, output=run, settings=ONE)
    assert again.n_reused == 5
    assert rows_of(run) == before

    # A changed file, a new one and a failed one: only the first two are computed.
    shutil.copy(work / "torus.ply", work / "cube.ply")
    shutil.copy(work / "star.ply", work / "new.ply")
    changed = evaluate(work, output=run, settings=EvaluateSettings(workers=1, views=1), labels="folders")
    after = rows_of(run)
    assert (changed.n_ok, changed.n_failed, changed.n_reused) == (5, 1, 4)
    assert after["cube.ply"]["verdict"] == "not star-shaped"
    for name in ("flat.ply", "torus.ply", "star.ply", "broken.ply"):
        assert after[name] == before[name] | {"label": "meshes"}
    assert len(list((run / "rows").iterdir())) == 1

    retried = evaluate(work / "broken.ply", output=run, settings=EvaluateSettings(workers=1, retry_failed=True))
    assert (retried.n_failed, retried.n_reused) == (1, 0)
    assert rows_of(run)["broken.ply"]["finished"] > after["broken.ply"]["finished"]

    # Repaired on disk, and asked for: a view for what has none.
    (work / "broken.ply").write_bytes((work / "star.ply").read_bytes())
    repaired = evaluate(work, output=run, settings=EvaluateSettings(workers=1, views=2))
    assert (repaired.n_ok, repaired.n_failed, repaired.n_reused) == (6, 0, 4)
    rows = run_table.read_rows(str(run)).to_pylist()
    assert [bool(row["view"]) for row in rows] == [True, True, False, False, False, False]


def test_settings_that_decide_rows_are_told_apart():
    base = settings_hash(EvaluateSettings())
    same = EvaluateSettings(timeout=1, workers=7, views=9, csv=True, memory_limit="3GB", retry_failed=True, threads=2)
    assert settings_hash(same) == base
    others = [
        {"domain": "hull"}, {"gap": 1e-3}, {"depth": 5}, {"visible": True}, {"tolerances": PROFILE_TOLERANCES},
        {"energies": 8}, {"thumbnails": True},
    ]  # fmt: skip
    assert len({base, *(settings_hash(EvaluateSettings(**options)) for options in others)}) == 8


def test_pictures_that_nobody_asked_for_are_of_small_runs(monkeypatch, meshes):
    left_open = EvaluateSettings(thumbnails=None)
    assert settings_hash(left_open) == settings_hash(EvaluateSettings())
    assert for_files(left_open, FEW).thumbnails is None
    assert for_files(left_open, FEW + 1).thumbnails is False
    assert for_files(EvaluateSettings(thumbnails=True), FEW + 1).thumbnails is True
    cube = str(meshes / "solids" / "cube.ply")
    assert analyse(cube, left_open, name="x").rows[0]["thumbnail"] == "thumbnails/x.png"
    monkeypatch.setattr("voxkernel.evaluation.settings.find_spec", lambda _: None)
    assert analyse(cube, for_files(left_open, 1), name="x").rows[0]["thumbnail"] == ""


# ---------------------------------------------------------------- parts of the table


def row(file, **more):
    return {"file": file, "status": "ok", "content_hash": "c", "settings_hash": "s", **more}


@pytest.mark.parametrize("url", ["memory://parts", "local"])
def test_latest_row_counts(url, tmp_path):
    run = str(tmp_path) if url == "local" else url
    fs, path = run_table.open_run(run)
    run_table.write_part(fs, path, [row("b", ratio=0.1), row("a", cell=1), row("a", cell=0)])
    last = run_table.write_part(fs, path, [row("b", ratio=0.2), row("a/c")])
    early = run_table.write_table_part(
        fs, path, run_table.to_table([row("b", ratio=0.3)]), after=last.replace("part-0", "part-9")
    )
    table = run_table.read_rows(run)
    assert list(zip(table["file"].to_pylist(), table["cell"].to_pylist(), strict=True)) == [
        ("a", 0), ("a", 1), ("a/c", None), ("b", None)
    ]  # fmt: skip
    assert table["ratio"].to_pylist()[-1] == 0.3
    assert "part-9" in early  # also with a clock that was set back
    run_table.remove_parts(fs, [early])
    assert run_table.read_rows(run)["ratio"].to_pylist()[-1] == 0.2


def test_new_content_replaces_all_cells(tmp_path):
    fs, path = run_table.open_run(str(tmp_path))
    run_table.write_part(fs, path, [row("a", cell=k) for k in range(5)])
    run_table.write_part(fs, path, [row("a", cell=k) | {"content_hash": "d"} for k in range(2)])
    assert run_table.read_rows(str(tmp_path))["cell"].to_pylist() == [0, 1]


def test_compaction_killed_between_writing_and_deleting(tmp_path, monkeypatch):
    from voxkernel.evaluation.store import RunStore

    fs, path = run_table.open_run(str(tmp_path))
    for k in range(5):
        run_table.write_part(fs, path, [row(f"{k}", ratio=k / 8)])
    before = run_table.read_rows(str(tmp_path))
    monkeypatch.setattr(run_table, "remove_parts", lambda fs, names: None)
    RunStore(str(tmp_path)).compact()
    assert len(run_table.part_names(fs, path)) == 6
    assert run_table.read_rows(str(tmp_path)) == before


def test_many_parts_become_few(tmp_path, monkeypatch):
    from voxkernel.evaluation import store as store_module
    from voxkernel.evaluation.worker import Outcome

    monkeypatch.setattr(store_module, "_PARTS", 4)
    store = store_module.RunStore(str(tmp_path))
    for k in range(70):
        store.add(Outcome(f"{k:02}", (row(f"{k:02}"),)))
        assert store.n_stored == k  # what waits is not done
        store.flush()
    assert len(run_table.part_names(store.fs, store.path)) <= 12
    assert run_table.read_rows(str(tmp_path))["file"].to_pylist() == [f"{k:02}" for k in range(70)]
    store.compact()
    (name,) = run_table.part_names(store.fs, store.path)
    assert pq.read_schema(name).equals(run_table.schema())


def test_unfinished_files_are_not_parts(tmp_path):
    fs, path = run_table.open_run(str(tmp_path))
    name = run_table.write_part(fs, path, [row("a")])
    (tmp_path / "rows" / ".0123.tmp").write_bytes(b"half")
    assert run_table.part_names(fs, path) == [name]


# ---------------------------------------------------------------- inputs


def test_inputs(meshes, tmp_path, monkeypatch):
    monkeypatch.chdir(meshes)
    names = [item.name for item in find_items(["."])]
    assert names == sorted(
        [HOSTILE, "broken.ply", "fields/field.ply", *(f"solids/{n}.ply" for n in MADE if n != "field")]
    )
    assert len(find_items(["broken.ply", "./broken.ply", "fields/..//broken.ply", "fields/../broken.ply"])) == 2
    assert [i.name for i in find_items([f"file://{meshes}/fields"])] == [f"file://{meshes}/fields/field.ply"]
    assert [i.name for i in find_items(["solids/*.ply", "solids/cube.ply"])] == [
        f"solids/{n}.ply" for n in sorted(MADE) if n != "field"
    ]  # fmt: skip
    assert [i.name for i in find_items(["**/f*.ply"])] == ["fields/field.ply", "solids/flat.ply"]
    assert [i.name for i in find_items(["missing.ply", "notes.txt"])] == ["missing.ply", "notes.txt"]
    assert find_items(["*.off"]) == []


def test_names_that_are_no_text(tmp_path):
    path = os.fsencode(tmp_path) + b"/\xff\xfe.ply"
    try:
        as_mesh(shapes.cube()).write(os.fsdecode(path))
    except OSError:
        pytest.skip("file system with names in Unicode only")
    (item,) = find_items([tmp_path])
    assert item.name.endswith("/\\xff\\xfe.ply")
    assert len(content_hash(item)) == 64


def test_names_that_look_like_chains_of_file_systems(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = ["a::b.ply", "d/simplecache::x.ply"]
    (tmp_path / "d").mkdir()
    for name in names:
        try:
            as_mesh(shapes.cube()).write(name)
        except OSError:
            pytest.skip("file system without such names")
    items = find_items(["a::b.ply", "d"])
    assert [i.name for i in items] == names
    assert {len(content_hash(i)) for i in items} == {64}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system")
def test_folders_with_links_in_circles_and_pipes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d" / "e").mkdir(parents=True)
    as_mesh(shapes.cube()).write("d/e/x.ply")
    for link, target in (("d/up", "."), ("d/e/top", ".."), ("d/self", "self"), ("d/again", "e"), ("d/none.ply", "no")):
        os.symlink(target, link)
    os.mkfifo("d/pipe.ply")
    for given, start in (("d", ""), (f"file://{tmp_path}/d", f"file://{tmp_path}/")):
        items = find_items([given])
        names = ["d/again/x.ply", "d/e/x.ply", "d/none.ply", "d/pipe.ply"]
        assert [i.name for i in items] == [start + name for name in names]
        assert [len(content_hash(i)) for i in items] == [64, 64, 0, 0]  # a pipe is not waited for


@pytest.mark.parametrize("size", [0, 1, 90, 1 << 20])
def test_content_is_hashed_whole(tmp_path, size):
    data = bytes(size)
    (tmp_path / "x.ply").write_bytes(data)
    assert content_hash(Item("", str(tmp_path / "x.ply"))) == hashlib.sha256(data).hexdigest()
    os.symlink("/dev/zero", tmp_path / "zero.ply")  # which never ends
    assert content_hash(Item("", str(tmp_path / "zero.ply"))) == ""


@pytest.mark.parametrize("quick", [0.0, 1e9])
def test_files_that_changed_are_found_by_one_thread_or_several(tmp_path, monkeypatch, quick):
    """Changed, gone, or there now: each is fresh, at any place of the batches that are hashed."""
    monkeypatch.setattr(resume, "_QUICK", quick)
    monkeypatch.setattr(resume, "_AT_ONCE", 3)
    own = {"status": "ok", "settings_hash": settings_hash(EvaluateSettings())}
    rows: list[dict[str, str]] = []
    for k in range(100):
        file = tmp_path / f"{k:03}.ply"
        file.write_text(f"{k}")
        rows.append({"file": str(file), "content_hash": content_hash(Item("", str(file))), **own})
    fs, path = run_table.open_run(str(tmp_path / "run"))
    run_table.write_part(fs, path, rows[:-1])
    changed = {0, 1, 4, 50, 98}
    for k in changed:
        (tmp_path / f"{k:03}.ply").write_text("other")
    items = [Item(row["file"], row["file"]) for row in rows]
    with closing(open_index(fs, path, resume.COLUMNS)) as index:
        found = resume.resumed(items, index, EvaluateSettings())
    assert [item.name for item in found.fresh] == [rows[k]["file"] for k in sorted(changed | {99})]
    assert found.n_reused == 94


@pytest.fixture
def stamped(tmp_path, monkeypatch):
    """Five files that changed some time ago, the rows of a worker for them, and which are read when resumed."""
    monkeypatch.setattr(file_stamp, "_JUST_NOW", -(10**12))
    files = [tmp_path / f"{k}.ply" for k in range(5)]
    for k, file in enumerate(files):
        as_mesh(shapes.cube()).write(file)
        os.utime(file, ns=(0, k))
    outcomes = run_batch([Item(str(file), str(file)) for file in files], EvaluateSettings(), analyse)
    read: list[str] = []

    def reading(item):
        read.append(os.path.basename(item.url))
        return content_hash(item)

    monkeypatch.setattr(resume, "content_hash", reading)
    return files, [dict(row) for outcome in outcomes for row in outcome.rows], read


def resumed_run(tmp_path, rows, **settings):
    fs, path = run_table.open_run(str(tmp_path / "run"))
    run_table.write_part(fs, path, rows)
    items = [Item(row["file"], row["file"]) for row in rows]
    with closing(open_index(fs, path, resume.COLUMNS)) as index:
        found = resume.resumed(items, index, EvaluateSettings(**settings), LaterStamps(fs, path))
    return [os.path.basename(item.name) for item in found.fresh]


POSIX = pytest.mark.skipif(os.name != "posix", reason="there is no time of change")


@POSIX
def test_files_that_are_as_they_were_are_not_read(tmp_path, stamped):
    """Touched ones are hashed and kept; of one size and the old time, and replaced by another file: computed."""
    files, rows, read = stamped
    assert rows[1]["file_size"] == files[1].stat().st_size
    assert (rows[1]["file_modified_ns"], rows[1]["file_inode"]) == (1, files[1].stat().st_ino)
    assert resumed_run(tmp_path, rows) == []
    assert read == []
    time.sleep(0.05)  # a tick of the file system's clock
    os.utime(files[1])
    data = files[2].read_bytes()
    files[2].write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    os.utime(files[2], ns=(0, 2))
    shutil.copy2(files[2], tmp_path / "other")
    os.replace(tmp_path / "other", files[3])
    files[4].unlink()
    assert resumed_run(tmp_path, rows) == ["2.ply", "3.ply", "4.ply"]
    assert sorted(read) == ["1.ply", "2.ply", "3.ply", "4.ply"]


@POSIX
@pytest.mark.parametrize("how", ["copied", "old rows"])
def test_files_found_equal_by_hash_are_hashed_once(tmp_path, stamped, how):
    """Copied files and rows without stamps: the stamps of now are kept beside the rows, until a file changes."""
    files, rows, read = stamped
    if how == "old rows":
        rows = [{k: v for k, v in row.items() if k not in file_stamp.STAMP_COLUMNS} for row in rows]
    else:
        for file in files:
            shutil.copy(file, tmp_path / "other")
            os.replace(tmp_path / "other", file)
    assert resumed_run(tmp_path, rows) == []
    assert sorted(read) == [file.name for file in files]
    read.clear()
    before = (tmp_path / "run" / "stamps.parquet").stat().st_mtime_ns
    assert resumed_run(tmp_path, rows) == []
    assert read == []
    assert (tmp_path / "run" / "stamps.parquet").stat().st_mtime_ns == before  # nothing new, nothing written
    time.sleep(0.05)
    os.utime(files[1])  # as it was
    data = files[2].read_bytes()
    files[2].write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert resumed_run(tmp_path, rows) == ["2.ply"]
    assert read == ["1.ply", "2.ply"]
    files[2].write_bytes(data)
    read.clear()
    assert resumed_run(tmp_path, rows) == []
    assert read == ["2.ply"]
    rows[3]["content_hash"] = "another"  # of a file that was computed again: its stamp of before says nothing
    read.clear()
    assert resumed_run(tmp_path, rows) == ["3.ply"]
    assert read == ["3.ply"]
    (tmp_path / "run" / "stamps.parquet").write_bytes(b"broken")
    rows[3]["content_hash"] = rows[0]["content_hash"]
    read.clear()
    assert resumed_run(tmp_path, rows) == []
    assert len(read) == 5


@POSIX
@pytest.mark.parametrize("name", ["rehash", "old"])
def test_every_file_is_read_where_asked_and_where_rows_have_no_stamp(tmp_path, stamped, name):
    files, rows, read = stamped
    if name == "old":
        rows = [{k: v for k, v in row.items() if k not in file_stamp.STAMP_COLUMNS} for row in rows]
    assert resumed_run(tmp_path, rows, rehash=name == "rehash") == []
    assert sorted(read) == [file.name for file in files]


def test_what_has_no_stamp(tmp_path, monkeypatch):
    file = tmp_path / "x.ply"
    file.write_text("x")
    changed = file.stat().st_ctime_ns
    monkeypatch.setattr(file_stamp.time, "time_ns", lambda: changed + file_stamp._JUST_NOW - 1)
    assert file_stamp.stamp_of(str(file)) is None  # it may change again within a tick
    monkeypatch.setattr(file_stamp.time, "time_ns", lambda: changed + file_stamp._JUST_NOW)
    assert (file_stamp.stamp_of(str(file)) is not None) == (os.name == "posix")
    others = (str(tmp_path), f"file://{file}", f"{file}::a", "memory://x.ply", str(tmp_path / "none.ply"), "a\0")
    assert [file_stamp.stamp_of(path) for path in others] == [None] * 6
    monkeypatch.setattr(file_stamp, "_TELLS_CHANGE", False)
    assert file_stamp.stamp_of(str(file)) is None


def test_a_folder_that_cannot_be_listed_is_an_item(tmp_path, monkeypatch):
    (tmp_path / "locked").mkdir()
    as_mesh(shapes.cube()).write(tmp_path / "x.ply")
    scandir = os.scandir

    def refusing(path):
        if str(path).endswith("locked"):
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refusing)
    assert [os.path.basename(i.name) for i in find_items([tmp_path])] == ["locked", "x.ply"]


def test_labels_of_a_table_relative_to_a_folder_above(tmp_path, monkeypatch):
    file = tmp_path / "labels.csv"
    file.write_text("label,file\none,a/x.ply\ntwo,b/x.ply\nlong,data/b/x.ply\n")
    labels = read_labels(file)
    names = ("data/a/x.ply", "/far/a/x.ply", "b/x.ply", "some/data/b/x.ply", "c/x.ply", "aa/x.ply")
    assert [labels.of(n)[0] for n in names] == ["one", "one", "two", "long", None, None]
    (tmp_path / "in").mkdir()
    monkeypatch.chdir(tmp_path / "in")
    assert Labels(None).of("../x.ply") == (tmp_path.name, None)
    file.write_bytes(b"file,label\n\xe9,x\n")
    with pytest.raises(ValueError, match="`labels` must be text in UTF-8; got"):
        read_labels(file)
    file.write_text("label,file\none,x.ply\nno-file\n")
    with pytest.raises(ValueError, match=r"`labels` must have a file and a label in every row; got '.*', line 3"):
        read_labels(file)


def test_a_file_system_that_is_not_there_is_bad_input(monkeypatch, tmp_path, command):
    def missing(url):
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr(fsspec.core, "url_to_fs", missing)
    code, _, messages = command("evaluate", "s3://bucket/x", "-o", tmp_path / "run")
    assert code == 2
    assert "'s3://bucket/x' cannot be opened: Install s3fs" in messages
    with pytest.raises(ValueError, match="'s3://bucket/run' cannot be opened: Install s3fs"):
        run_table.open_run("s3://bucket/run")


def test_a_damaged_part_is_named(tmp_path):
    (tmp_path / "rows").mkdir()
    (tmp_path / "rows" / "part-1.parquet").write_bytes(b"PAR1")
    with pytest.raises(ValueError, match=r"part-1\.parquet' must be a part of a run; got"):
        run_table.read_rows(str(tmp_path))
    rows = [{"file": "a.ply", "status": "ok"}, {"status": "ok"}]
    pq.write_table(run_table.to_table(rows), tmp_path / "rows" / "part-1.parquet")
    with pytest.raises(ValueError, match=r"part-1\.parquet' must be a part of a run; got 1 rows that name no file"):
        run_table.read_rows(str(tmp_path))
    table = run_table.to_table(rows[:1])
    pq.write_table(table.append_column("file", table["file"]), tmp_path / "rows" / "part-1.parquet")
    with pytest.raises(ValueError, match=r"part-1\.parquet' must be a part of a run; got 2 columns named 'file'"):
        run_table.read_rows(str(tmp_path))


def test_files_left_out_are_counted_by_suffix(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.ply", "b.TXT", "c.txt", "LICENSE", "d/e.jpg", "d/f.off", "run/rows/part-1.parquet", ".hidden.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")

    def counted(*paths, run="run"):
        others = set()
        find_items(paths, others)
        return count_suffixes(others, run=run)

    every = ((".txt", 2), ("", 1), (".jpg", 1))
    assert counted(".") == counted(tmp_path) == counted(".", "./d") == every
    assert counted("**/*") == counted(f"file://{tmp_path}", run=f"file://{tmp_path}/run") == every
    assert counted(".", run="elsewhere") == (*every, (".parquet", 1))
    assert counted(".", "c.txt") == (("", 1), (".jpg", 1), (".txt", 1))  # a file that is named is taken
    assert counted("c.txt") == counted("d/*.off") == ()
    fs = fsspec.filesystem("memory")
    for name in ("a.ply", "b.txt", "d/c.txt", "run/rows/x.parquet"):
        fs.pipe_file(f"/left_out/{name}", b"")
    assert counted("memory://left_out", run="memory://left_out/run") == ((".txt", 2),)
    assert counted("memory://left_out/*") == ((".txt", 1),)


def test_labels_by_path_name_and_stem(tmp_path):
    file = tmp_path / "labels.csv"
    file.write_text("\ufefffile,label,other\na/x.ply,path,1\ny.ply,name,2\nz,stem,3\nnobody,none,4\n")
    labels = read_labels(file)
    assert [labels.of(n)[0] for n in ("a/x.ply", "b/x.ply", "b/y.ply", "c/z.off")] == ["path", None, "name", "stem"]
    made, unmatched = labelled([Item("a/x.ply", ""), Item("z.ply", "")], labels, 0)
    assert [i.label for i in made] == ["path", "stem"]
    assert unmatched == ["nobody", "y.ply"]
    assert Labels(None).of("x.ply") == (None, None)
    file.write_text("name,kind\n")
    with pytest.raises(ValueError, match="`labels` must have columns file and label; got"):
        read_labels(file)


def test_remote(meshes, tmp_path):
    fs = fsspec.filesystem("memory")
    for name in ("solids/cube.ply", "solids/torus.ply", "broken.ply"):
        fs.pipe_file(f"/in/{name}", (meshes / name).read_bytes())
    settings = EvaluateSettings(workers=1, views=1, csv=True)
    result = evaluate("memory://in", output="memory://out/run", settings=settings, labels="folders")
    rows = rows_of("memory://out/run")
    assert (result.n_ok, result.n_failed) == (2, 1)
    assert rows["cube.ply"]["file"] == "memory:///in/solids/cube.ply"
    assert rows["cube.ply"]["label"] == "solids"
    assert rows["torus.ply"]["verdict"] == "not star-shaped"
    assert "/in/broken.ply' is not a readable" in rows["broken.ply"]["reason"]
    assert fs.exists("/out/run/rows.csv")
    again = evaluate(["memory://in/**/*.ply", "memory://in/missing.ply"], output="memory://out/run", settings=settings)
    assert (again.n_reused, again.n_failed) == (3, 2)
    assert "missing.ply" in rows_of("memory://out/run")["missing.ply"]["reason"]


def test_polyhedral_meshes_give_a_row_per_cell(tmp_path):
    folder = tmp_path / "meshes" / "cells"
    folder.mkdir(parents=True)
    as_mesh(shapes.cube()).write(folder / "0.off")
    as_mesh(shapes.l_prism()).write(folder / "1.off")
    as_mesh(shapes.star_prism()).write(tmp_path / "meshes" / "a.ply")
    result = evaluate(tmp_path / "meshes", output=tmp_path / "run", settings=ONE)
    assert (result.n_rows, result.n_ok, result.n_failed) == (3, 2, 0)
    _, cube, prism = result.table().to_pylist()
    assert (cube["cell"], cube["verdict"], cube["volume_share"]) == (0, "star-shaped", pytest.approx(1.0))
    assert prism["cell"] == 1
    assert prism["volume_share"] == pytest.approx(score_of(shapes.l_prism()).ratio)
    assert evaluate(tmp_path / "meshes", output=tmp_path / "run", settings=ONE).n_reused == 2


def test_a_bad_cell_fails_alone(tmp_path):
    folder = tmp_path / "some_cells"
    folder.mkdir()
    vertices, faces = shapes.cube()
    as_mesh((vertices, faces)).write(folder / "0.off")
    as_mesh((vertices, faces[:-1])).write(folder / "1.off")
    result = evaluate(folder, output=tmp_path / "run", settings=ONE)
    good, bad = result.table().to_pylist()
    assert (good["status"], bad["status"], bad["verdict"]) == ("ok", "failed", None)
    assert bad["reason"]
    assert result.n_failed == 1


# ---------------------------------------------------------------- arguments


def test_no_meshes(tmp_path):
    with pytest.raises(ValueError, match="`paths` must lead to at least one mesh; got"):
        evaluate(tmp_path, output=tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"domain": "cone"}, "`domain` must be one of"),
        ({"depth": 2}, "`depth` must be in 3..12; got 2"),
        ({"tolerances": ()}, "`tolerances` must hold at least one number; got none"),
        ({"tolerances": (0.5, 1.5)}, r"`tolerances` must be at most 1, the whole surface; got 1\.5"),
        ({"views": -1}, "`views` must be in"),
        ({"timeout": 0.0}, "`timeout` must be > 0; got 0"),
        ({"workers": 0}, "`workers` must be in 1..4096; got 0"),
        ({"threads": 0}, "`threads` must be in 1..256; got 0"),
        ({"memory_limit": "lots"}, "`memory_limit` must be bytes, or such as '4GB'; got 'lots'"),
        ({"memory_limit": 1000}, "`memory_limit` must be at least 256 MiB; got 1000"),
    ],
)
def test_settings_that_cannot_be(options, message):
    with pytest.raises(ValueError, match=message):
        EvaluateSettings(**options)


# ---------------------------------------------------------------- command


@pytest.fixture
def command(capsys):
    def run(*words):
        try:
            code = cli.main(["evaluate", *map(str, words)])
        except SystemExit as stop:
            code = stop.code
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


def test_command(meshes, tmp_path, command):
    labels = tmp_path / "labels.csv"
    labels.write_text("file,label\ncube,round\nghost.ply,?\n")
    run = tmp_path / "run"
    (tmp_path / "more").mkdir()
    for name in ("a.txt", "b.txt", "README"):
        (tmp_path / "more" / name).write_text("no mesh")
    words = (meshes / "solids", meshes / "broken.ply", tmp_path / "more", "-o", run, "--workers", 1)
    code, out, err = command(*words, "--labels", labels, "--csv")
    left_out = "3 files left out by suffix: 2 .txt, 1 without suffix"
    assert (code, out) == (1, f"{run}: 5 rows, 4 meshes ok, 1 failed; {left_out}\n")
    assert "voxkernel: 5 of 5 done, 1 failed" in err
    assert "voxkernel: no mesh for the label of 'ghost.ply'" in err
    assert (run / "rows.csv").exists()
    assert rows_of(run)["cube.ply"]["label"] == "round"
    code, out, err = command(meshes / "solids", "-o", run, "--workers", 1, "--quiet")
    assert (code, out, err) == (0, f"{run}: 4 rows, 4 meshes ok, 0 failed, 4 from an earlier run\n", "")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tolerances", "a"], "--tolerances must be numbers"),
        (["--tolerances", "0.1", "--profile"], "must not be given together"),
        (["--views", "some"], "--views"),
        (["--views", "²"], "--views must be a number"),
        (["--scheduler", "nonsense"], "--scheduler must be the address of a scheduler"),
        (["--timeout", "-1"], "--timeout must be > 0"),
        (["--scheduler", "tcp://127.0.0.1:9"], "--scheduler must be the address of a scheduler"),
        (["--threads", "0"], "--threads must be in 1..256; got 0"),
        (["--memory", "1kB"], "--memory-limit must be at least 256 MiB; got '1kB'"),
        (["--depth", "99"], "--depth must be in 3..12; got 99"),
    ],
)
def test_bad_usage(meshes, tmp_path, command, words, message, monkeypatch):
    code, out, err = command(meshes / "solids" / "cube.ply", "-o", tmp_path / "run", *words)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert message in err


def test_no_meshes_is_bad_usage(tmp_path, command):
    code, _, err = command(tmp_path / "*.ply", "-o", tmp_path / "run")
    assert code == 2
    assert "must lead to at least one mesh" in err


def test_bar_on_a_terminal(monkeypatch, capsys):
    from voxkernel.cli import progress

    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    with progress.shown(quiet=False) as show:
        show(EvaluationProgress(10, 4, 1, 0, 2.0, 3.0))
    said = capsys.readouterr()
    assert said.out == ""
    assert "1 failed" in said.err


def test_a_store_that_lets_nobody_in_is_one_line(tmp_path):
    """Its errors are of its own kinds."""

    class Closed(fsspec.AbstractFileSystem):
        protocol = "closed"

        def exists(self, path, **kwargs):
            raise RuntimeError("unable to locate\ncredentials")

        isdir = exists

    fsspec.register_implementation("closed", Closed, clobber=True)
    told = "'closed://a/b' cannot be opened: unable to locate credentials"
    with pytest.raises(ValueError, match=told):
        evaluate("closed://a/b", output=tmp_path / "run")
    with pytest.raises(ValueError, match=told):
        write_report(tmp_path / "report.html", "closed://a/b")
