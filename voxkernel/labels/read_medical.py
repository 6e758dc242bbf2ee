"""NIfTI by nibabel and NRRD by pynrrd: the header says how far apart the voxels are, and where they lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.labels.stored import Stored, unit_name

__all__ = ["read_nifti", "read_nrrd"]

# What says where a NIfTI image lies. Copied to its maps as it is, so that every reader puts both in the same place.
_PLACE = (
    "pixdim", "xyzt_units", "qform_code", "sform_code", "quatern_b", "quatern_c", "quatern_d", "qoffset_x",
    "qoffset_y", "qoffset_z", "srow_x", "srow_y", "srow_z",
)  # fmt: skip
_UNITS = {1: "m", 2: "mm", 3: "um"}
# To NIfTI's world, x to the right, y to the front, z up. A world that NRRD does not name is taken as ITK takes it, as
# that of DICOM.
_TO_NIFTI = {"right-anterior-superior": (1, 1), "ras": (1, 1), "left-anterior-superior": (-1, 1), "las": (-1, 1)}
_DICOM = (-1, -1)


def read_nifti(path: str, _: str) -> Stored:
    """Give the voxels as stored, or scaled where the header scales them; axes beyond three of length 1 are left out."""
    image = optional("nibabel").load(path, mmap="r")
    shape = tuple(int(n) for n in image.shape)
    if any(n > 1 for n in shape[3:]):
        raise ValueError(f"`labels` must have 2 or 3 axes; got {len(shape)}, of shape {shape}")
    proxy = image.dataobj
    is_scaled = (proxy.slope, proxy.inter) != (1.0, 0.0)
    voxels = np.asanyarray(proxy) if is_scaled or path.lower().endswith(".gz") else proxy.get_unscaled()
    header = image.header
    place = tuple((name, np.asarray(header[name]).tolist()) for name in _PLACE)
    return Stored(
        voxels.reshape(shape[:3]),
        [float(n) for n in header.get_zooms()[: len(shape[:3])]],
        _UNITS.get(int(header["xyzt_units"]) % 8),
        _finite(np.array(image.affine, dtype=np.float64)),
        tuple((name, tuple(value) if isinstance(value, list) else value) for name, value in place),
    )


def read_nrrd(path: str, _: str) -> Stored:
    """Give the voxels with the axes of the file, the fastest first."""
    voxels, header = optional("nrrd").read(path)
    directions = header.get("space directions")
    units = header.get("space units" if directions is not None else "units")
    known = {unit_name(unit) for unit in units or ()}
    unit = known.pop() if len(known) == 1 else None
    if directions is not None:
        steps = np.asarray(directions, dtype=np.float64)
        lengths = np.linalg.norm(steps, axis=1)
        if not np.isfinite(lengths).all():
            return Stored(voxels)
        return Stored(voxels, lengths.tolist(), unit, _affine(steps, header))
    spacings = header.get("spacings")
    if spacings is None or not np.isfinite(np.asarray(spacings, dtype=np.float64)).all():
        return Stored(voxels)
    numbers = [float(n) for n in spacings]
    return Stored(voxels, numbers, unit, _affine(np.diag(numbers), header))


def _affine(steps: NDArray[np.float64], header: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """From indices to NIfTI's world; each row of `steps` is what one axis adds to the place."""
    n_axes, n_world = steps.shape
    if n_axes > 3 or n_world > 3:
        return None
    origin: Sequence[float] | None = header.get("space origin")
    affine = np.eye(4)
    affine[:n_world, :n_axes] = steps.T
    affine[:n_world, 3] = 0.0 if origin is None else origin
    if n_axes == 2 and n_world == 3:
        normal = np.cross(steps[0], steps[1])
        affine[:3, 2] = normal / np.linalg.norm(normal)
    world = str(header.get("space", "")).lower().removesuffix("-time").removesuffix("t")
    affine[:2] *= np.array(_TO_NIFTI.get(world, _DICOM), dtype=np.float64)[:, None]
    return _finite(affine + 0.0)  # no -0.0


def _finite(affine: NDArray[np.float64]) -> NDArray[np.float64] | None:
    return affine if np.isfinite(affine).all() else None
