"""Surface files as programs write them, read in stretches by the core, so that no file is held whole.

The core gives up where something in a file is unusual, right or wrong: then the parser of the format reads it, which
knows all of the format and names the line. What both read is the same to the last bit.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import ElementRows, ObjReader, StlReader
from voxkernel.mesh.obj import PASSED_OVER
from voxkernel.mesh.ply import INDEX_NAMES, Element, Polygons, parse_header

__all__ = ["read_usual"]

_STRETCH = 1 << 22
_MOST_HEADER = 1 << 16
_OFF_HEAD = re.compile(
    rb"OFF[ \t]*(?:\r\n|[\r\n])[ \t]*([0-9]{1,18})[ \t]+([0-9]{1,18})[ \t]+[0-9]{1,18}[ \t]*(?=[\r\n])"
)
# Behind the indices of a face: nothing, the number of a colour, or a colour with or without transparency.
_FACE_EXTRA = 1 << 0 | 1 << 1 | 1 << 3 | 1 << 4


class _Reader(Protocol):
    def feed(self, data: NDArray[np.uint8], is_last: bool) -> int: ...


def read_usual(file: Path) -> Polygons | None:
    """Read a file by its suffix; None where something in it is unusual, whatever it is."""
    read = {".ply": _ply, ".off": _off, ".obj": _obj, ".stl": _stl}.get(file.suffix.lower())
    if read is None:
        return None
    with file.open("rb") as stream:
        return read(_Stretches(stream), file.stat().st_size)


class _Stretches:
    """The bytes of a file that have not been used yet."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._left = b""
        self._is_last = False

    def start(self, size: int) -> bytes:
        """At least so many bytes of the start, if the file has them; they are not used by that."""
        if len(self._left) < size and not self._is_last:
            self._read(size - len(self._left))
        return self._left[:size]

    def use(self, size: int) -> None:
        self._left = self._left[size:]

    def feed(self, reader: _Reader) -> bool:
        """Give a reader all that is left; False where it gave up, or something remains."""
        while self._give(reader):
            if self._is_last:
                return not self._left
            self._read_more()
        return False

    def feed_rows(self, reader: ElementRows) -> bool:
        """Give a reader what is left up to its last row; False where it gave up, or a row is missing."""
        while self._give(reader):
            if reader.rows_left == 0 or self._is_last:
                return reader.rows_left == 0
            self._read_more()
        return False

    def _give(self, reader: _Reader) -> bool:
        used = reader.feed(np.frombuffer(self._left, np.uint8), self._is_last)
        self._left = self._left[max(0, used) :]
        return used >= 0

    def rest(self, *, blank: bool) -> bool:
        """Whether nothing is left, or nothing but white space."""
        while True:
            if self._left.strip() if blank else self._left:
                return False
            if self._is_last:
                return True
            self._left = b""
            self._read(_STRETCH)

    def _read_more(self) -> None:
        self._read(max(_STRETCH, len(self._left)))  # a line may be longer than a stretch

    def _read(self, size: int) -> None:
        more = self._stream.read(size)
        self._left += more
        self._is_last = len(more) < size


def _obj(file: _Stretches, _: int) -> Polygons | None:
    reader = ObjReader(sorted(PASSED_OVER))
    return Polygons(*reader.take()) if file.feed(reader) and reader.is_whole else None


def _stl(file: _Stretches, size: int) -> Polygons | None:
    """Only text; a file that has the length of a binary one is one."""
    start = file.start(84)
    if len(start) == 84 and size == 84 + 50 * int.from_bytes(start[80:], "little"):
        return None
    reader = StlReader()
    return Polygons(*reader.take()) if file.feed(reader) and reader.is_whole else None


def _off(file: _Stretches, _: int) -> Polygons | None:
    head = _OFF_HEAD.match(file.start(_MOST_HEADER))
    if head is None:
        return None
    file.use(head.end())
    n_vertices, n_faces = int(head[1]), int(head[2])
    points = ElementRows([("f", 8, "", 0, role) for role in range(3)], n_vertices, "", "#", 1)
    faces = ElementRows([("i", 8, "i", 8, 3)], n_faces, "", "#", _FACE_EXTRA)
    if not (file.feed_rows(points) and file.feed_rows(faces) and file.rest(blank=True)):
        return None
    return Polygons(points.take()[0], *faces.take()[1:])


def _ply(file: _Stretches, _: int) -> Polygons | None:
    try:
        order, elements, size, _ = parse_header(file.start(_MOST_HEADER))
    except ValueError:
        return None
    file.use(size)
    points = np.zeros((0, 3))
    flat, sizes = np.zeros(0, np.int64), np.zeros(0, np.int64)
    for element in elements:
        roles = _roles(element)
        if roles is None:
            return None
        properties = [
            (item.dtype[0], int(item.dtype[1]), item.count_dtype[:1], int(item.count_dtype[1:] or 0), role)
            for item, role in zip(element.properties, roles, strict=True)
        ]
        rows = ElementRows(properties, element.n, order, "", 1)
        if element.n and not file.feed_rows(rows):
            return None
        if element.name == "vertex":
            points = rows.take()[0]
        elif element.name == "face":
            flat, sizes = rows.take()[1:]
    return Polygons(points, flat, sizes) if file.rest(blank=not order) else None


def _roles(element: Element) -> list[int] | None:
    """What each property is good for: 0 to 2 a coordinate, 3 the indices, -1 nothing; None where they are not there."""
    roles = [-1] * len(element.properties)
    if element.n == 0 or element.name not in ("vertex", "face"):
        return roles
    try:
        wanted = [element.find(name) for name in "xyz"] if element.name == "vertex" else [element.find(*INDEX_NAMES)]
    except ValueError:
        return None
    for role, position in enumerate(wanted, 0 if element.name == "vertex" else 3):
        if bool(element.properties[position].count_dtype) != (role == 3):
            return None
        roles[position] = role
    return roles
