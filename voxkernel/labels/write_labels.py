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
from voxkernel.labels.image_files import read_labels
from voxkernel.labels.label_image import LabelImage, as_spacing

__all__ = ["check_target", "write_labels"]

_SUFFIXES = (".tif", ".tiff", ".nii", ".nii.gz", ".npz")


def write_labels(
    path: str | os.PathLike[str],
    values: NDArray[Any],
    *,
    spacing: Sequence[float] | None = None,
    like: LabelImage | str | os.PathLike[str] | None = None,
) -> None:
    """Write an array of voxels, with a spacing or in the place of a label image.

    Parameters
    ----------
    path : path
        `.tif` (as ImageJ writes it), `.nii`, `.nii.gz` or `.npz`.
    values : array, 2 or 3 axes
        bool, integers or floats. A `.tif` of ImageJ holds uint8, uint16 and float32: other integers are written as
        the smallest of these that holds them exactly, other floats rounded to float32. A `.nii` holds float16 as
        float32, and rounds what is wider than float64 to that.
    spacing : sequence of float, optional
        One number for each axis, > 0; not with `like`.
    like : LabelImage or path, optional
        The image that the values are to lie over, of the same shape, instead of `spacing`. Its spacing is taken; a
        `.nii` or `.nii.gz` has its affine and the forms of its header, where it is a NIfTI or NRRD image, also where
        another spacing was given for it; a `.tif` has its unit.

    Raises
    ------
    ValueError, TypeError
        If the suffix is another, the spacing or the image does not fit, or the file cannot hold the values.
    VoxKernelError
        If `like` cannot be read.
    MissingExtraError
        If the package that writes the file is not installed: the extra `labels`.

    Notes
    -----
    Only `.nii` and `.nii.gz` hold where an image lies and how it is turned.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(folder + "/map.npz", np.ones((3, 4)), spacing=(2, 1))
    ...     write_labels(folder + "/other.npz", np.zeros((3, 4)), like=folder + "/map.npz")
    """
    target = check_target(path)
    array = np.asarray(values)
    if array.ndim not in (2, 3):
        raise ValueError(f"`values` must have 2 or 3 axes; got {array.ndim}")
    if array.dtype.kind not in "biuf":
        raise TypeError(f"`values` must be numbers; got dtype {array.dtype}")
    image = _image_like(like, array.shape)
    if (image is None) == (spacing is None):
        raise ValueError(f"`spacing` or `like` must be given, not both; got {'none' if image is None else 'both'}")
    steps = as_spacing(spacing, array.ndim) if image is None else image.spacing
    name = target.name.lower()
    if name.endswith((".tif", ".tiff")):
        _write_tiff(target, array, steps, None if image is None else image.unit)
    elif name.endswith((".nii", ".nii.gz")):
        _write_nifti(target, array, steps, image)
    else:
        with whole_file(target) as stream:
            np.savez_compressed(stream, labels=array, spacing=np.array(steps))


def _image_like(like: object, shape: tuple[int, ...]) -> LabelImage | None:
    if like is None:
        return None
    if isinstance(like, str | os.PathLike):
        like = read_labels(like)  # pyright: ignore[reportUnknownArgumentType]
    if not isinstance(like, LabelImage):
        raise TypeError(f"`like` must be a LabelImage or a path; got {type(like).__name__}")
    if like.shape != shape:
        raise ValueError(f"`values` must have the shape of `like`, {like.shape}; got {shape}")
    return like


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


def _write_tiff(target: Any, array: NDArray[Any], spacing: tuple[float, ...], unit: str | None) -> None:
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
    if unit is not None and unit.isascii() and unit.isprintable():
        facts["unit"] = unit
    resolution = (1 / spacing[-1], 1 / spacing[-2])
    with whole_file(target) as stream:
        tifffile.imwrite(stream, array, imagej=True, resolution=resolution, metadata=facts)


def _write_nifti(target: Any, array: NDArray[Any], spacing: tuple[float, ...], like: LabelImage | None) -> None:
    nibabel = optional("nibabel")
    held = {np.dtype(np.bool_): np.uint8, np.dtype(np.float16): np.float32, np.dtype(np.longdouble): np.float64}
    array = array.astype(held.get(array.dtype, array.dtype), copy=False)  # NIfTI does not have the others
    affine = None if like is None or like._nifti else like.affine  # a header says more
    steps = [*spacing, *[1.0] * (3 - array.ndim)]
    image = nibabel.Nifti1Image(array, np.diag([*steps, 1.0]) if affine is None else affine, dtype=array.dtype)
    if affine is None:
        image.header.set_zooms(spacing)
    data = image.to_bytes()
    if like is not None and like._nifti:
        header = nibabel.Nifti1Header(data[: image.header.sizeof_hdr])
        for name, value in like._nifti:
            header[name] = value
        data = header.binaryblock + data[len(header.binaryblock) :]
    if target.name.lower().endswith(".gz"):
        import gzip

        data = gzip.compress(data, 6, mtime=0)
    with whole_file(target) as stream:
        stream.write(data)
