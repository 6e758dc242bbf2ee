"""Lines of numbers, each with its place in the file, so that an error can name the line."""

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["TextLines", "parse_rows", "ranges", "text_lines", "whole_numbers"]


class TextLines(NamedTuple):
    """Lines that are not blank, and their numbers in the file."""

    texts: list[str]
    numbers: NDArray[np.int64]

    def part(self, start: int, stop: int) -> "TextLines":
        """Some of the lines."""
        return TextLines(self.texts[start:stop], self.numbers[start:stop])

    def rows(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """All numbers in a row and how many each line holds; ValueError names the line that holds none."""
        try:
            return parse_rows(self.texts)
        except ValueError:
            for text, number in zip(self.texts, self.numbers.tolist(), strict=True):
                for word in text.split():
                    if not _is_number(word):
                        raise ValueError(f"line {number}: could not convert '{word[:40]}' to a number") from None
            raise

    def refuse(self, wrong: NDArray[np.bool_], what: str) -> None:
        """Raise ValueError with the first line that is wrong, if there is one."""
        if wrong.any():
            raise ValueError(f"line {self.numbers[int(wrong.argmax())]}: {what}")


def text_lines(data: bytes, *, comment: str = "", first: int = 1) -> TextLines:
    """Lines of a text, without what follows `comment`; any line ends, no control characters."""
    control = re.search(rb"[\0-\x08\x0e-\x1f\x7f]", data)
    if control is not None:
        number = first + len(re.findall(rb"\r\n|\r|\n", data[: control.start()]))
        raise ValueError(f"line {number}: it holds the byte {control[0][0]}, which is no text")
    text = data.decode("ascii", "replace").replace("\r\n", "\n").replace("\r", "\n")
    if comment and comment in text:
        text = re.sub(f"{comment}[^\n]*", "", text)
    lines = text.split("\n")
    kept = [(line, k) for k, line in enumerate(lines, first) if line and not line.isspace()]
    return TextLines([line for line, _ in kept], np.array([k for _, k in kept], dtype=np.int64))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word


def parse_rows(lines: list[str]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All numbers of some lines in a row, correctly rounded, and how many each line holds."""
    if not any(line.strip() for line in lines):
        return np.zeros(0), np.zeros(len(lines), dtype=np.int64)
    try:
        table = np.loadtxt(lines, dtype=np.float64, comments=None, ndmin=2)
        if len(table) == len(lines):
            return table.reshape(-1), np.full(len(table), table.shape[1], dtype=np.int64)
    except ValueError:  # lines of different lengths, or no numbers, which the slower way names
        pass
    if any("_" in line for line in lines):  # which Python takes for part of a number
        raise ValueError("could not convert a word with _ to a number")
    rows = [line.split() for line in lines]
    width = np.fromiter(map(len, rows), dtype=np.int64, count=len(rows))
    return np.array([word for row in rows for word in row], dtype=np.float64), width


def whole_numbers(values: NDArray[Any]) -> NDArray[np.int64]:
    """Indices of any dtype as int64; refused where a float is not whole or a number is too large."""
    if values.dtype.kind == "f" or values.dtype.itemsize == 8:
        whole = (values == np.trunc(values)) & (np.abs(values) < 2.0**53)
        if not whole.all():
            raise ValueError(f"index {values[~whole][0]} is not a whole number below 2**53")
    return values.astype(np.int64)


def ranges(starts: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Concatenated `start .. start + size`."""
    before = np.cumsum(sizes) - sizes
    return np.repeat(starts - before, sizes) + np.arange(int(sizes.sum()))
