"""PLY surfaces, text and binary, with polygons, float64 and order as in the file.

Own code because meshio 5.3 reads ``uchar`` as signed, knows ``vertex_indices`` but not ``vertex_index``,
and VTK and Open3D round to float32 or cut polygons into triangles.
"""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.text_rows import TextLines, parse_rows, ranges, text_lines, whole_numbers

__all__ = [
    "INDEX_NAMES", "Element", "Polygons", "format_ply", "parse_ply", "parse_rows", "ranges", "read_header",
    "whole_numbers",
]  # fmt: skip

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"), **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"), **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"), **dict.fromkeys(("uint", "uint32"), "u4"),
    "int64": "i8", "uint64": "u8",
    **dict.fromkeys(("float", "float32"), "f4"), **dict.fromkeys(("double", "float64"), "f8"),
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
INDEX_NAMES = ("vertex_indices", "vertex_index")


class Polygons(NamedTuple):
    """A surface as files hold it: coordinates, all polygons' vertex ids in a row, and their sizes."""

    vertices: NDArray[np.float64]
    flat: NDArray[np.int64]
    sizes: NDArray[np.int64]


class _Property(NamedTuple):
    name: str
    dtype: str
    count_dtype: str  # "" for a scalar


class Element(NamedTuple):
    """One kind of rows that a header declares."""

    name: str
    n: int
    properties: list[_Property]

    def find(self, *names: str) -> int:
        """Position of the first property with one of these names."""
        for name in names:
            for position, item in enumerate(self.properties):
                if item.name == name:
                    return position
        raise ValueError(f"element {self.name} has no property {' or '.join(names)}")


def parse_ply(data: bytes) -> Polygons:
    """Vertices and faces of a PLY file (none where it has none); ValueError says what is wrong with it."""
    order, elements, at, n_header = read_header(data)
    vertices: NDArray[np.float64] | None = None
    faces: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
    lines = TextLines([], np.zeros(0, np.int64))
    if not order:
        lines, at = text_lines(data[at:], first=n_header + 1), 0
    for element in elements:
        if order:
            at, columns = _binary(data, at, order, element)
        else:
            if element.n > len(lines.texts) - at:
                raise ValueError(f"the file ends before its {element.n} {element.name} elements do")
            columns = _text(lines.part(at, at + element.n), element) if element.n else []
            at += element.n
        if element.name not in ("vertex", "face") or element.n == 0:
            continue
        if element.name == "vertex":
            picked = [columns[element.find(name)] for name in "xyz"]
            if any(isinstance(column, tuple) for column in picked):
                raise ValueError("vertex coordinates are lists")
            vertices = np.stack(picked, axis=1).astype(np.float64)  # type: ignore[arg-type]
        else:
            column = columns[element.find(*INDEX_NAMES)]
            if not isinstance(column, tuple):
                raise ValueError("face indices are not a list")
            flat, sizes = column
            faces = whole_numbers(flat), whole_numbers(sizes)
    if order and at != len(data):
        raise ValueError(f"byte {at}: {len(data) - at} bytes follow the last element")
    if at < len(lines.texts):
        raise ValueError(f"line {lines.numbers[at]}: it follows the last element")
    if vertices is None:
        vertices = np.zeros((0, 3))
    if faces is None:
        faces = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return Polygons(vertices, *faces)


def read_header(data: bytes) -> tuple[str, list[Element], int, int]:
    """Byte order ("" for text), elements, where the body starts, and the number of lines before it."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if first is None:
        raise ValueError("it does not start with 'ply'")
    end = re.compile(rb"\r" if first[1] == b"\r" else rb"\n")  # old Macintosh line ends, or all others
    order: str | None = None
    elements: list[Element] = []
    at, number = first.end(), 1
    while True:
        stop = end.search(data, at)
        line = data[at : stop.start() if stop else len(data)].decode("ascii", "replace")
        number += 1
        words = line.split()
        if words == ["end_header"]:
            break
        if stop is None:
            raise ValueError("it has no end_header")
        at = stop.end()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format" and order is None:
                order = _format(words)
            else:
                _declare(words, elements)
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    if order is None:
        raise ValueError("it has no format line")
    for element in elements:
        if element.n and not element.properties:
            raise ValueError(f"element {element.name} has no properties")
    return order, elements, stop.end() if stop else len(data), number


def _format(words: list[str]) -> str:
    if len(words) != 3 or words[1] not in _ORDERS or words[2] != "1.0":
        raise ValueError(f"format must be {', '.join(_ORDERS)} and 1.0; got unknown word '{' '.join(words[1:])[:60]}'")
    return _ORDERS[words[1]]


def _declare(words: list[str], elements: list[Element]) -> None:
    """One `element` or `property` line."""
    if words[0] == "element" and len(words) == 3:
        if not re.fullmatch(r"[0-9]{1,18}", words[2]):
            raise ValueError(f"the number of elements must be 0 or more; got '{words[2][:40]}'")
        if any(element.name == words[1] for element in elements):
            raise ValueError(f"element {words[1]} is there twice")
        elements.append(Element(words[1], int(words[2]), []))
        return
    is_list = words[1:2] == ["list"]
    if words[0] != "property" or len(words) != (5 if is_list else 3):
        raise ValueError(f"unknown word '{' '.join(words)[:60]}'")
    for name in words[2:4] if is_list else words[1:2]:
        if name not in _TYPES:
            raise ValueError(f"unknown word '{name[:60]}' for a type")
    if not elements:
        raise ValueError("a property stands before the first element")
    if is_list and _TYPES[words[2]].startswith("f"):
        raise ValueError(f"the size of a list must be of a whole type; got {words[2]}")
    if any(item.name == words[-1] for item in elements[-1].properties):
        raise ValueError(f"element {elements[-1].name} has property {words[-1]} twice")
    item = (words[4], _TYPES[words[3]], _TYPES[words[2]]) if is_list else (words[2], _TYPES[words[1]], "")
    elements[-1].properties.append(_Property(*item))


_Columns = list[NDArray[np.generic] | tuple[NDArray[np.generic], NDArray[np.generic]]]


def _text(lines: TextLines, element: Element) -> _Columns:
    """Columns of a text element: scalars as arrays, lists as (flat, sizes)."""
    values, width = lines.rows()
    cursor = np.cumsum(width) - width
    stop = cursor + width
    columns: _Columns = []
    for item in element.properties:
        lines.refuse(cursor >= stop, f"a line of element {element.name} is too short")
        if not item.count_dtype:
            columns.append(values[cursor])
            if item.dtype[0] != "f":
                lines.refuse(values[cursor] != np.trunc(values[cursor]), f"{item.name} is not a whole number")
            cursor = cursor + 1
            continue
        counts = values[cursor]
        lines.refuse(~((counts >= 0) & (counts == np.trunc(counts))), f"a list of element {element.name} has no size")
        cursor = cursor + 1
        lines.refuse(counts > stop - cursor, f"a line of element {element.name} is too short")
        sizes = counts.astype(np.int64)
        columns.append((values[ranges(cursor, sizes)], sizes))
        cursor = cursor + sizes
    lines.refuse(cursor < stop, f"a line of element {element.name} is too long")
    return columns


def _binary(data: bytes, at: int, order: str, element: Element) -> tuple[int, _Columns]:
    """Columns of a binary element; one structured view where all lists have the sizes of the first row."""
    if element.n == 0:
        return at, []
    left = len(data) - at
    least = sum(np.dtype(item.count_dtype or item.dtype).itemsize for item in element.properties)
    if element.n * least > left:
        raise ValueError(f"byte {at}: the file ends before its {element.n} {element.name} elements do")
    sizes = _row_sizes(data, at, order, element)
    widths = [
        np.dtype(item.dtype).itemsize * size + np.dtype(item.count_dtype).itemsize
        if item.count_dtype else np.dtype(item.dtype).itemsize
        for item, size in zip(element.properties, sizes, strict=True)
    ]  # fmt: skip
    if element.n * sum(widths) > left:
        return _binary_mixed(data, at, order, element)
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    for position, (item, size) in enumerate(zip(element.properties, sizes, strict=True)):
        if item.count_dtype:
            fields.append((f"n{position}", order + item.count_dtype))
        fields.append((f"v{position}", order + item.dtype, (size,) if item.count_dtype else ()))
    layout = np.dtype(fields)
    rows = np.frombuffer(data, dtype=layout, count=element.n, offset=at)
    lists = [position for position, item in enumerate(element.properties) if item.count_dtype]
    if all((rows[f"n{position}"] == sizes[position]).all() for position in lists):
        columns: _Columns = []
        for k, item in enumerate(element.properties):
            values = rows[f"v{k}"]
            is_list = bool(item.count_dtype)
            columns.append((values.reshape(-1), np.full(element.n, sizes[k])) if is_list else values)
        return at + element.n * layout.itemsize, columns
    return _binary_mixed(data, at, order, element)


def _row_sizes(data: bytes, at: int, order: str, element: Element) -> list[int]:
    """List sizes in the row at `at` (0 for scalars)."""
    sizes: list[int] = []
    for item in element.properties:
        size = 0
        if item.count_dtype:
            dtype = np.dtype(order + item.count_dtype)
            if at + dtype.itemsize > len(data):
                raise ValueError(f"byte {at}: the file ends before its {element.n} {element.name} elements do")
            size = int(np.frombuffer(data, dtype, count=1, offset=at)[0])
            if size < 0:
                raise ValueError(f"byte {at}: a list of element {element.name} has a negative size")
            at += dtype.itemsize + size * np.dtype(item.dtype).itemsize
        else:
            at += np.dtype(item.dtype).itemsize
        sizes.append(size)
    return sizes


def _binary_mixed(data: bytes, at: int, order: str, element: Element) -> tuple[int, _Columns]:
    """Rows of different lengths: where each starts is known only after walking all before it."""
    byteorder = "little" if order == "<" else "big"
    plan = [
        (np.dtype(item.count_dtype).itemsize if item.count_dtype else 0, np.dtype(item.dtype).itemsize)
        for item in element.properties
    ]
    signed = [item.count_dtype.startswith("i") for item in element.properties]
    starts = [[0] * element.n for _ in plan]
    sizes = [[1] * element.n for _ in plan]
    end = len(data)
    for row in range(element.n):
        for column, (count_bytes, item_bytes) in enumerate(plan):
            size = 1
            if count_bytes:
                size = int.from_bytes(data[at : at + count_bytes], byteorder, signed=signed[column])
                if size < 0:
                    raise ValueError(f"byte {at}: a list of element {element.name} has a negative size")
                at += count_bytes
                sizes[column][row] = size
            starts[column][row] = at
            at += size * item_bytes
            if at > end:
                raise ValueError(f"byte {end}: the file ends before its {element.n} {element.name} elements do")
    octets = np.frombuffer(data, dtype=np.uint8)
    columns: _Columns = []
    for column, item in enumerate(element.properties):
        n_items = np.array(sizes[column], dtype=np.int64)
        width = plan[column][1]
        first = ranges(np.zeros(element.n, dtype=np.int64), n_items) * width
        places = np.repeat(np.array(starts[column], dtype=np.int64), n_items) + first
        values = octets[places[:, None] + np.arange(width)].reshape(-1).view(order + item.dtype)
        columns.append((values, n_items) if item.count_dtype else values)
    return at, columns


def format_ply(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> bytes:
    """Binary little-endian PLY, float64 and int32."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("v", "<i4", (3,))])
    rows["n"], rows["v"] = 3, faces
    return header.encode("ascii") + vertices.astype("<f8").tobytes() + rows.tobytes()
