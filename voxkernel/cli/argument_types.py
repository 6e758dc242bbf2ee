"""Types of options that several commands have: text -> a value, or one line that names what was expected."""

from __future__ import annotations

import argparse
from collections.abc import Callable

__all__ = ["direction", "whole"]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def whole(low: int, high: int) -> Callable[[str], int]:
    """Make the type of whole numbers from `low` to `high`."""

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = low - 1
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"must be a whole number from {low} to {high}; got {text}")
        return value

    return read


def direction(text: str) -> tuple[float, float, float]:
    """The type of directions: an axis, x, y or z, also with a minus sign, or three numbers."""
    axis = text.strip().lower()
    if axis.lstrip("+-") in _AXES and len(axis) <= 2:
        x, y, z = _AXES[axis[-1]]
        return (-x, -y, -z) if axis[0] == "-" else (x, y, z)
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3 or not any(values) or not all(abs(v) < float("inf") for v in values):
        raise argparse.ArgumentTypeError(f"must be x, y, z, or three numbers X,Y,Z, not all 0; got {text}")
    return values[0], values[1], values[2]
