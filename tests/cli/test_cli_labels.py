"""`voxkernel labels --map`: what it is painted from, where it lies, and what it must not overwrite."""

import os
import sys

import label_shapes
import numpy as np
import pytest

import voxkernel
from voxkernel.cli.commands import parsed
from voxkernel.cli.labels import _write_map
from voxkernel.cli.main import main
from voxkernel.evaluation import EvaluateSettings
from voxkernel.evaluation.inputs import Item
from voxkernel.run_table import open_run, part_names, read_parts, write_table_part

RUN = ("-o", "run", "--workers", "1", "--no-pictures", "--rays", "32", "-q")


@pytest.fixture
def volume(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return label_shapes.c_shape().astype(np.uint8)


def refused(capsys, *words):
    assert main(["labels", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert not os.path.exists("run")  # before anything is computed
    return said.err


def test_a_map_never_takes_the_place_of_its_image(tmp_path, volume, capsys):
    np.savez("image.npz", labels=volume, spacing=(1.0, 1.0, 1.0))
    (tmp_path / "sub").mkdir()
    (tmp_path / "here").symlink_to(".")
    (tmp_path / "link.npz").symlink_to("image.npz")
    (tmp_path / "hard.npz").hardlink_to("image.npz")
    data = (tmp_path / "image.npz").read_bytes()
    for image, target in (
        ("image.npz", "image.npz"), ("image.npz", "./sub/../image.npz"), ("image.npz", "here/image.npz"),
        ("link.npz", "image.npz"), ("image.npz", "link.npz"), ("image.npz", "hard.npz"), ("image.np?", "image.npz"),
        ("image.npz::labels", str(tmp_path / "image.npz")), (".", "image.npz"),
    ):  # fmt: skip
        said = refused(capsys, image, *RUN, "--map", target)
        assert f"--map must not be the image itself, nor in it; got '{target.removeprefix('./')}'" in said
    np.savez("other.npz", labels=volume, spacing=(1.0, 1.0, 1.0))
    assert "--map must not be the image" in refused(capsys, "other.npz", "image.npz", *RUN, "--map", "image.npz")
    assert (tmp_path / "image.npz").read_bytes() == data
    (tmp_path / "image.zarr" / "labels").mkdir(parents=True)
    (tmp_path / "into").symlink_to("image.zarr/labels")
    for target in ("image.zarr/a.tif", "image.zarr/labels/a.tif", "into/a.tif"):
        assert "nor in it" in refused(capsys, "image.zarr::labels/a", *RUN, "--map", target)


def test_a_map_is_of_one_image(volume, capsys):
    for name in ("a.npy", "b.npy"):
        np.save(name, volume)
    assert "--map must be given with one image; got 2" in refused(capsys, "*.npy", *RUN, "--map", "m.tif")
    assert "--map must be given with one image; got 2" in refused(capsys, ".", *RUN, "--map", "m.tif")
    assert "--map must end in .tif, .tiff, .nii, .nii.gz or .npz; got 'q.png'" in refused(
        capsys, "a.npy", *RUN, "--map", "q.png"
    )
    os.mkdir("m.tif")
    assert "--map must be a file; got the folder 'm.tif'" in refused(capsys, "a.npy", *RUN, "--map", "m.tif")


def test_a_map_lies_over_its_image(volume, capsys):
    nibabel = pytest.importorskip("nibabel")
    nrrd = pytest.importorskip("nrrd")
    affine = np.array([[0, 0, -0.25, 1.5], [-2.0, 0, 0, 2.25], [0, 0.5, 0, -3.0], [0, 0, 0, 1]])
    nibabel.save(nibabel.Nifti1Image(volume, affine), "a.nii.gz")
    lps = affine[:3] * [[-1], [-1], [1]]
    header = {"space": "LPS", "space directions": lps[:, :3].T, "space origin": lps[:, 3]}
    nrrd.write("a.nrrd", volume, header)
    for name in ("a.nii.gz", "a.nrrd"):
        for spacing in ([], ["--spacing", "1,1,1"]):
            assert main(["labels", name, *RUN, *spacing, "--map", "m.nii.gz"]) == 0
            capsys.readouterr()
            painted = nibabel.load("m.nii.gz")
            assert np.array_equal(painted.affine, affine)
            assert np.array_equal(np.asarray(painted.dataobj) != 0, volume != 0)


def test_a_map_is_painted_from_the_rows_of_the_run(volume, capsys, monkeypatch):
    image = np.zeros((12, 40, 60), np.uint16)
    image[: volume.shape[0], : volume.shape[1], : volume.shape[2]] = volume
    for k, (j, i) in enumerate(np.ndindex(12, 19), 2):  # in two parts, with the bracket above
        image[9:12, 3 * j : 3 * j + 2, 3 * i : 3 * i + 2] = k
    np.save("image.npy", image)
    words = ["labels", "image.npy", *RUN, "--spacing", "2,1,1"]
    stars = voxkernel.label_stars(image, spacing=(2, 1, 1), n_rays=(32,))
    assert len(stars) == 229
    module = sys.modules["voxkernel.labels.label_stars"]  # its name in the package is the function
    monkeypatch.setattr(module, "stars_of", None)  # it is not computed in this process
    for _ in range(2):  # the second time the rows are there
        assert main([*words, "--map", "m.npz"]) == 0
        capsys.readouterr()
        assert np.array_equal(voxkernel.read_labels("m.npz").to_array(), voxkernel.paint_labels(image, stars))
        os.remove("m.npz")
    np.save("other.npy", image[:, :, ::-1])  # rows of another image in the same run
    assert main(["labels", "other.npy", *RUN, "--spacing", "2,1,1"]) == 0
    assert main([*words, "--map", "m.npz"]) == 0
    assert np.array_equal(voxkernel.read_labels("m.npz").to_array(), voxkernel.paint_labels(image, stars))
    capsys.readouterr()


def test_maps_of_flat_empty_and_failed_images(volume, capsys):
    np.save("flat.npy", volume.max(axis=0))
    assert main(["labels", "flat.npy", *RUN, "--spacing", "1,1", "--map", "m.npz"]) == 0
    stars = voxkernel.label_stars(volume.max(axis=0), spacing=(1, 1), n_rays=(32,))
    assert np.array_equal(voxkernel.read_labels("m.npz").to_array(), voxkernel.paint_labels(volume.max(axis=0), stars))
    np.save("empty.npy", 0 * volume)
    assert main(["labels", "empty.npy", *RUN, "--spacing", "1,1,1", "--map", "e.npz"]) == 0
    assert not voxkernel.read_labels("e.npz").to_array().any()
    np.save("wrong.npy", volume - 0.5)
    capsys.readouterr()
    assert main(["labels", "wrong.npy", *RUN, "--spacing", "1,1,1", "--map", "w.npz"]) == 1
    assert not os.path.exists("w.npz")
    assert capsys.readouterr().err.count("\n") == 1


def test_a_map_of_an_image_that_failed_in_part(volume, capsys):
    image = volume.copy()
    image[:, :2], image[:, 2:4] = 2 * (image[:, :2] != 0), 3 * (image[:, 2:4] != 0)
    np.save("image.npy", image)
    words = ["labels", "image.npy", *RUN, "--spacing", "1,1,1"]
    assert main(words) == 0
    fs, path = open_run("run")
    (part,) = part_names(fs, path)
    table = read_parts(fs, [part])
    assert table["object"].to_pylist() == [1, 2, 3]
    os.remove(part)
    write_table_part(fs, path, table.slice(1))
    args = parsed([*[word for word in words if word != "-q"], "--map", "m.npz"])
    capsys.readouterr()
    _write_map(args, EvaluateSettings(spacing=(1, 1, 1)), Item("image.npy", "image.npy"), is_whole=False)
    assert "objects without a row, not in m.npz: 1" in capsys.readouterr().err
    painted = voxkernel.read_labels("m.npz").to_array()
    assert np.array_equal(painted != 0, image > 1)
    stars = voxkernel.label_stars(image, spacing=(1, 1, 1), n_rays=(32,), ids=[2, 3])
    assert np.array_equal(painted, voxkernel.paint_labels(image, stars))


def test_the_help_says_how_spacing_is_meant(capsys):
    for command in ("labels", "evaluate"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        said = " ".join(capsys.readouterr().out.split())
        assert "distance of voxel centres along each axis, in the order of the array's axes: z,y,x" in said
        assert "x,y,z for .nii and .nrrd; it counts more than what the file stores, and must be given where it" in said
        assert "numbers of rays to try; 32,64,96,128,256 by default" in said
        assert command == "evaluate" or "seen 2, centres 3; .tif, .nii, .nii.gz or .npz" in said
