"""Options that several commands have, and their types: text -> a value, or one line that names what was expected."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence

__all__ = ["add_up", "joined", "three_numbers", "whole"]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# Numbers between commas of which the first is negative, and axes, which argparse takes for options.
_BEGINS_WITH_MINUS = re.compile(r"-(\.?\d.*,.*|[xyz])", re.IGNORECASE)


def joined(words: Sequence[str]) -> list[str]:
    """Arguments as they are, but `--option -1,2,3` as `--option=-1,2,3`."""
    found: list[str] = []
    for word in words:
        if found and re.fullmatch(r"--[a-z][a-z-]*", found[-1]) and _BEGINS_WITH_MINUS.fullmatch(word):
            found[-1] += f"={word}"
        else:
            found.append(word)
    return found


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


def three_numbers(text: str) -> list[float] | None:
    """Three finite numbers between commas; None where it is anything else."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return values if len(values) == 3 and all(abs(v) < float("inf") for v in values) else None


def add_up(parser: argparse.ArgumentParser) -> None:
    """Declare --up of what draws: an axis, x, y or z, also with a minus sign, or three numbers."""
    parser.add_argument(
        "--up", type=_direction, metavar="AXIS", help="what points up in the picture: x, y, z, -x, -y, -z or X,Y,Z"
    )


def _direction(text: str) -> list[float]:
    axis = text.strip().lower()
    if axis.lstrip("+-") in _AXES and len(axis) <= 2:
        return [-v for v in _AXES[axis[-1]]] if axis[0] == "-" else list(_AXES[axis[-1]])
    values = three_numbers(text)
    if values is None or not any(values):
        raise argparse.ArgumentTypeError(f"must be x, y, z, or three numbers X,Y,Z, not all 0; got {text}")
    return values
