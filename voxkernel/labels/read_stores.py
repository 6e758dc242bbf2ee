"""Files of NumPy and HDF5: arrays, some of them with a name and a spacing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel.labels.stored import Stored

__all__ = ["read_hdf5", "read_npy", "read_npz"]


def read_npy(path: str, _: str) -> Stored:
    """Map the file."""
    return Stored(np.load(path, mmap_mode="r", allow_pickle=False))


def read_npz(path: str, inside: str) -> Stored:
    """Read one array, and an array `spacing` where there is one."""
    with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
        names = [name for name in file.files if name != "spacing"]
        array = file[_the_one(names, inside)]
        return Stored(array, file["spacing"].tolist() if "spacing" in file.files else None)


def read_hdf5(path: str, inside: str) -> Stored:
    """Open a data set; `element_size_um` (ilastik, PlantSeg) or `spacing` of it are its spacing."""
    h5py = optional("h5py")
    file = h5py.File(path, "r")
    names: list[str] = []

    def note(name: str, thing: Any) -> None:
        if isinstance(thing, h5py.Dataset):
            names.append(name)

    file.visititems(note)
    data = file[_the_one(names, inside)]
    for attribute in ("element_size_um", "spacing"):
        if attribute in data.attrs:
            steps = [float(n) for n in np.ravel(data.attrs[attribute])]
            return Stored(data, steps, "um" if attribute.endswith("_um") else None)
    return Stored(data)


def _the_one(names: Sequence[str], inside: str) -> str:
    """The array that is asked for, or the only one."""
    if inside:
        if inside not in names:
            raise ValueError(f"no array {json.dumps(inside)} in it, but {', '.join(names) or 'none'}")
        return inside
    if len(names) != 1:
        listed = ", ".join(names[:8]) or "none"
        raise ValueError(f"name one of its arrays behind '::'; there are {listed}")
    return names[0]
