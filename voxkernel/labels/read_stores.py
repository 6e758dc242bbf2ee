"""Files of NumPy, HDF5 and OME-Zarr: arrays, some of them with a name and a spacing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from voxkernel._extras import optional

__all__ = ["read_hdf5", "read_npy", "read_npz", "read_zarr"]


def read_npy(path: str, _: str) -> tuple[Any, Sequence[float] | None]:
    """Map the file."""
    return np.load(path, mmap_mode="r", allow_pickle=False), None


def read_npz(path: str, inside: str) -> tuple[Any, Sequence[float] | None]:
    """Read one array, and an array `spacing` where there is one."""
    with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
        names = [name for name in file.files if name != "spacing"]
        array = file[_the_one(names, inside)]
        return array, file["spacing"].tolist() if "spacing" in file.files else None


def read_hdf5(path: str, inside: str) -> tuple[Any, Sequence[float] | None]:
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
            return data, [float(n) for n in np.ravel(data.attrs[attribute])]
    return data, None


def read_zarr(path: str, inside: str) -> tuple[Any, Sequence[float] | None]:
    """Open an array, or the finest one of an OME-Zarr image, with the spacing of its `multiscales`."""
    zarr = optional("zarr")
    thing = zarr.open(path, mode="r")
    if inside and not isinstance(thing, zarr.Array):
        thing = thing[inside]
    if isinstance(thing, zarr.Array):
        spacing = thing.attrs.get("spacing")
        return thing, None if spacing is None else [float(n) for n in spacing]  # pyright: ignore
    attributes = dict(thing.attrs)
    scales = attributes.get("multiscales") or dict(attributes.get("ome") or {}).get("multiscales")  # pyright: ignore
    if scales:
        finest = scales[0]["datasets"][0]
        array = thing[finest["path"]]
        steps = [t["scale"] for t in finest.get("coordinateTransformations", []) if t["type"] == "scale"]
        return _without_extra_axes(array, [float(n) for n in steps[0]] if steps else None)
    groups = dict(thing.groups())
    if "labels" in groups:  # an OME-Zarr image keeps its label images there
        return read_zarr_group(path, groups["labels"])
    return thing[_the_one([name for name, _ in thing.arrays()], inside)], None


def read_zarr_group(path: str, labels: Any) -> tuple[Any, Sequence[float] | None]:
    """The one label image of an OME-Zarr image."""
    name = _the_one(sorted(name for name, _ in labels.groups()), "")
    return read_zarr(path, f"labels/{name}")


class _Squeezed:
    """A view of an array with leading axes of length 1, such as time and channel, without those."""

    def __init__(self, array: Any, n: int) -> None:
        self.array, self.n, self.dtype = array, n, array.dtype
        self.shape, self.chunks = tuple(array.shape[n:]), tuple(array.chunks[n:])

    def __getitem__(self, box: tuple[slice, ...]) -> Any:
        return self.array[(0,) * self.n + tuple(box)]


def _without_extra_axes(array: Any, spacing: list[float] | None) -> tuple[Any, list[float] | None]:
    n = len(array.shape) - 3
    if n <= 0 or any(m != 1 for m in array.shape[:n]):
        return array, spacing
    return _Squeezed(array, n), None if spacing is None else spacing[n:]


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
