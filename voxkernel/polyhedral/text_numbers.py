"""Numbers in text files, with the line of the first that is wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["as_count", "as_numbers", "as_whole", "split_lines"]

_CONTROL = re.compile("[\0-\x08\x0e-\x1f\x7f]")


def split_lines(text: str) -> list[list[str]]:
    """The words of every line without its comment, lines counted as editors count them; no control characters."""
    control = _CONTROL.search(text)  # of some of them Python says that they part words
    if control is not None:
        line = 1 + text.count("\n", 0, control.start())
        raise ValueError(f"line {line}: it holds the byte {control[0].encode()}, which is no text")
    return [line.partition("#")[0].split() for line in text.split("\n")]


def as_numbers(words: Sequence[str], lines: NDArray[np.int64]) -> NDArray[np.float64]:
    """All words as finite numbers, correctly rounded; `lines` are their line numbers, for the error."""
    try:
        values = np.array([float(word) for word in words], dtype=np.float64)
        is_clean = bool(np.isfinite(values).all()) and not any("_" in word for word in words)
    except ValueError:
        values, is_clean = np.zeros(0), False
    if not is_clean:
        for word, line in zip(words, lines.tolist(), strict=True):
            if not _is_number(word):
                raise ValueError(f"line {line}: '{word[:40]}' is not a finite number")
    return values


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word)) and "_" not in word
    except ValueError:
        return False


def as_count(word: str, line: int, what: str) -> int:
    """A number of rows, written in digits."""
    if not (word.isascii() and word.isdigit() and len(word) <= 18):
        raise ValueError(
            f"line {line}: the number of {what} must be a whole number of at most 18 digits; got '{word[:40]}'"
        )
    return int(word)


def as_whole(
    values: NDArray[np.float64], lines: NDArray[np.int64], low: int, high: int, what: str
) -> NDArray[np.int64]:
    """Whole numbers in low .. high; `lines` has the line of each."""
    wrong = np.flatnonzero(~((values == np.trunc(values)) & (values >= low) & (values <= high)))
    if len(wrong):
        at = int(wrong[0])
        raise ValueError(f"line {lines[at]}: a {what} must be a whole number in {low}..{high}; got {values[at]:.17g}")
    return values.astype(np.int64)
