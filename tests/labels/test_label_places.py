"""Maps lie over the image that they are of: every voxel at the same place of the world, in the same unit."""

import pickle

import label_shapes
import numpy as np
import pytest

from voxkernel import LabelImage, label_stars, paint_labels, read_labels, write_labels

tifffile, nibabel, nrrd = map(pytest.importorskip, ("tifffile", "nibabel", "nrrd"))

VOLUME = label_shapes.c_shape().astype(np.uint8)
TURNED = np.array([[-1.9, 0.1, 0.05, 50.0], [0.3, -0.49, 0.02, 60.0], [0.1, 0.03, 0.26, -7.0], [0, 0, 0, 1]])
SIMPLE = np.array([[0, 0, -0.25, 1.5], [-2.0, 0, 0, 2.25], [0, 0.5, 0, -3.0], [0, 0, 0, 1]])


def image_of(path, volume, *, sform=None, qform=None, unit="mm", kind=None):
    image = (kind or nibabel.Nifti1Image)(volume, None)
    image.header.set_xyzt_units(xyz=unit)
    image.header.set_zooms((2.0, 0.5, 0.25)[: volume.ndim])
    for form, put in ((sform, image.header.set_sform), (qform, image.header.set_qform)):
        if form is not None:
            put(*form)
    nibabel.save(image, path)


def places(affine, shape):
    """Where every voxel is."""
    ijk = np.indices([*shape, *[1] * (3 - len(shape))]).reshape(3, -1)
    return affine[:3, :3] @ ijk + affine[:3, 3:]


FORMS = {
    "sform": {"sform": (TURNED, 1)}, "qform": {"qform": (SIMPLE, 1), "unit": "micron"},
    "both": {"sform": (TURNED, 4), "qform": (SIMPLE, 2)}, "neither": {},
    "flat": {"sform": (np.diag([2.0, 0.0, 0.25, 1.0]), 1)},
}  # fmt: skip


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
@pytest.mark.parametrize("name", FORMS)
def test_a_map_of_a_nifti_image_has_its_header(tmp_path, name, suffix):
    path, target = tmp_path / f"image{suffix}", tmp_path / "map.nii.gz"
    image_of(path, VOLUME, **FORMS[name])
    for like in (path, str(path), read_labels(path), read_labels(path, spacing=(1, 1, 1))):
        write_labels(target, VOLUME.astype(np.float32), like=like)
        one, two = nibabel.load(path), nibabel.load(target)
        assert np.array_equal(one.affine, two.affine)
        assert np.array_equal(places(one.affine, one.shape), places(two.affine, two.shape))
        for get in ("get_sform", "get_qform"):
            (affine, code), (affine_of_map, code_of_map) = (getattr(i.header, get)(coded=True) for i in (one, two))
            assert code == code_of_map
            assert np.array_equal(affine, affine_of_map)
        assert one.header.get_xyzt_units() == two.header.get_xyzt_units()
        assert one.header.get_zooms() == two.header.get_zooms()
        assert np.array_equal(np.asarray(two.dataobj), VOLUME)
    image = pickle.loads(pickle.dumps(read_labels(path)))
    assert np.array_equal(image.affine, one.affine)
    assert image.unit == {"micron": "um"}.get(FORMS[name].get("unit"), "mm")
    assert not image.affine.flags.writeable
    again = read_labels(target)  # a map of the map
    assert again.spacing == read_labels(path).spacing
    assert np.array_equal(again.affine, one.affine)


def test_nifti_of_version_2_and_of_two_axes(tmp_path):
    image_of(tmp_path / "two.nii", VOLUME, sform=(TURNED, 1), kind=nibabel.Nifti2Image)
    image_of(tmp_path / "flat.nii.gz", VOLUME[0], sform=(SIMPLE, 1))
    for name, volume in (("two.nii", VOLUME), ("flat.nii.gz", VOLUME[0])):
        write_labels(tmp_path / "map.nii", volume, like=tmp_path / name)
        one, two = nibabel.load(tmp_path / name), nibabel.load(tmp_path / "map.nii")
        np.testing.assert_allclose(two.affine, one.affine, rtol=1e-6)
        assert two.shape == volume.shape


# What turns the world that NRRD names into NIfTI's; what it does not name is DICOM's, as ITK takes it.
SPACES = {
    "left-posterior-superior": (-1, -1), "LPS": (-1, -1), "right-anterior-superior": (1, 1), "RAS": (1, 1),
    "left-anterior-superior": (-1, 1), "scanner-xyz": (-1, -1),
}  # fmt: skip


def nrrd_header(space):
    steps, origin = TURNED[:3, :3].T, TURNED[:3, 3]
    return {"space": space, "space directions": steps, "space origin": origin, "space units": ["um"] * 3}


@pytest.mark.parametrize("space", SPACES)
def test_a_map_of_a_nrrd_image_lies_over_it(tmp_path, space):
    path = str(tmp_path / "image.nrrd")
    nrrd.write(path, VOLUME, nrrd_header(space))
    image = read_labels(path)
    assert image.unit == "um"
    write_labels(tmp_path / "map.nii.gz", VOLUME, like=image)
    _, header = nrrd.read(path)
    theirs = np.array(header["space directions"]).T @ np.indices(VOLUME.shape).reshape(3, -1)
    theirs = (theirs + np.array(header["space origin"])[:, None]) * np.array([*SPACES[space], 1.0])[:, None]
    ours = nibabel.load(tmp_path / "map.nii.gz")
    np.testing.assert_allclose(places(ours.affine, ours.shape), theirs, rtol=0, atol=1e-5)  # float32 of 60
    np.testing.assert_allclose(ours.header.get_zooms(), image.spacing, rtol=1e-6)


@pytest.mark.parametrize("flat", [False, True])
def test_nrrd_and_its_map_are_in_one_place_for_itk(tmp_path, flat):
    itk = pytest.importorskip("SimpleITK", reason="SimpleITK is not installed")
    volume = VOLUME[0] if flat else VOLUME
    turn = np.linalg.qr(TURNED[:3, :3])[0]  # ITK takes no shears
    steps = (turn * [2.0, 0.5, 0.25]).T
    headers = [{"spacings": (2.0, 0.5, 0.25)[: volume.ndim]}]
    if not flat:
        headers += [nrrd_header(space) | {"space directions": steps} for space in SPACES]
    for header in headers:
        nrrd.write(str(tmp_path / "image.nrrd"), volume, header)
        write_labels(tmp_path / "map.nii.gz", volume, like=tmp_path / "image.nrrd")
        one, two = (itk.ReadImage(str(tmp_path / name)) for name in ("image.nrrd", "map.nii.gz"))
        for ijk in (np.zeros(volume.ndim), np.array(volume.shape) - 1, np.arange(volume.ndim)):
            here, there = (i.TransformIndexToPhysicalPoint([int(n) for n in ijk]) for i in (one, two))
            np.testing.assert_allclose(there, here, rtol=0, atol=1e-4)


@pytest.mark.parametrize("unit", ["um", "\\u00B5m", "micron", "nm", "pixel"])
def test_a_tiff_map_keeps_the_unit(tmp_path, unit):
    facts = {"spacing": 2.0, "axes": "ZYX", "unit": unit}
    tifffile.imwrite(tmp_path / "image.tif", VOLUME, imagej=True, resolution=(4.0, 2.0), metadata=facts)
    image = read_labels(tmp_path / "image.tif")
    assert image.unit == (unit if unit in ("nm", "pixel") else "um")
    write_labels(tmp_path / "map.tif", VOLUME, like=image)
    with tifffile.TiffFile(tmp_path / "map.tif") as file:
        assert file.imagej_metadata["unit"] == image.unit
    again = read_labels(tmp_path / "map.tif")
    assert (again.unit, again.spacing) == (image.unit, image.spacing)
    assert again.affine is None


def test_what_values_are_like(tmp_path):
    stars = label_stars(VOLUME, spacing=(2, 1, 1), n_rays=(32,))
    image = LabelImage.from_array(VOLUME, spacing=(2, 1, 1))
    assert (image.affine, image.unit) == (None, None)
    seen = paint_labels(image, stars)
    for suffix in (".tif", ".nii", ".npz"):
        write_labels(tmp_path / f"a{suffix}", seen, like=image)
        write_labels(tmp_path / f"b{suffix}", seen, spacing=(2, 1, 1))
        assert read_labels(tmp_path / f"a{suffix}").spacing == (2.0, 1.0, 1.0)
        if suffix != ".npz":  # which has the time in it
            assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
    for options, words in (
        ({}, "`spacing` or `like` must be given, not both; got none"),
        ({"spacing": (2, 1, 1), "like": image}, "`spacing` or `like` must be given, not both; got both"),
        ({"like": LabelImage.from_array(VOLUME[:2], spacing=(2, 1, 1))}, "`values` must have the shape of `like`"),
    ):
        with pytest.raises(ValueError, match=words):
            write_labels(tmp_path / "c.tif", seen, **options)
    with pytest.raises(TypeError, match="`like` must be a LabelImage or a path; got ndarray"):
        write_labels(tmp_path / "c.tif", seen, like=seen)
    assert not (tmp_path / "c.tif").exists()
