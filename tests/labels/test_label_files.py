"""Files of label images: each gives the voxels and the spacing it was written with, or says in one line why not."""

import label_shapes
import numpy as np
import pytest

import voxkernel
from voxkernel import GridReadError, label_stars, paint_labels, read_labels, write_labels

tifffile, nibabel, nrrd = map(pytest.importorskip, ("tifffile", "nibabel", "nrrd"))
h5py, zarr = map(pytest.importorskip, ("h5py", "zarr"))

SPACING = (2.0, 0.5, 0.25)


@pytest.fixture
def volume(rng):
    return (rng.integers(0, 6, (7, 8, 9)) * (rng.random((7, 8, 9)) < 0.6)).astype(np.uint16)


def same(image, volume, spacing=SPACING):
    assert image.shape == volume.shape
    assert image.spacing == pytest.approx(spacing, rel=1e-6)
    assert np.array_equal(image.to_array(), volume)
    low, high = [1] * volume.ndim, [max(2, n - 1) for n in volume.shape]
    assert np.array_equal(image.read(low, high), volume[tuple(map(slice, low, high))])


def imagej(path, v):
    facts = {"spacing": 2.0, "axes": "ZYX", "unit": "um"}
    tifffile.imwrite(path, v, imagej=True, resolution=(4.0, 2.0), metadata=facts)


def ome(path, v, **options):
    sizes = {"PhysicalSizeZ": 2.0, "PhysicalSizeY": 500.0, "PhysicalSizeYUnit": "nm", "PhysicalSizeX": 0.25}
    tifffile.imwrite(path, v, ome=True, metadata={"axes": "ZYX", **sizes}, **options)


def packed_ome(path, v):
    ome(path, v, compression="zlib")


def nifti(path, v):
    nibabel.save(nibabel.Nifti1Image(v, np.diag([*SPACING, 1.0])), path)


def nrrd_directions(path, v):
    nrrd.write(str(path), v, {"space directions": np.diag(SPACING), "space": "left-posterior-superior"})


def nrrd_spacings(path, v):
    nrrd.write(str(path), v, {"spacings": SPACING})


def npz(path, v):
    np.savez(path, labels=v, spacing=SPACING)


def hdf5(path, v):
    with h5py.File(path, "w") as file:
        data = file.create_dataset("volumes/labels", data=v, chunks=(4, 4, 4), compression="gzip")
        data.attrs["element_size_um"] = SPACING


def plain_zarr(path, v):
    array = zarr.create_array(str(path), shape=v.shape, chunks=(3, 4, 5), dtype=v.dtype)
    array[:] = v
    array.attrs["spacing"] = SPACING


def ome_zarr(path, v):
    """Time and channel of length 1, two resolutions."""
    group = zarr.open_group(str(path), mode="w")
    for name, data in (("0", v[None, None]), ("1", v[None, None, ::2, ::2, ::2])):
        group.create_array(name, shape=data.shape, chunks=(1, 1, 3, 4, 5), dtype=v.dtype)[:] = data
    scale = [{"type": "scale", "scale": [1.0, 1.0, *SPACING]}]
    group.attrs["multiscales"] = [{"datasets": [{"path": "0", "coordinateTransformations": scale}, {"path": "1"}]}]


WRITERS = {
    "imagej.tif": imagej, "ome.ome.tif": ome, "packed.ome.tif": packed_ome, "a.nii": nifti, "a.nii.gz": nifti,
    "directions.nrrd": nrrd_directions, "spacings.nrrd": nrrd_spacings, "a.npz": npz, "a.h5": hdf5,
    "plain.zarr": plain_zarr, "ome.zarr": ome_zarr,
}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_voxels_and_spacing_come_back(tmp_path, volume, name):
    WRITERS[name](tmp_path / name, volume)
    same(read_labels(tmp_path / name), volume)
    given = read_labels(tmp_path / name, spacing=(1, 2, 3))
    assert given.spacing == (1.0, 2.0, 3.0)
    assert label_stars(str(tmp_path / name), n_rays=(32,)).label.tolist() == np.unique(volume)[1:].tolist()


def test_names_of_arrays_inside(tmp_path, volume):
    hdf5(tmp_path / "a.h5", volume)
    same(read_labels(f"{tmp_path}/a.h5::volumes/labels"), volume)
    np.savez(tmp_path / "two.npz", a=volume, b=volume)
    same(read_labels(f"{tmp_path}/two.npz::b", spacing=SPACING), volume)
    with pytest.raises(GridReadError, match=r"two.npz' cannot be read as .npz: ValueError: name one of its arrays"):
        read_labels(tmp_path / "two.npz", spacing=SPACING)
    with pytest.raises(GridReadError, match=r'no array "c" in it, but a, b'):
        read_labels(f"{tmp_path}/two.npz::c", spacing=SPACING)
    ome_zarr(tmp_path / "image.zarr" / "labels" / "cells", volume)
    zarr.open_group(str(tmp_path / "image.zarr"), mode="a")
    zarr.open_group(str(tmp_path / "image.zarr" / "labels"), mode="a")
    same(read_labels(tmp_path / "image.zarr"), volume)


@pytest.mark.parametrize("dtype", [">u2", ">i4", "<f4", "u1"])
def test_other_types_and_byte_orders(tmp_path, volume, dtype):
    other = volume.astype(dtype)
    tifffile.imwrite(tmp_path / "a.tif", other, byteorder=">")
    same(read_labels(tmp_path / "a.tif", spacing=SPACING), volume)
    np.save(tmp_path / "a.npy", np.asfortranarray(other))
    same(read_labels(tmp_path / "a.npy", spacing=SPACING), volume)
    nifti(tmp_path / "a.nii", other)
    same(read_labels(tmp_path / "a.nii"), volume)


def test_two_axes(tmp_path, volume):
    tifffile.imwrite(tmp_path / "a.tif", volume[0], imagej=True, resolution=(4.0, 2.0))
    same(read_labels(tmp_path / "a.tif"), volume[0], (0.5, 0.25))
    tifffile.imwrite(tmp_path / "b.tif", volume, compression="zlib")  # pages of a file without spacing
    same(read_labels(tmp_path / "b.tif", spacing=SPACING), volume)


def wrong_files(folder, v):
    (folder / "junk.tif").write_bytes(b"II*\0junk")
    (folder / "junk.nii").write_bytes(b"junk")
    (folder / "junk.nii.gz").write_bytes(b"\x1f\x8bjunk")
    (folder / "junk.nrrd").write_bytes(b"NRRD0004\ntype: what\n\n")
    (folder / "junk.npy").write_bytes(b"\x93NUMPY")
    (folder / "junk.npz").write_bytes(b"PK")
    (folder / "junk.h5").write_bytes(b"\x89HDF")
    (folder / "junk.zarr").mkdir()
    tifffile.imwrite(folder / "none.tif", v)
    np.save(folder / "four.npy", v[None].repeat(2, 0))
    np.save(folder / "half.npy", v + 0.5)
    np.save(folder / "negative.npy", -v.astype(np.int16))
    np.save(folder / "objects.npy", np.array([{}, None]), allow_pickle=True)
    np.save(folder / "text.npy", np.array([["a"]]))
    tifffile.imwrite(folder / "time.tif", v[None].repeat(2, 0), imagej=True, metadata={"axes": "TZYX"})
    tifffile.imwrite(folder / "colours.tif", np.zeros((8, 9, 3), np.uint8), photometric="rgb")


WRONG = {
    **{f"junk{s}": f"cannot be read as {s}" for s in ".tif .nii .nii.gz .nrrd .npy .npz .h5 .zarr".split()},
    "none.tif": "`spacing` must be given: '.*none.tif' stores none",
    "missing.tif": "must be an existing file",
    "missing.zarr": "must be an existing folder",
    "a.png": "`path` must end in one of .tif, .tiff, .nii",
    "a.tif::x": "must name an array behind '::' only in",
    "four.npy": "must have 2 or 3 axes; got 4",
    "half.npy": "must be integers; got ",
    "negative.npy": "must be >= 0, with 0 for the background",
    "objects.npy": "cannot be read as .npy",
    "text.npy": "must be integers, or floats with integer values; got dtype",
    "time.tif": "must have 2 or 3 axes; got 4",
    "colours.tif": "an image of colours, not of labels",
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_files_that_are_no_label_images(tmp_path, volume, name):
    wrong_files(tmp_path, volume)
    with pytest.raises((GridReadError, ValueError, TypeError), match=WRONG[name]) as caught:
        label_stars(tmp_path / name, spacing=None if name == "none.tif" else SPACING)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".tif", ".nii", ".nii.gz", ".nrrd", ".npy", ".npz", ".h5"])
def test_an_empty_file_is_called_empty(tmp_path, suffix):
    (tmp_path / f"a{suffix}").touch()
    with pytest.raises(GridReadError, match=f"a{suffix}' cannot be read as {suffix}: the file is empty$"):
        read_labels(tmp_path / f"a{suffix}", spacing=SPACING)
    (tmp_path / "b.nrrd").write_bytes(b"NRRD0004\n")
    with pytest.raises(GridReadError) as caught:
        read_labels(tmp_path / "b.nrrd", spacing=SPACING)
    assert "StopIteration" not in str(caught.value)
    assert not str(caught.value).rstrip().endswith(":")


@pytest.mark.parametrize("name", [name for name in WRITERS if "zarr" not in name])
def test_cut_files_are_refused(tmp_path, volume, name):
    """Wherever a file ends too early, no voxels are made up for those that are gone."""
    WRITERS[name](tmp_path / name, volume)
    data = (tmp_path / name).read_bytes()
    for size in (0, 1, 99, *range(200, len(data), len(data) // 7), len(data) - 3):
        (tmp_path / name).write_bytes(data[:size])
        try:
            voxels = read_labels(tmp_path / name, spacing=SPACING).to_array()
        except GridReadError:
            continue
        assert np.array_equal(voxels, volume)  # a name or a number behind them may be lost


@pytest.mark.parametrize("suffix", [".tif", ".nii", ".nii.gz", ".npz"])
@pytest.mark.parametrize("what", ["seen", "visible"])
def test_maps_come_back(tmp_path, suffix, what):
    image = label_shapes.c_shape()
    stars = label_stars(image, spacing=SPACING)
    painted = paint_labels(image, stars, what=what)
    assert ((painted != 0) == (image != 0)).all()
    if what == "seen":
        assert int((painted >= 2).sum()) == round(stars.visible[0] * stars.voxels[0])
        assert painted[tuple(stars.center[0])] == 3
        assert int((painted == 3).sum()) == 1
    else:
        assert set(np.unique(painted)) == {0.0, np.float32(stars.visible[0])}
    write_labels(tmp_path / f"map{suffix}", painted, spacing=SPACING)
    if what == "seen":
        same(read_labels(tmp_path / f"map{suffix}"), painted)


def test_maps_of_two_axes_and_of_wide_labels(tmp_path):
    image = np.array([[1, 1], [1, 0]], dtype=np.int64) * 40_000
    write_labels(tmp_path / "a.tif", image, spacing=(3, 2))
    same(read_labels(tmp_path / "a.tif"), image, (3, 2))
    with pytest.raises(ValueError, match=r"`values` must be integers that a .tif can hold exactly"):
        write_labels(tmp_path / "b.tif", image * 2**20 + 1, spacing=(3, 2))
    with pytest.raises(ValueError, match=r"`path` must end in .tif"):
        write_labels(tmp_path / "b.png", image, spacing=(3, 2))
    with pytest.raises(ValueError, match="`values` must have 2 or 3 axes; got 1"):
        write_labels(tmp_path / "b.tif", image[0], spacing=(3,))
    with pytest.raises(TypeError, match="`values` must be numbers"):
        write_labels(tmp_path / "b.tif", image.astype(str), spacing=(3, 2))
    assert [p.name for p in tmp_path.iterdir()] == ["a.tif"]


def test_a_map_belongs_to_its_image():
    image = label_shapes.ball(7)
    stars = label_stars(image, spacing=(1, 1, 1))
    with pytest.raises(ValueError, match=r"`stars` must be of this image; got \d+ voxels of label 1, which has"):
        paint_labels(image * (np.arange(7) < 6), stars)
    with pytest.raises(ValueError, match="got boxes outside its shape"):
        paint_labels(image[:5], stars)
    with pytest.raises(ValueError, match="`what` must be one of"):
        paint_labels(image, stars, what="all")
    with pytest.raises(TypeError, match="`stars` must be LabelStars, from `label_stars`; got int"):
        paint_labels(image, 3)


@pytest.mark.parametrize("suffix", [".tif", ".nii", ".nii.gz", ".npz"])
@pytest.mark.parametrize("kind", ["?", "i1", "u1", ">i2", "u4", "i8", "u8", "f2", "f4", "f8", "g"])
def test_numbers_of_every_type_are_written(tmp_path, suffix, kind):
    values = np.arange(24).reshape(2, 3, 4).astype(kind)
    write_labels(tmp_path / f"a{suffix}", values, spacing=SPACING)
    if suffix == ".tif":
        found = tifffile.imread(tmp_path / "a.tif")
    elif suffix == ".npz":
        found = np.load(tmp_path / "a.npz")["labels"]
    else:
        found = np.asarray(nibabel.load(tmp_path / f"a{suffix}").dataobj)
    assert np.array_equal(found, values)


@pytest.mark.slow
def test_twenty_gigabytes_and_a_hundred_thousand_objects(tmp_path):
    """The voxels of a zarr array of 20 GB that is mostly not there; each object crosses chunks here and there."""
    import resource

    shape, edge = (2000, 3200, 3200), 160
    array = zarr.create_array(str(tmp_path / "large.zarr"), shape=shape, chunks=(edge,) * 3, dtype=np.uint32)
    body = label_shapes.ball(7)
    counts, label = {}, 0
    rng = np.random.default_rng(0)
    for place in rng.permutation(4800)[:100]:
        low = np.array(np.unravel_index(place, (12, 20, 20))) * edge + 80  # across the borders of eight chunks
        block = np.zeros((80, 80, 80), np.uint32)
        for at in np.ndindex(10, 10, 10):
            label += 1
            block[tuple(slice(8 * a, 8 * a + 7) for a in at)] = body * np.uint32(label)
        array[tuple(slice(a, a + 80) for a in low)] = block
    assert label == 100_000
    counts = int(body.sum())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    stars = voxkernel.label_stars(str(tmp_path / "large.zarr"), spacing=(1, 1, 1), n_rays=(32,))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert len(stars) == 100_000
    assert (stars.voxels == counts).all()
    assert (stars.visible == 1).all()
    print("memory grown by", grown / 1e3, "MB")
    assert grown < 200e3  # KB; a crop is 729 bytes
