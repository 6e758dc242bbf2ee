"""TIFF stacks of OME and ImageJ: units, and axes that are no space."""

import numpy as np
import pytest

from voxkernel import GridReadError, read_labels
from voxkernel.labels.stored import unit_name

tifffile = pytest.importorskip("tifffile")

VOLUME = np.arange(4 * 5 * 6, dtype=np.uint16).reshape(4, 5, 6) % 3


def ome(path, units, axes="ZYX"):
    facts = {f"PhysicalSize{axis}": size for axis, size in zip("ZYX", (2.0, 0.5, 0.25), strict=True)}
    facts |= {f"PhysicalSize{axis}Unit": unit for axis, unit in zip("ZYX", units, strict=True) if unit}
    tifffile.imwrite(path, VOLUME, ome=True, metadata={"axes": axes, **facts})


@pytest.mark.parametrize(
    ("units", "spacing", "unit"),
    [
        (("", "", ""), (2, 0.5, 0.25), "um"), (("µm",) * 3, (2, 0.5, 0.25), "um"),
        (("Å",) * 3, (2e-4, 0.5e-4, 0.25e-4), "um"), (("Å", "nm", ""), (2e-4, 0.5e-3, 0.25), "um"),
        (("mm", "cm", "µm"), (2e3, 0.5e4, 0.25), "um"), (("in",) * 3, (50800, 12700, 6350), "um"),
        (("pm", "fm", "thou"), (2e-6, 0.5e-9, 6.35), None), (("pixel",) * 3, (2, 0.5, 0.25), "pixel"),
        (("reference frame",) * 3, (2, 0.5, 0.25), "reference frame"),
    ],
)  # fmt: skip
def test_units_of_ome(tmp_path, units, spacing, unit):
    ome(tmp_path / "a.ome.tif", units)
    if max(spacing) > 1e6 * min(spacing):
        with pytest.raises(ValueError, match="`spacing` must not differ by more than"):
            read_labels(tmp_path / "a.ome.tif")
        return
    image = read_labels(tmp_path / "a.ome.tif")
    assert image.spacing == pytest.approx(spacing, rel=1e-12)
    assert image.unit == unit


@pytest.mark.parametrize("units", [("µm", "pixel", "pixel"), ("", "pixel", "pixel"), ("reference frame", "nm", "nm")])
def test_units_that_cannot_be_compared(tmp_path, units):
    ome(tmp_path / "a.ome.tif", units)
    with pytest.raises(ValueError, match=r"`spacing` must be given: '.*' stores it in different units") as caught:
        read_labels(tmp_path / "a.ome.tif")
    assert "\n" not in str(caught.value)
    assert read_labels(tmp_path / "a.ome.tif", spacing=(2, 1, 1)).spacing == (2.0, 1.0, 1.0)


def test_units_of_imagej(tmp_path):
    def image(**facts):
        facts = {"spacing": 2.0, "axes": "ZYX", **facts}
        tifffile.imwrite(tmp_path / "a.tif", VOLUME, imagej=True, resolution=(4.0, 2.0), metadata=facts)
        return read_labels(tmp_path / "a.tif")

    for unit, found in (("pixel", "pixel"), ("inch", "in"), ("micron", "um"), ("mm", "mm")):
        read = image(unit=unit)
        assert (read.spacing, read.unit) == ((2.0, 0.5, 0.25), found)
    mixed = image(unit="nm", zunit="micron")
    assert mixed.spacing == pytest.approx((2.0, 0.5e-3, 0.25e-3))
    with pytest.raises(ValueError, match="stores it in different units, pixel and um"):
        image(unit="pixel", zunit="um")


def test_time_and_channels_are_no_slices(tmp_path):
    ome(tmp_path / "c.ome.tif", ("",) * 3, axes="CYX")
    ome(tmp_path / "t.ome.tif", ("",) * 3, axes="TYX")
    facts = {"axes": "TYX", "spacing": 2.0}
    tifffile.imwrite(tmp_path / "t.tif", VOLUME, imagej=True, resolution=(4.0, 2.0), metadata=facts)
    facts = {"axes": "CYX", "mode": "composite"}
    tifffile.imwrite(tmp_path / "c.tif", VOLUME, imagej=True, metadata=facts)
    for name in ("c.ome.tif", "t.ome.tif", "t.tif", "c.tif"):
        n = "4 time points" if name[0] == "t" else "4 channels"
        for spacing in (None, (2, 1, 1)):
            words = f"an image of {n}, not of one volume: axes {name[0].upper()}YX; slices must be called Z"
            with pytest.raises(GridReadError, match=words):
                read_labels(tmp_path / name, spacing=spacing)


def test_a_stack_that_tifffile_was_told_no_axes_of(tmp_path):
    """It says that the slices are channels, and no distance of slices."""
    tifffile.imwrite(tmp_path / "a.tif", VOLUME, imagej=True, resolution=(4.0, 2.0))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert file.series[0].axes == "CYX"
    assert np.array_equal(read_labels(tmp_path / "a.tif", spacing=(2, 1, 1)).to_array(), VOLUME)
    with pytest.raises(ValueError, match=r"`spacing` must be given: '.*' stores none"):
        read_labels(tmp_path / "a.tif")


def test_names_of_units():
    for words, name in (
        ("µm", "um"), ("μm", "um"), ("\\u00B5m", "um"), ("Microns", "um"), ("micrometre", "um"), ("nanometers", "nm"),
        ("meter", "m"), ("Å", "angstrom"), ("\N{ANGSTROM SIGN}", "angstrom"), ("Angstroms", "angstrom"),
        ("inches", "in"), ("Mm", "Mm"), ("mm", "mm"), ("MM", "mm"), ("pixels", "pixels"), ("", None), (None, None),
        ("kilometer", "km"), ("barometer", "barometer"),
    ):  # fmt: skip
        assert unit_name(words) == name
