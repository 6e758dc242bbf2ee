"""Surface files as programs write them, read in stretches by the core, so that no file is held whole.

The core gives up where something in a file is unusual, right or wrong: then the parser of the format reads it, which
knows all of the format and names the line. What both read is the same to the last bit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import ElementRows, ObjReader, StlReader
from voxkernel.mesh.obj import PASSED_OVER
from voxkernel.mesh.ply import INDEX_NAMES, Element, Polygons, parse_header

__all__ = ["PolygonParts", "read_usual", "usual_parts"]

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


class PolygonParts(NamedTuple):
    """What a stretch of a file adds: points, vertex ids of polygons and the sizes of these; of a soup only points."""

    points: NDArray[np.float64]
    flat: NDArray[np.int64]
    sizes: NDArray[np.int64]


def usual_parts(file: Path) -> Iterator[PolygonParts | None]:
    """Read a file by its suffix, part by part; None where something in it is unusual, and nothing after that.

    The vertex ids are those of the whole file. Text ``.stl`` is a soup: three points a triangle, and no ids.
    """
    parts = {".ply": _ply_parts, ".off": _off_parts, ".obj": _obj_parts, ".stl": _stl_parts}[file.suffix.lower()]
    with file.open("rb") as stream:
        yield from parts(_Stretches(stream))


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

    def parts(self, reader: ObjReader | StlReader) -> Iterator[PolygonParts | None]:
        """What a reader makes of each stretch; None where it gave up, or something remains."""
        while self._give(reader):
            yield PolygonParts(*reader.take())
            if self._is_last:
                if self._left or not reader.is_whole:
                    break
                return
            self._read_more()
        yield None

    def row_parts(self, reader: ElementRows) -> Iterator[PolygonParts | None]:
        """The same up to the last row; None where a row is missing."""
        while reader.rows_left:
            if not self._give(reader):
                break
            yield PolygonParts(*reader.take())
            if reader.rows_left and self._is_last:
                break
            if reader.rows_left:
                self._read_more()
        else:
            return
        yield None

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


def _obj_parts(file: _Stretches) -> Iterator[PolygonParts | None]:
    yield from file.parts(ObjReader(sorted(PASSED_OVER)))


def _stl_parts(file: _Stretches) -> Iterator[PolygonParts | None]:
    yield from file.parts(StlReader(is_soup=True))


def _off_rows(file: _Stretches) -> tuple[ElementRows, ElementRows] | None:
    head = _OFF_HEAD.match(file.start(_MOST_HEADER))
    if head is None:
        return None
    file.use(head.end())
    points = ElementRows([("f", 8, "", 0, role) for role in range(3)], int(head[1]), "", "#", 1)
    return points, ElementRows([("i", 8, "i", 8, 3)], int(head[2]), "", "#", _FACE_EXTRA)


def _off_parts(file: _Stretches) -> Iterator[PolygonParts | None]:
    for rows in _off_rows(file) or (None,):
        yield from (None,) if rows is None else file.row_parts(rows)
    if not file.rest(blank=True):
        yield None


def _off(file: _Stretches, _: int) -> Polygons | None:
    rows = _off_rows(file)
    if rows is None:
        return None
    points, faces = rows
    if not (file.feed_rows(points) and file.feed_rows(faces) and file.rest(blank=True)):
        return None
    return Polygons(points.take()[0], *faces.take()[1:])


def _ply(file: _Stretches, _: int) -> Polygons | None:
    found = _ply_rows(file)
    if found is None:
        return None
    order, elements = found
    points = np.zeros((0, 3))
    flat, sizes = np.zeros(0, np.int64), np.zeros(0, np.int64)
    for name, rows in elements:
        if rows.rows_left and not file.feed_rows(rows):
            return None
        if name == "vertex":
            points = rows.take()[0]
        elif name == "face":
            flat, sizes = rows.take()[1:]
    return Polygons(points, flat, sizes) if file.rest(blank=not order) else None


def _ply_parts(file: _Stretches) -> Iterator[PolygonParts | None]:
    found = _ply_rows(file)
    if found is None:
        yield None
        return
    order, elements = found
    for name, rows in elements:
        for part in file.row_parts(rows):
            if part is None or name in ("vertex", "face"):
                yield part
    if not file.rest(blank=not order):
        yield None


def _ply_rows(file: _Stretches) -> tuple[str, list[tuple[str, ElementRows]]] | None:
    """Order of bytes, and what reads each element."""
    try:
        order, elements, size, _ = parse_header(file.start(_MOST_HEADER))
    except ValueError:
        return None
    file.use(size)
    found: list[tuple[str, ElementRows]] = []
    for element in elements:
        roles = _roles(element)
        if roles is None:
            return None
        properties = [
            (item.dtype[0], int(item.dtype[1]), item.count_dtype[:1], int(item.count_dtype[1:] or 0), role)
            for item, role in zip(element.properties, roles, strict=True)
        ]
        found.append((element.name, ElementRows(properties, element.n, order, "", 1)))
    return order, found


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
