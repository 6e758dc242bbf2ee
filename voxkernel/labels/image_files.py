"""Files of label images: which reader takes which, and what is said when one fails."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from voxkernel._input_file import input_file
from voxkernel.errors import GridReadError, VoxKernelError
from voxkernel.labels.label_image import LabelImage
from voxkernel.labels.read_medical import read_nifti, read_nrrd
from voxkernel.labels.read_stores import read_hdf5, read_npy, read_npz
from voxkernel.labels.read_tiff import read_tiff
from voxkernel.labels.read_zarr import read_zarr
from voxkernel.labels.stored import Stored

__all__ = ["SUFFIXES", "is_label_file", "read_labels"]

_READERS = {
    ".tif": read_tiff, ".tiff": read_tiff, ".nii": read_nifti, ".nii.gz": read_nifti, ".nrrd": read_nrrd,
    ".npy": read_npy, ".npz": read_npz, ".h5": read_hdf5, ".hdf5": read_hdf5, ".zarr": read_zarr,
}  # fmt: skip
SUFFIXES = tuple(_READERS)
_INSIDE = {".h5", ".hdf5", ".zarr", ".npz"}  # files that hold several arrays, named behind "::"


def is_label_file(path: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a label image, with or without the name of an array inside."""
    return _suffix(_parted(os.fspath(path))[0]) in _READERS


def read_labels(path: str | os.PathLike[str], *, spacing: Sequence[float] | None = None) -> LabelImage:
    """Open a label image; its voxels are read when they are needed, in boxes where the format allows.

    Parameters
    ----------
    path : path
        `.tif` (of ImageJ, OME or plain), `.nii`, `.nii.gz`, `.nrrd`, `.npy`, `.npz`, `.h5` or `.zarr` (OME-Zarr).
        Behind ``::`` the array within a `.h5`, `.zarr` or `.npz`, as ``cells.h5::volumes/labels``; needed where there
        are several. Of an OME-Zarr image with a group `labels` its label image is read, not its intensities; where it
        has several, ``image.zarr::labels/nuclei`` names one.
    spacing : sequence of float, optional
        Distance of voxel centres along each axis, in the order of the axes; by default what the file stores.

    Returns
    -------
    LabelImage
        Two or three axes in the order of the file: (z, y, x) for `.tif`, `.h5` and OME-Zarr as a rule, (x, y, z) for
        `.nii` and `.nrrd`. Axes of length 1 beyond those are left out.

    Raises
    ------
    GridReadError
        If the file is missing, damaged, or no label image.
    MissingExtraError
        If the package that reads it is not installed: the extra `labels`.
    ValueError
        If the image has more than three axes, or no spacing is stored and none is given, or it does not fit.

    Notes
    -----
    Read in boxes: `.npy`, uncompressed `.tif` and `.nii`, by pages other `.tif`, by chunks `.h5` and `.zarr`. Held
    whole: `.nii.gz`, `.nrrd` and `.npz`.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(folder + "/labels.npy", np.ones((4, 5), dtype=np.uint8))
    ...     image = read_labels(folder + "/labels.npy", spacing=(2, 1))
    ...     print(image.shape, image.spacing, image.to_array().sum())
    (4, 5) (2.0, 1.0) 20
    """
    if not isinstance(path, str | os.PathLike):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"`path` must be a path; got {type(path).__name__}")
    name, inside = _parted(os.fspath(path))
    suffix = _suffix(name)
    if suffix not in _READERS:
        raise GridReadError(f"`path` must end in one of {', '.join(SUFFIXES)}; got '{name}'")
    if inside and suffix not in _INSIDE:
        raise GridReadError(f"`path` must name an array behind '::' only in .h5, .zarr and .npz; got '{path}'")
    if suffix == ".zarr":
        if not Path(name).is_dir():
            raise GridReadError(f"`path` must be an existing folder for OME-Zarr; got '{name}'")
    elif not input_file(name, GridReadError).stat().st_size:
        raise GridReadError(f"'{name}' cannot be read as {suffix}: the file is empty")
    try:
        stored = _READERS[suffix](name, inside)
    except VoxKernelError:
        raise
    except Exception as error:  # every library has its own for a damaged file
        words = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}".removesuffix(": ")
        if isinstance(error, StopIteration | EOFError):
            words = "the file ends too early"
        raise GridReadError(f"'{name}' cannot be read as {suffix}: {words}") from error
    return _image(name, stored, spacing)


def _image(name: str, stored: Stored, spacing: Sequence[float] | None) -> LabelImage:
    """Check what was read."""
    steps = stored.spacing if spacing is None else spacing
    if steps is None:
        raise ValueError(f"`spacing` must be given: '{name}' {stored.without}")
    try:
        image = LabelImage.from_array(stored.voxels, spacing=steps)
    except (TypeError, ValueError) as error:
        raise type(error)(f"'{name}': {error}") from None
    return replace(image, affine=stored.affine, unit=stored.unit, _nifti=stored.nifti)


def _parted(path: str) -> tuple[str, str]:
    name, _, inside = path.partition("::")
    return name, inside.strip("/")


def _suffix(name: str) -> str:
    lower = name.rstrip("/\\").lower()
    found = re.search(r"(\.nii\.gz|\.[a-z0-9]+)$", lower)
    return found[0] if found else ""
