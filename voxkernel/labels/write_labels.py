"""Label images, and maps made of them, to files that napari, ITK-SNAP and Fiji open."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_path
from voxkernel._extras import optional
from voxkernel._output_file import whole_file
from voxkernel.labels.label_image import as_spacing

__all__ = ["check_target", "write_labels"]

_SUFFIXES = (".tif", ".tiff", ".nii", ".nii.gz", ".npz")


def write_labels(path: str | os.PathLike[str], values: NDArray[Any], *, spacing: Sequence[float]) -> None:
    """Write an array of voxels with its spacing.

    Parameters
    ----------
    path : path
        `.tif` (as ImageJ writes it), `.nii`, `.nii.gz` or `.npz`.
    values : array, 2 or 3 axes
        bool, integers or floats. A `.tif` of ImageJ holds uint8, uint16 and float32: other integers are written as
        the smallest of these that holds them exactly, other floats rounded to float32.
    spacing : sequence of float
        One number for each axis, > 0.

    Raises
    ------
    ValueError, TypeError
        If the suffix is another, the spacing does not fit, or a `.tif` cannot hold the values.
    MissingExtraError
        If the package that writes the file is not installed: the extra `labels`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(folder + "/map.npz", np.ones((3, 4)), spacing=(2, 1))
    """
    target = check_target(path)
    array = np.asarray(values)
    if array.ndim not in (2, 3):
        raise ValueError(f"`values` must have 2 or 3 axes; got {array.ndim}")
    if array.dtype.kind not in "biuf":
        raise TypeError(f"`values` must be numbers; got dtype {array.dtype}")
    steps = as_spacing(spacing, array.ndim)
    name = target.name.lower()
    if name.endswith((".tif", ".tiff")):
        _write_tiff(target, array, steps)
    elif name.endswith((".nii", ".nii.gz")):
        _write_nifti(target, array, steps)
    else:
        with whole_file(target) as stream:
            np.savez_compressed(stream, labels=array, spacing=np.array(steps))


def check_target(path: str | os.PathLike[str], images: Sequence[str | os.PathLike[str]] = ()) -> Path:
    """Refuse a name that `write_labels` cannot write, or that is one of the images, before anything is computed."""
    target = as_path("path", path)
    if not target.name.lower().endswith(_SUFFIXES):
        raise ValueError(f"`path` must end in {', '.join(_SUFFIXES[:-1])} or {_SUFFIXES[-1]}; got '{target}'")
    if not target.absolute().parent.is_dir():
        raise ValueError(f"`path` must be in an existing folder; got '{target}'")
    if target.is_dir():
        raise ValueError(f"`path` must be a file; got the folder '{target}'")
    places = [place for place in (target, *target.resolve().parents) if place.exists()]
    for image in images:
        file = Path(os.fspath(image).partition("::")[0])
        if file.exists() and any(place.samefile(file) for place in places):
            raise ValueError(f"`path` must not be the image itself, nor in it; got '{target}'")
    return target


def _write_tiff(target: Any, array: NDArray[Any], spacing: tuple[float, ...]) -> None:
    tifffile = optional("tifffile")
    if array.dtype.kind == "f":
        array = array.astype(np.float32)
    else:
        kinds = [k for k in (np.uint8, np.uint16, np.float32) if np.array_equal(array.astype(k), array)]
        if not kinds:
            raise ValueError(f"`values` must be integers that a .tif can hold exactly; got up to {array.max()}")
        array = array.astype(kinds[0])
    facts: dict[str, Any] = {"axes": "ZYX" if array.ndim == 3 else "YX"}
    if array.ndim == 3:
        facts["spacing"] = spacing[0]
    with whole_file(target) as stream:
        tifffile.imwrite(
            stream, array, imagej=True, resolution=(1 / spacing[-1], 1 / spacing[-2]), metadata=facts
        )


def _write_nifti(target: Any, array: NDArray[Any], spacing: tuple[float, ...]) -> None:
    nibabel = optional("nibabel")
    if array.dtype.kind == "b":
        array = array.astype(np.uint8)
    steps = [*spacing, *[1.0] * (3 - array.ndim)]
    image = nibabel.Nifti1Image(array, np.diag([*steps, 1.0]), dtype=array.dtype)
    image.header.set_zooms(spacing)
    data = image.to_bytes()
    if target.name.lower().endswith(".gz"):
        import gzip

        data = gzip.compress(data, 6, mtime=0)
    with whole_file(target) as stream:
        stream.write(data)
