"""Zarr arrays and OME-Zarr images by zarr: which of the arrays of a store holds labels, and its spacing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from voxkernel._extras import optional
from voxkernel.labels.stored import Stored, check_axes, in_one_unit, unit_name

__all__ = ["read_zarr"]


def read_zarr(path: str, inside: str) -> Stored:
    """Open an array, or the finest one of an OME-Zarr label image, with the spacing of its `multiscales`."""
    zarr = optional("zarr")
    store = zarr.open(path, mode="r")
    if not inside:
        return _array(store, [], "") if isinstance(store, zarr.Array) else _of_group(store, "")
    if isinstance(store, zarr.Array) or inside not in store:
        raise ValueError(f"nothing called '{inside}' in it, but {_listed(_members(store))}")
    thing = store[inside]
    if not isinstance(thing, zarr.Array):
        return _of_group(thing, inside)
    parts = inside.split("/")
    above: list[tuple[Any, str]] = []  # groups around the array, the nearest first, and what they call it
    for k in reversed(range(len(parts))):
        where = "/".join(parts[:k])
        if not where or where in store:
            above.append((store[where] if where else store, "/".join(parts[k:])))
    return _array(thing, above, inside)


def _of_group(group: Any, where: str) -> Stored:
    """A label image, that of an image, the only one of the group `labels`, or the only thing there is."""
    scales = _multiscales(group)
    labels = group["labels"] if "labels" in group and hasattr(group["labels"], "groups") else None
    if labels is not None and "image-label" not in _facts(group):
        return _only(labels, _names(labels), f"{where}/labels".lstrip("/"), "label images")
    if scales is not None:
        name = str(scales["datasets"][0]["path"])
        return _array(group[name], [(group, name)], f"{where}/{name}".lstrip("/"))
    return _only(group, _names(group), where, "label images" if "labels" in _facts(group) else "arrays")


def _only(group: Any, names: Sequence[str], where: str, kind: str) -> Stored:
    """The one thing of a group, or a line that lists what there is."""
    paths = [f"{where}/{name}".lstrip("/") for name in names]
    if len(names) != 1:
        raise ValueError(f"name one of its {kind} behind '::'; there are {_listed(paths)}")
    thing = group[names[0]]
    return _of_group(thing, paths[0]) if hasattr(thing, "groups") else _array(thing, [(group, names[0])], paths[0])


def _names(group: Any) -> list[str]:
    """Arrays, images, and label images that a group `labels` lists."""
    listed = _facts(group).get("labels")
    names = [str(name) for name in cast("list[Any]", listed) if str(name) in group] if isinstance(listed, list) else []
    names += sorted(name for name, _ in group.arrays())
    names += sorted(name for name, inner in group.groups() if _multiscales(inner) is not None)
    return list(dict.fromkeys(names))


def _members(thing: Any) -> list[str]:
    return sorted(thing) if hasattr(thing, "groups") else []


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "") or "none"


def _facts(group: Any) -> Mapping[str, Any]:
    """Attributes; from version 0.5 of OME-Zarr on they are in `ome`."""
    attributes = dict(group.attrs)
    inner = attributes.get("ome")
    return {**attributes, **inner} if isinstance(inner, dict) else attributes


def _multiscales(group: Any) -> Mapping[str, Any] | None:
    scales = _facts(group).get("multiscales")
    return scales[0] if scales else None


def _array(array: Any, above: Sequence[tuple[Any, str]], where: str) -> Stored:
    """An array with its own spacing, or that which an image around it gives."""
    n_axes = len(array.shape)
    own = array.attrs.get("spacing")
    spacing, axes = None if own is None else [float(n) for n in own], []
    for group, name in above if own is None else ():
        scales = _multiscales(group)
        found = [d for d in scales["datasets"] if str(d["path"]).strip("/") == name] if scales else []
        if scales and found:
            both = [*found[0].get("coordinateTransformations", []), *scales.get("coordinateTransformations", [])]
            spacing = _scale(both, n_axes)
            axes = [axis if isinstance(axis, dict) else {"name": axis} for axis in scales.get("axes", [])]
            break
    n = _extra_axes(array.shape)
    voxels = _Squeezed(array, n) if n else array
    if len(axes) == n_axes and n_axes - n <= 3:
        check_axes("".join(map(_letter, axes[n:])), array.shape[n:])
    if spacing is None:
        return Stored(voxels)
    units = [unit_name(axis.get("unit")) for axis in axes] if len(axes) == n_axes else [None] * n_axes
    return in_one_unit(voxels, spacing[n:], units[n:])


def _scale(transformations: Sequence[Mapping[str, Any]], n_axes: int) -> list[float] | None:
    """All scales one after the other: that of the array, then that of the image."""
    steps = [t.get("scale") for t in transformations if t["type"] == "scale"]
    if not steps or any(not isinstance(step, list) or len(cast("list[Any]", step)) != n_axes for step in steps):
        return None
    spacing = [1.0] * n_axes
    for step in steps:
        spacing = [a * float(b) for a, b in zip(spacing, cast("list[Any]", step), strict=True)]
    return spacing


class _Squeezed:
    """A view of an array with leading axes of length 1, such as time and channel, without those."""

    def __init__(self, array: Any, n: int) -> None:
        self.array, self.n, self.dtype = array, n, array.dtype
        self.shape, self.chunks = tuple(array.shape[n:]), tuple(array.chunks[n:])

    def __getitem__(self, box: tuple[slice, ...]) -> Any:
        return self.array[(0,) * self.n + tuple(box)]


def _letter(axis: Mapping[str, Any]) -> str:
    """T for time, C for channels, else what the axis is called."""
    name = str(axis.get("name") or "?")
    kind = str(axis.get("type") or {"t": "time", "c": "channel"}.get(name, ""))
    return {"time": "T", "channel": "C"}.get(kind, name[:1].upper().translate({84: "?", 67: "?"}))


def _extra_axes(shape: Sequence[int]) -> int:
    """How many leading axes of length 1 there are beyond three."""
    n = max(0, len(shape) - 3)
    return n if all(m == 1 for m in shape[:n]) else 0
