"""NIfTI by nibabel and NRRD by pynrrd: the spacing is in the header."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from voxkernel._extras import optional

__all__ = ["read_nifti", "read_nrrd"]


def read_nifti(path: str, _: str) -> tuple[Any, Sequence[float] | None]:
    """Give the voxels as stored, or scaled where the header scales them; axes beyond three of length 1 are left out."""
    image = optional("nibabel").load(path, mmap="r")
    shape = tuple(int(n) for n in image.shape)
    if any(n > 1 for n in shape[3:]):
        raise ValueError(f"`labels` must have 2 or 3 axes; got {len(shape)}, of shape {shape}")
    proxy = image.dataobj
    is_scaled = (proxy.slope, proxy.inter) != (1.0, 0.0)
    voxels = np.asanyarray(proxy) if is_scaled or path.lower().endswith(".gz") else proxy.get_unscaled()
    return voxels.reshape(shape[:3]), [float(n) for n in image.header.get_zooms()[: len(shape[:3])]]


def read_nrrd(path: str, _: str) -> tuple[Any, Sequence[float] | None]:
    """Give the voxels with the axes of the file, the fastest first."""
    voxels, header = optional("nrrd").read(path)
    directions = header.get("space directions")
    if directions is not None:
        lengths = np.linalg.norm(np.asarray(directions, dtype=np.float64), axis=1)
        return voxels, lengths.tolist() if np.isfinite(lengths).all() else None
    spacings = header.get("spacings")
    if spacings is None or not np.isfinite(np.asarray(spacings, dtype=np.float64)).all():
        return voxels, None
    return voxels, [float(n) for n in spacings]
