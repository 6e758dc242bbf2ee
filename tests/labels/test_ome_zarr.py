"""OME-Zarr stores made by hand, versions 0.4 (zarr 2) and 0.5 (zarr 3): which array is read, and its spacing."""

import numpy as np
import pytest

from voxkernel import GridReadError, label_stars, read_labels

zarr = pytest.importorskip("zarr")

SPACING = (2.0, 0.5, 0.25)


@pytest.fixture(params=[2, 3])
def version(request):
    return request.param


@pytest.fixture
def labels(rng):
    return (rng.integers(0, 4, (6, 8, 10)) * (rng.random((6, 8, 10)) < 0.6)).astype(np.uint16)


def image(group, data, *, levels=("0", "1"), scale=SPACING, of_image=None, ome=None, version=2):
    """Give a group two resolutions of an image, with the attributes of its version."""
    extra = data.ndim - 3
    datasets = []
    for k, name in enumerate(levels):
        level = data[(..., *(slice(None, None, 2**k),) * 3)]
        group.create_array(name, shape=level.shape, chunks=(1,) * extra + (3, 4, 5), dtype=data.dtype)[:] = level
        steps = [1.0] * extra + [s * 2**k for s in scale]
        moved = {"type": "translation", "translation": [0.0] * data.ndim}
        datasets.append({"path": name, "coordinateTransformations": [{"type": "scale", "scale": steps}, moved]})
    scales = {"version": "0.4", "datasets": datasets}
    scales["axes"] = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    scales["axes"] = [{"name": "t", "type": "time"}, {"name": "c", "type": "channel"}][2 - extra :] + scales["axes"]
    if of_image is not None:
        scales["coordinateTransformations"] = [{"type": "scale", "scale": [1.0] * extra + list(of_image)}]
    facts = {"multiscales": [scales], **(ome or {})}
    group.attrs.update(facts if version == 2 else {"ome": {"version": "0.5", **facts}})


def store(path, labels, names, version, *, raw=(1, 2), listed=True):
    """Intensities, and below `labels` one label image of each name."""
    root = zarr.open_group(str(path), mode="w", zarr_format=version)
    grey = np.arange(labels.size, dtype=np.uint16).reshape(labels.shape)
    image(root, np.broadcast_to(grey, (*raw, *labels.shape)), version=version)
    inner = root.create_group("labels")
    if listed:
        facts = {"labels": list(names)}
        inner.attrs.update(facts if version == 2 else {"ome": facts})
    for k, name in enumerate(names):
        image(inner.create_group(name), labels + k * (labels != 0), ome={"image-label": {}}, version=version)
    return root


def same(found, labels, spacing=SPACING):
    assert found.shape == labels.shape
    assert found.spacing == pytest.approx(spacing)
    assert np.array_equal(found.to_array(), labels)


@pytest.mark.parametrize("listed", [True, False])
def test_the_label_image_of_an_image_is_read_not_its_intensities(tmp_path, labels, version, listed):
    store(tmp_path / "a.zarr", labels, ["nuc"], version, listed=listed)
    for inside in ("", "::labels", "::labels/nuc", "::labels/nuc/0", "::/labels/nuc/"):
        same(read_labels(f"{tmp_path}/a.zarr{inside}"), labels)
    assert label_stars(f"{tmp_path}/a.zarr", n_rays=(32,)).label.tolist() == np.unique(labels)[1:].tolist()
    coarse = read_labels(f"{tmp_path}/a.zarr::labels/nuc/1")
    same(coarse, labels[::2, ::2, ::2], [2 * s for s in SPACING])
    assert read_labels(f"{tmp_path}/a.zarr", spacing=(1, 2, 3)).spacing == (1, 2, 3)


def test_of_several_label_images_one_is_to_be_named(tmp_path, labels, version):
    store(tmp_path / "a.zarr", labels, ["nuc", "cells/big"], version)
    for inside in ("", "::labels"):
        with pytest.raises(GridReadError, match="name one of its label images behind '::'") as caught:
            read_labels(f"{tmp_path}/a.zarr{inside}")
        assert "there are labels/nuc, labels/cells/big" in str(caught.value)
        assert "\n" not in str(caught.value)
    same(read_labels(f"{tmp_path}/a.zarr::labels/nuc"), labels)
    same(read_labels(f"{tmp_path}/a.zarr::labels/cells/big"), labels + (labels != 0))
    with pytest.raises(GridReadError, match="nothing called 'labels/x' in it, but 0, 1, labels"):
        read_labels(f"{tmp_path}/a.zarr::labels/x")


def test_a_group_of_labels_without_any(tmp_path, labels, version):
    store(tmp_path / "a.zarr", labels, [], version, raw=(1, 1))
    with pytest.raises(GridReadError, match="name one of its label images behind '::'; there are none"):
        read_labels(f"{tmp_path}/a.zarr")
    grey = np.arange(labels.size, dtype=np.uint16).reshape(labels.shape)
    same(read_labels(f"{tmp_path}/a.zarr::0"), grey)  # asked for by name, with the spacing of the image around it
    same(read_labels(f"{tmp_path}/a.zarr::1"), grey[::2, ::2, ::2], [2 * s for s in SPACING])


def test_the_scale_of_the_image_comes_on_top(tmp_path, labels, version):
    root = zarr.open_group(str(tmp_path / "a.zarr"), mode="w", zarr_format=version)
    image(root, labels[None], scale=(1, 1, 1), of_image=SPACING, version=version)
    same(read_labels(f"{tmp_path}/a.zarr"), labels)
    same(read_labels(f"{tmp_path}/a.zarr::1"), labels[::2, ::2, ::2], [2 * s for s in SPACING])


def test_images_in_a_group_of_their_own(tmp_path, labels, version):
    """The layout of bioformats2raw: the images are groups of numbers."""
    root = zarr.open_group(str(tmp_path / "a.zarr"), mode="w", zarr_format=version)
    image(root.create_group("0"), labels, levels=("s0/a", "s1"), version=version)
    for inside in ("", "::0", "::0/s0/a"):
        same(read_labels(f"{tmp_path}/a.zarr{inside}"), labels)
    image(root.create_group("1"), labels, version=version)
    with pytest.raises(GridReadError, match="name one of its arrays behind '::'; there are 0, 1"):
        read_labels(f"{tmp_path}/a.zarr")


def test_scales_that_do_not_fit_are_asked_for(tmp_path, labels, version):
    root = zarr.open_group(str(tmp_path / "a.zarr"), mode="w", zarr_format=version)
    image(root, labels, of_image=(1, 2), version=version)
    with pytest.raises(ValueError, match="`spacing` must be given"):
        read_labels(f"{tmp_path}/a.zarr")
    same(read_labels(f"{tmp_path}/a.zarr", spacing=SPACING), labels)


def test_units_and_axes(tmp_path, labels, version):
    def store(name, axes):
        root = zarr.open_group(str(tmp_path / name), mode="w", zarr_format=version)
        image(root, labels, version=version)
        facts = root.attrs.asdict()
        scales = (facts if version == 2 else facts["ome"])["multiscales"][0]
        scales["axes"] = axes
        root.attrs.update(facts)
        return str(tmp_path / name)

    def space(*units):
        return [{"name": n, "type": "space", **({"unit": u} if u else {})} for n, u in zip("zyx", units, strict=True)]

    for axes, unit, spacing in (
        (space(None, None, None), None, SPACING), (space("nanometer", "nanometer", "nanometer"), "nm", SPACING),
        (space("micrometer", "nanometer", "angstrom"), "um", (2.0, 0.5e-3, 0.25e-4)), (["z", "y", "x"], None, SPACING),
        ([{"name": "top", "type": "space"}, {"name": "cross"}, {}], None, SPACING),
    ):  # fmt: skip
        found = read_labels(store("a.zarr", axes))
        same(found, labels, spacing)
        assert found.unit == unit
    mixed = store("a.zarr", space("micrometer", "parsnip", "micrometer"))
    with pytest.raises(ValueError, match=r"`spacing` must be given: '.*' stores it in different units, parsnip and um"):
        read_labels(mixed)
    same(read_labels(mixed, spacing=SPACING), labels)
    for axes, words in (
        ([{"name": "t", "type": "time"}, *space("um", "um", "um")[1:]], "6 time points, not of one volume: axes TYX"),
        ([{"name": "a", "type": "channel"}, *space("um", "um", "um")[1:]], "6 channels, not of one volume: axes CYX"),
        (["c", "y", "x"], "6 channels"),
    ):
        with pytest.raises(GridReadError, match=words):
            read_labels(store("a.zarr", axes), spacing=SPACING)
