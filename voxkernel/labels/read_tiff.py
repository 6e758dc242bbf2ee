"""TIFF stacks by tifffile, with the spacing that ImageJ or OME has written."""

from __future__ import annotations

import html
import logging
import re
import threading
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.labels.stored import Stored, check_axes, in_one_unit, unit_name

__all__ = ["read_tiff"]

_UNITS = ("zunit", "yunit", "unit")  # of Z, Y and X in a file of ImageJ; the last counts where one of them is missing


class _Pages:
    """A stack read page by page, for files that cannot be mapped."""

    def __init__(self, path: str, shape: tuple[int, ...], dtype: Any) -> None:
        self.path, self.shape, self.dtype = path, shape, np.dtype(dtype)
        self.chunks = (1, *shape[1:])

    def __getitem__(self, box: tuple[slice, ...]) -> NDArray[Any]:
        with optional("tifffile").TiffFile(self.path) as file:
            pages = file.series[0].pages
            planes = [pages[i].asarray() for i in range(*box[0].indices(self.shape[0]))]
        return np.stack(planes)[(slice(None), *box[1:])]


class _Complaints(logging.Handler):
    """What tifffile logs in this thread of a file that is damaged, instead of raising an error."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.thread_id = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        is_damage = record.levelno >= logging.ERROR or "missing" in text or "corrupt" in text
        if is_damage and record.thread == self.thread_id:
            self.texts.append(text)


@contextmanager
def _whole() -> Generator[None]:
    """Refuse a file that tifffile would read in part, with zeros for the rest."""
    complaints, logger = _Complaints(), logging.getLogger("tifffile")
    logger.addHandler(complaints)
    try:
        yield
    finally:
        logger.removeHandler(complaints)
    if complaints.texts:
        raise ValueError(complaints.texts[0])


def read_tiff(path: str, _: str) -> Stored:
    """Map the file, or read it by pages."""
    tifffile = optional("tifffile")
    with _whole(), tifffile.TiffFile(path) as file:
        series = file.series[0]
        if "S" in series.axes and series.shape[series.axes.index("S")] > 1:
            raise ValueError(f"an image of colours, not of labels: axes {series.axes}")
        kept = [k for k, n in enumerate(series.shape) if n > 1] if len(series.shape) > 3 else range(len(series.shape))
        axes = "".join(series.axes[k] for k in kept)
        shape = tuple(int(series.shape[k]) for k in kept)
        if len(kept) <= 3:
            check_axes(axes.replace("C", "Q") if _is_stack(file) else axes, shape)
        stored = _ome_spacing(file, axes) if file.is_ome else _imagej_spacing(file, axes)
        n_pages, dtype = len(series.pages), series.dtype
        is_plain = series.dataoffset is not None
        whole = None
        if not is_plain and not (len(shape) == 3 and n_pages == shape[0]):
            whole = series.asarray().reshape(shape)
    if whole is None:
        whole = tifffile.memmap(path, mode="r", series=0).reshape(shape) if is_plain else _Pages(path, shape, dtype)
    return stored._replace(voxels=whole)


def _is_stack(file: Any) -> bool:
    """Whether the channels of a file may be slices: tifffile writes so as ImageJ where it is not told the axes."""
    return bool(file.imagej_metadata) and file.imagej_metadata.get("mode") == "grayscale"


def _imagej_spacing(file: Any, axes: str) -> Stored:
    """Slices are apart by `spacing`; a resolution counts pixels per unit. Only files of ImageJ say what is meant."""
    facts = file.imagej_metadata
    if not facts:
        return Stored(None)
    tags = file.pages[0].tags
    known: dict[str, float] = {}
    for axis, tag in (("X", "XResolution"), ("Y", "YResolution")):
        if tag in tags:
            above, below = tags[tag].value
            if above > 0 and below > 0:
                known[axis] = below / above
    if facts.get("spacing"):
        known["Z"] = abs(float(facts["spacing"]))
    names = [axis if axis in "YXC" else "Z" for axis in axes]
    if not all(name in known for name in names):
        return Stored(None)
    units = {axis: unit_name(facts.get(key) or facts.get("unit")) for axis, key in zip("ZYX", _UNITS, strict=True)}
    return in_one_unit(None, [known[name] for name in names], [units[name] for name in names])


def _ome_spacing(file: Any, axes: str) -> Stored:
    """`PhysicalSizeX` and the like of the first image, lengths in micrometres: OME's unit where none is given."""
    pixels = re.search(r"<(?:\w+:)?Pixels\b[^>]*>", file.ome_metadata or "")
    if pixels is None:
        return Stored(None)
    steps: list[float] = []
    units: list[str | None] = []
    for axis in axes:
        size = re.search(rf'\bPhysicalSize{axis}="([^"]+)"', pixels[0])
        if size is None:
            return Stored(None)
        unit = re.search(rf'\bPhysicalSize{axis}Unit="([^"]+)"', pixels[0])
        steps.append(float(size[1]))
        units.append(unit_name(html.unescape(unit[1])) if unit else "um")
    return in_one_unit(None, steps, units, micrometres=True)
