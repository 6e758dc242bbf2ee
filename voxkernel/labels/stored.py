"""What a file of a label image says about its voxels beside their labels: spacing, unit, and where they are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Stored", "check_axes", "in_one_unit", "unit_name"]


class Stored(NamedTuple):
    """The voxels of a file, and what it says about them; None where it does not."""

    voxels: Any
    spacing: Sequence[float] | None = None
    unit: str | None = None
    affine: NDArray[np.float64] | None = None  # from indices to the world of NIfTI
    nifti: tuple[tuple[str, Any], ...] = ()  # the fields of a NIfTI header that say where it lies
    without: str = "stores none"  # why there is no spacing


# Micrometres in each unit, by the name that is used here; OME's, and what else such files say.
_MICROMETRES = {
    "um": 1.0, "nm": 1e-3, "pm": 1e-6, "fm": 1e-9, "am": 1e-12, "zm": 1e-15, "ym": 1e-18, "angstrom": 1e-4, "mm": 1e3,
    "cm": 1e4, "dm": 1e5, "m": 1e6, "dam": 1e7, "hm": 1e8, "km": 1e9, "Mm": 1e12, "Gm": 1e15, "Tm": 1e18, "Pm": 1e21,
    "Em": 1e24, "Zm": 1e27, "Ym": 1e30, "thou": 25.4, "li": 25_400 / 12, "pt": 25_400 / 72, "in": 25_400.0,
    "ft": 304_800.0, "yd": 914_400.0, "mi": 1.609344e9, "ua": 1.495978707e17, "ly": 9.4607304725808e21,
    "pc": 3.0856775814913673e22,
}  # fmt: skip
_PREFIXES = {
    "nano": "n", "micro": "u", "milli": "m", "centi": "c", "deci": "d", "kilo": "k", "pico": "p", "femto": "f",
    "hecto": "h", "deca": "da", "": "",
}  # fmt: skip
_WORDS = {
    "micron": "um", "angstroms": "angstrom", "ångström": "angstrom", "å": "angstrom", "inch": "in", "inche": "in",
    "foot": "ft", "feet": "ft", "yard": "yd", "mile": "mi",
}  # fmt: skip


def check_axes(names: str, shape: Sequence[int]) -> None:
    """Refuse what is no one image of space: time points or channels would be taken for slices."""
    for letter, words in (("T", "time points"), ("C", "channels")):
        n = dict(zip(names, shape, strict=True)).get(letter, 1)
        if n > 1:
            raise ValueError(f"an image of {n} {words}, not of one volume: axes {names}; slices must be called Z")


def unit_name(words: object) -> str | None:
    """One name for all ways to write a unit, as "um" for "µm" and "micron"; None for none."""
    text = str(words or "").strip()
    text = re.sub(r"\\u([0-9a-fA-F]{4})", lambda m: chr(int(m[1], 16)), text)  # so ImageJ writes what is not ASCII
    text = text.replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
    if text in _MICROMETRES or not text:
        return text or None
    lower = text.lower()
    found = re.fullmatch(r"(\w*?)met(?:er|re)s?", lower)
    if found and found[1] in _PREFIXES:
        return f"{_PREFIXES[found[1]]}m"
    return _WORDS.get(lower, _WORDS.get(lower.removesuffix("s"), lower if lower in _MICROMETRES else text))


def in_one_unit(
    voxels: Any, spacing: Sequence[float], units: Sequence[str | None], *, micrometres: bool = False
) -> Stored:
    """A spacing whose axes are in the same unit, or none; an axis without a unit has that of the others.

    Parameters
    ----------
    voxels : array-like
        For the result.
    spacing : sequence of float
        As stored.
    units : sequence of str or None
        What `unit_name` gives, one for each axis.
    micrometres : bool
        Give lengths in micrometres also where all are in one other unit.
    """
    known = sorted({unit for unit in units if unit is not None})
    if len(known) <= 1 and not (micrometres and known and known[0] in _MICROMETRES):
        return Stored(voxels, list(spacing), known[0] if known else None)
    if not all(unit in _MICROMETRES for unit in known):
        return Stored(voxels, without=f"stores it in different units, {' and '.join(known)}")
    steps = [value * _MICROMETRES[unit or known[0]] for value, unit in zip(spacing, units, strict=True)]
    return Stored(voxels, steps, "um")
