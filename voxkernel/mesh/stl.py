"""STL, text or binary: a soup of triangles."""

import re

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.ply import Polygons

__all__ = ["parse_stl"]

_FACET = re.compile(
    rb"\s*facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop"
    + rb"\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)" * 3
    + rb"\s+endloop\s+endfacet(?!\S)",
    re.IGNORECASE,
)
_BEGIN = re.compile(rb"\s*solid(?:[ \t][^\r\n]*)?(?=[\r\n]|\Z)", re.IGNORECASE)
_END = re.compile(rb"\s*end[ \t]?solid(?:[ \t][^\r\n]*)?(?=[\r\n]|\Z)", re.IGNORECASE)


def parse_stl(data: bytes) -> Polygons:
    """Triangles; binary files are recognised by their length, as they may start with 'solid'."""
    if len(data) >= 84:
        n = int.from_bytes(data[80:84], "little")
        if len(data) == 84 + 50 * n:
            layout = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
            with np.errstate(invalid="ignore"):  # a NaN may be a signalling one; none is accepted
                return _soup(np.frombuffer(data, dtype=layout, count=n, offset=84)["corners"].astype(np.float64))
    if not data.lstrip()[:5].lower() == b"solid":
        raise ValueError("neither a text file that starts with 'solid' nor a binary one of the right length")
    words: list[bytes] = []
    at, is_open = 0, False
    while True:
        found = _FACET.match(data, at) if is_open else None
        if found is not None:
            words += found.groups()
        else:
            found = (_END if is_open else _BEGIN).match(data, at)
            if found is None:
                break
            is_open = not is_open
        at = found.end()
    left = data[at:].lstrip()
    if is_open or left:
        wanted = "a facet of three corners or endsolid" if is_open else "solid or the end of the file"
        raise ValueError(f"line {_line(data, len(data) - len(left))}: here must be {wanted}")
    try:
        if any(b"_" in word for word in words):
            raise ValueError
        return _soup(np.array([float(word) for word in words], dtype=np.float64))
    except ValueError:
        place, word = next(
            (found.start(k), found[k])
            for found in _FACET.finditer(data)
            for k in range(1, 10)
            if not _is_number(found[k])
        )
        text = word[:40].decode("ascii", "replace")
        raise ValueError(f"line {_line(data, place)}: could not convert '{text}' to a number") from None


def _line(data: bytes, at: int) -> int:
    return 1 + len(re.findall(rb"\r\n|\r|\n", data[:at]))


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def _soup(corners: NDArray[np.float64]) -> Polygons:
    points = corners.reshape(-1, 3)
    return Polygons(points, np.arange(len(points), dtype=np.int64), np.full(len(points) // 3, 3, dtype=np.int64))
