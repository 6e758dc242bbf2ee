"""Label images in runs, in reports and on the command line: one row per object, counted apart."""

import json
import time
from dataclasses import replace

import label_shapes
import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.cli.failures import show_failures
from voxkernel.cli.main import main
from voxkernel.evaluation import EvaluateSettings, resume
from voxkernel.evaluation.inputs import Item, content_hash, find_items
from voxkernel.evaluation.label_parts import in_parts, n_units
from voxkernel.report import write_report
from voxkernel.run_table import read_rows

RAYS = (32, 96)


def scene():
    """A ball, a C, a shell and two fragments, a bar that 96 rays do not reach."""
    image = np.zeros((80, 20, 90), np.uint16)
    image[1:16, 1:16, 1:16] = label_shapes.ball(15)
    image[1:5, 1:16, 20:35] = 2 * label_shapes.c_shape()
    image[1:14, 1:14, 40:53] = 3 * label_shapes.shell()
    image[20:23, 2:5, 2:5] = image[20:23, 2:5, 8:12] = 7
    image[30:33, 2:5, 2:62] = 900
    return image


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("labels")
    image = scene()
    np.savez(folder / "scene.npz", labels=image, spacing=(1.0, 1.0, 1.0))
    np.save(folder / "broken.npy", image + 0.5)
    voxkernel.as_mesh(shapes.cube()).write(folder / "cube.ply")
    settings = EvaluateSettings(
        spacing=(1, 1, 1), n_rays=RAYS, label_images=True, thumbnails=True, workers=1, csv=True, depth=3
    )
    return folder, voxkernel.evaluate([folder], output=folder / "run", settings=settings), settings


def test_one_row_per_object(run):
    folder, result, settings = run
    assert (result.n_rows, result.n_ok, result.n_failed) == (7, 2, 1)
    rows = result.table().to_pylist()
    assert [row["kind"] for row in rows] == [None, "surface", *["label"] * 5]
    assert "must be integers; got 0.5" in rows[0]["reason"]
    objects = rows[2:]
    stars = voxkernel.label_stars(scene(), spacing=(1, 1, 1), n_rays=RAYS)
    assert [row["object"] for row in objects] == stars.label.tolist() == [1, 2, 3, 7, 900]
    assert [row["shortfall"] for row in objects] == ["", "hidden part", "hole", "fragment", "elongated"]
    assert [row["shortfall_detail"] for row in objects] == list(stars.detail)
    assert [(row["causes"] or [""])[0] for row in objects] == list(stars.reason)
    assert [row["overlap"] for row in objects] == stars.iou.max(axis=1).tolist()  # 96 are the most
    assert objects[-1]["shortfall_detail"].startswith("too elongated for 96 rays")  # though it is star-shaped
    hidden = "% of its voxels are hidden from the best one"
    assert [row["verdict_reason"] for row in objects] == [
        "" if seen == 1.0 else f"{100 * (1 - seen):.2f}{hidden}" for seen in stars.visible.tolist()
    ]
    assert [row["voxels_seen"] for row in objects] == stars.visible.tolist()
    assert [row["iou"] for row in objects] == stars.iou.tolist()
    assert [row["center_index"] for row in objects] == stars.center.tolist()
    assert {row["n_objects"] for row in objects} == {5}
    assert [bool(row["thumbnail"]) for row in objects] == [False, True, True, True, True]
    for row in objects[1:]:
        assert (folder / "run" / row["thumbnail"]).read_bytes().startswith(b"\x89PNG")
    again = voxkernel.evaluate([folder], output=folder / "run", settings=settings)
    assert (again.n_rows, again.n_reused) == (7, 3)


def test_a_report_counts_objects_apart(run, tmp_path):
    folder, _, _ = run
    summary = write_report(tmp_path / "page.html", folder / "run")
    objects = summary["objects"]
    assert summary["n_objects"] == objects["n"] == 5
    assert (objects["n_star"], objects["n_not_star"], objects["n_fine"]) == (2, 3, 1)
    assert objects["shortfalls"] == {"elongated": 1, "fragment": 1, "hidden part": 1, "hole": 1}
    assert objects["n_rays"] == [32, 96]
    assert all(a <= b <= c for a, b, c in zip(*(objects["overlap"][q] for q in ("q25", "median", "q75")), strict=True))
    page = (tmp_path / "page.html").read_text()
    for words in (
        "2 of 5 objects of label images are seen whole", "Why objects fall short", "The worst objects",
        "Overlap against rays", "Some point sees the whole surface of 1 of the 1 surfaces",
    ):  # fmt: skip
        assert words in page
    assert write_report(tmp_path / "page.md", folder / "run")["objects"] == objects
    assert "5 objects of label images" in (tmp_path / "page.md").read_text()


def test_captions_do_not_round_up_to_all(tmp_path):
    image = np.zeros((14, 11, 82), np.uint8)
    image[4:13, 1:10, 1:81] = image[3, 5, 40] = image[2, 5, 39:42] = 1
    np.savez(tmp_path / "rod.npz", labels=image, spacing=(1.0, 1.0, 1.0))
    settings = EvaluateSettings(n_rays=RAYS, thumbnails=True, workers=1)
    voxkernel.evaluate(tmp_path / "rod.npz", output=tmp_path / "run", settings=settings)
    summary = write_report(tmp_path / "page.html", tmp_path / "run")
    assert summary["objects"]["causes"] == {"elongated": 1, "hidden part": 1}
    assert summary["objects"]["shortfalls"] == {"elongated": 1}
    page = (tmp_path / "page.html").read_text()
    assert "&gt; 99.9 % seen, elongated" in page
    assert "100.0%" not in page


def test_a_large_image_is_divided(tmp_path):
    image = np.zeros((3, 45, 45), np.uint16)
    for k, (j, i) in enumerate(np.ndindex(22, 22), 1):
        image[1, 2 * j + 1, 2 * i + 1] = k
    np.save(tmp_path / "many.npy", image)
    settings = EvaluateSettings(spacing=(1, 1, 1), n_rays=(32,), workers=1)
    (item,) = in_parts([Item("many.npy", str(tmp_path / "many.npy"))], settings)
    assert item.group.ids.tolist() == list(range(1, 485))
    assert item.group.n_objects == n_units([item]) == 484
    assert item.known_hash == content_hash(item)
    (rest,) = in_parts([replace(item, group=None, finished="then", done=frozenset(range(3, 480)))], settings)
    assert (rest.group.ids.tolist(), rest.finished) == ([1, 2, 480, 481, 482, 483, 484], "then")
    assert in_parts([replace(item, url="s3://bucket/many.npy", group=None)], settings)[0].group is None
    result = voxkernel.evaluate(tmp_path / "many.npy", output=tmp_path / "run", settings=settings)
    assert (result.n_rows, result.n_ok) == (484, 1)
    assert result.table().column("object").to_pylist() == list(range(1, 485))
    assert voxkernel.evaluate(tmp_path / "many.npy", output=tmp_path / "run", settings=settings).n_reused == 1


def test_images_of_folders_are_taken_when_asked_for(tmp_path):
    np.save(tmp_path / "a.npy", scene())
    (tmp_path / "b.zarr" / "c").mkdir(parents=True)
    (tmp_path / "b.zarr" / "c" / "0").write_text("x")
    left_out = set()
    assert find_items([tmp_path], left_out) == []
    assert len(left_out) == 2
    assert [item.url.rsplit("/")[-1] for item in find_items([tmp_path], label_images=True)] == ["a.npy", "b.zarr"]
    assert len(content_hash(Item("b", str(tmp_path / "b.zarr")))) == 64
    assert len(content_hash(Item("a", f"{tmp_path}/a.npy::x"))) == 64


def test_the_command_says_how_images_are_taken(tmp_path, capsys):
    (tmp_path / "in").mkdir()
    voxkernel.as_mesh(shapes.cube()).write(tmp_path / "in" / "cube.ply")
    (tmp_path / "in" / "notes.txt").write_text("x")
    words = ["evaluate", str(tmp_path / "in"), "-o", str(tmp_path / "run"), "--workers", "1", "--no-thumbnails"]
    hint = "voxkernel: --label-images takes label images of folders and globs, too\n"
    assert main(words) == 0
    assert hint not in capsys.readouterr().err
    np.save(tmp_path / "in" / "a.npy", scene())
    assert main(words) == 0
    said = capsys.readouterr()
    assert hint in said.err
    assert "2 files left out by suffix: 1 .npy, 1 .txt" in said.out


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("scene.npy", scene())
    words = ["labels", "scene.npy", "--spacing", "1,1,1", "-o", "out", "--rays", "32,96", "--workers", "1", "-q"]
    assert main([*words, "--no-pictures", "--map", "seen.npz"]) == 0
    said = capsys.readouterr()
    assert said.out == "out: 5 objects, 2 seen whole from one voxel, 1 elongated, 1 fragment, 1 hidden part, 1 hole\n"
    assert said.err == ""
    assert json.loads((tmp_path / "out" / "settings.json").read_text())["settings"]["spacing"] == [1.0, 1.0, 1.0]
    assert (tmp_path / "out" / "report.html").exists()
    painted = voxkernel.read_labels("seen.npz").to_array()
    assert (painted == 3).sum() == 5
    assert main(["labels", "scene.npy", "-o", "other", "--workers", "1", "-q"]) == 1
    assert "`spacing` must be given" in read_rows("other")["reason"][0].as_py()
    for wrong, line in (
        (["--spacing", "1,x"], "--spacing must be numbers with commas between; got '1,x' ("),
        (["--rays", "32,9.5"], "--rays must be integers with commas between; got '32,9.5' ("),
        (["--spacing", "1,0,1"], "--spacing must be > 0; got 0"),
        (["--rays", "2"], "--rays must be in 4..4096; got 2"),
    ):
        assert main(["labels", "scene.npy", "-o", "out", *wrong]) == 2
        assert line in capsys.readouterr().err
    for name, words in (("x.png", "--map must end in .tif, .tiff"), ("no/x.tif", "--map must be in an existing")):
        assert main(["labels", "scene.npy", "--spacing", "1,1,1", "-o", "new", "--map", name]) == 2
        assert words in capsys.readouterr().err
        assert not (tmp_path / "new").exists()  # seen before anything is computed
    np.save("b.npy", scene())
    assert main(["labels", "scene.npy", "b.npy", "-o", "out", "--map", "x.tif"]) == 2
    assert "--map must be given with one image; got 2" in capsys.readouterr().err


def test_an_image_without_objects_is_an_answer(tmp_path, capsys):
    np.save(tmp_path / "empty.npy", np.zeros((4, 5, 6), np.uint8))
    assert len(voxkernel.label_stars(np.zeros((4, 5, 6), np.uint8), spacing=(1, 1, 1))) == 0
    words = ["labels", str(tmp_path / "empty.npy"), "--spacing", "1,1,1", "-o", str(tmp_path / "run"), "--workers", "1"]
    for _ in range(2):  # the second time the run is there
        assert main([*words, "--csv"]) == 0
        out, err = capsys.readouterr()
        assert out.splitlines() == [f"{tmp_path / 'run'}: no objects"]
        assert "failed" not in err.replace("0 failed", "")
    assert read_rows(str(tmp_path / "run")).num_rows == 0
    assert (tmp_path / "run" / "rows.csv").read_text().count("\n") <= 1
    assert (tmp_path / "run" / "report.html").exists()


def test_an_image_without_objects_is_not_read_again(tmp_path, monkeypatch):
    image, run = tmp_path / "image.npy", tmp_path / "run"
    np.save(image, np.zeros((4, 5, 6), np.uint8))
    np.save(tmp_path / "other.npy", np.ones((4, 5, 6), np.uint8))
    time.sleep(2.1)  # the stamp of a file that has just changed is not trusted
    settings = EvaluateSettings(spacing=(1, 1, 1), n_rays=(32,), workers=1, csv=True)

    def evaluated(**changes):
        return voxkernel.evaluate([image, tmp_path / "other.npy"], output=run, settings=replace(settings, **changes))

    first = evaluated()
    assert (first.n_rows, first.n_ok, first.n_reused) == (1, 2, 0)
    assert (run / "rows.csv").read_text().count("\n") == 2
    for changes in ({}, {"rehash": True}, {"views": "all"}):
        again = evaluated(**changes)
        assert (again.n_rows, again.n_ok, again.n_reused) == (1, 2, 2)
    monkeypatch.setattr(resume, "content_hash", None)  # known by its stamp, it is not even hashed
    assert evaluated().n_reused == 2
    monkeypatch.undo()
    assert evaluated(n_rays=(32, 64)).n_reused == 0
    image.touch()
    assert evaluated(n_rays=(32, 64)).n_reused == 2
    assert read_rows(str(run)).column("object").to_pylist() == [1]
    summary = write_report(tmp_path / "page.html", run)
    assert (summary["n_rows"], summary["objects"]["n"]) == (1, 1)


def test_objects_that_are_gone_leave_no_rows(tmp_path):
    settings = EvaluateSettings(spacing=(1, 1, 1), n_rays=(32,), workers=1)
    for voxel, rows in ((1, 1), (0, 0), (7, 1)):
        np.save(tmp_path / "image.npy", np.full((4, 5, 6), voxel, np.uint8))
        result = voxkernel.evaluate([tmp_path / "image.npy"], output=tmp_path / "run", settings=settings)
        assert (result.n_rows, result.n_reused) == (rows, 0)
        assert read_rows(str(tmp_path / "run")).column("object").to_pylist() == [voxel] * rows


def test_an_image_that_failed_is_told_apart_from_one_without_objects(tmp_path, capsys):
    np.save(tmp_path / "negative.npy", np.full((4, 5, 6), -2))
    words = ["labels", str(tmp_path / "negative.npy"), "--spacing", "1,1,1", "-o", str(tmp_path / "run")]
    assert main([*words, "--workers", "1", "--quiet"]) == 1
    out, err = capsys.readouterr()
    assert out.splitlines() == [f"{tmp_path / 'run'}: 1 of 1 images failed"]
    line = "`labels` must be >= 0, with 0 for the background; got -2"
    assert err == f"voxkernel: error: {tmp_path / 'negative.npy'}: {line}\n"


def test_a_file_that_is_missing_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("empty.npy", np.zeros((4, 5, 6), np.uint8))
    words = ["labels", "--spacing", "1,1,1", "-o", "run", "--workers", "1", "--quiet"]
    for names, counted in (
        (["missing.tif"], "1 of 1 images failed"),
        (["missing.h5::a", "empty.npy"], "no objects; 1 of 2 images failed"),
    ):
        assert main([*words, *names]) == 1
        out, err = capsys.readouterr()
        assert out == f"run: {counted}\n"
        assert f"voxkernel: error: {names[0]}: does not exist\n" in err.replace("'missing.h5' ", "")
        assert err.count("\n") == err.count("error: missing")
    assert main([*words, "*.nope"]) == 2
    assert "error: IMAGE must lead to a label image; got *.nope" in capsys.readouterr().err


def test_a_mesh_is_no_label_image(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    voxkernel.as_mesh(shapes.cube()).write("cube.ply")
    assert main(["labels", "cube.ply", "-o", "out"]) == 2
    said = capsys.readouterr()
    line = "voxkernel: error: IMAGE must be a label image; got 'cube.ply' (see `voxkernel labels --help`)\n"
    assert (said.out, said.err) == ("", line)
    assert not (tmp_path / "out").exists()


def test_evaluate_says_why_images_failed(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("a.npy", scene())
    words = ["evaluate", "a.npy", "-o", "run", "--workers", "1", "--no-thumbnails", "-q"]
    assert main(words) == 1
    said = capsys.readouterr()
    assert said.out == "run: 1 rows, 0 ok, 1 failed\n"
    assert said.err == "voxkernel: error: a.npy: --spacing must be given: 'a.npy' stores none\n"
    assert main(words) == 1  # also where the rows are from an earlier run
    assert said.err == capsys.readouterr().err
    voxkernel.as_mesh(shapes.cube()).write("cube.ply")
    for k in range(12):
        (tmp_path / f"{k:02}.ply").write_text("no mesh")
    files = ["cube.ply", *(f"{k:02}.ply" for k in range(12))]
    assert main([*words[:1], *files, *words[1:], "--spacing", "1,1,1", "--rays", "32"]) == 1
    said = capsys.readouterr()
    assert said.out == "run: 18 rows, 1 meshes ok, 1 label image ok, 12 failed\n"
    lines = said.err.splitlines()
    assert len(lines) == 11
    assert lines[0].startswith("voxkernel: error: 00.ply: is not a readable .ply file")
    assert lines[-1] == "voxkernel: error: 2 more rows failed: see `voxkernel report`"


def test_an_object_that_failed_is_named(capsys):
    show_failures([("a.tif", 7, "ValueError: `spacing` must be > 0"), ("b\n.tif", None, "gone")], 2, {})
    assert capsys.readouterr().err == (
        "voxkernel: error: a.tif, object 7: `spacing` must be > 0\nvoxkernel: error: b\\n.tif: gone\n"
    )
