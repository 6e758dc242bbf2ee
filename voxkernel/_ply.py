"""PLY surfaces, text and binary, with polygons, float64 and order as in the file.

Own code because meshio 5.3 reads ``uchar`` as signed, knows ``vertex_indices`` but not ``vertex_index``,
and VTK and Open3D round to float32 or cut polygons into triangles.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Polygons", "format_ply", "parse_ply", "parse_rows", "ranges", "whole_numbers"]

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"), **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"), **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"), **dict.fromkeys(("uint", "uint32"), "u4"),
    "int64": "i8", "uint64": "u8",
    **dict.fromkeys(("float", "float32"), "f4"), **dict.fromkeys(("double", "float64"), "f8"),
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_INDEX_NAMES = ("vertex_indices", "vertex_index")


class Polygons(NamedTuple):
    """A surface as files hold it: coordinates, all polygons' vertex ids in a row, and their sizes."""

    vertices: NDArray[np.float64]
    flat: NDArray[np.int64]
    sizes: NDArray[np.int64]


class _Property(NamedTuple):
    name: str
    dtype: str
    count_dtype: str  # "" for a scalar


class _Element(NamedTuple):
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
    order, elements, at = _header(data)
    vertices: NDArray[np.float64] | None = None
    faces: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
    lines: list[str] = []
    if not order:
        lines = [line for line in data[at:].decode("ascii", "replace").splitlines() if line.strip()]
        at = 0
    for element in elements:
        wanted = element.name in ("vertex", "face") and element.n > 0
        if order:
            at, columns = _binary(data, at, order, element)
        else:
            if at + element.n > len(lines):
                raise ValueError(f"the file ends before its {element.n} {element.name} elements do")
            columns = _text(lines[at : at + element.n], element) if wanted else []
            at += element.n
        if not wanted:
            continue
        if element.name == "vertex":
            picked = [columns[element.find(name)] for name in "xyz"]
            if any(isinstance(column, tuple) for column in picked):
                raise ValueError("vertex coordinates are lists")
            vertices = np.stack(picked, axis=1).astype(np.float64)  # type: ignore[arg-type]
        else:
            column = columns[element.find(*_INDEX_NAMES)]
            if not isinstance(column, tuple):
                raise ValueError("face indices are not a list")
            flat, sizes = column
            faces = whole_numbers(flat), whole_numbers(sizes)
    if vertices is None:
        vertices = np.zeros((0, 3))
    if faces is None:
        faces = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return Polygons(vertices, *faces)


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    """Byte order ("" for text), elements, and where the body starts."""
    if not data.startswith(b"ply"):
        raise ValueError("it does not start with 'ply'")
    end = data.find(b"end_header")
    if end < 0:
        raise ValueError("it has no end_header")
    body = data.find(b"\n", end)
    carriage = data.find(b"\r", end)
    if carriage >= 0 and (body < 0 or carriage < body - 1):  # old Macintosh line ends
        body = carriage
    order: str | None = None
    elements: list[_Element] = []
    for line in data[:end].decode("ascii", "replace").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "format":
            order = _ORDERS[words[1]]
        elif words[0] == "element":
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[0] == "property":
            if words[1] == "list":
                item = _Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
            else:
                item = _Property(words[2], _TYPES[words[1]], "")
            elements[-1].properties.append(item)
    if order is None:
        raise ValueError("it has no format line")
    return order, elements, body + 1 if body >= 0 else len(data)


_Columns = list[NDArray[np.generic] | tuple[NDArray[np.generic], NDArray[np.generic]]]


def _text(lines: list[str], element: _Element) -> _Columns:
    """Columns of a text element: scalars as arrays, lists as (flat, sizes)."""
    values, width = parse_rows(lines)
    cursor = np.cumsum(width) - width
    stop = cursor + width
    columns: _Columns = []
    for item in element.properties:
        if (cursor >= stop).any():
            raise ValueError(f"a line of element {element.name} is too short")
        if not item.count_dtype:
            columns.append(values[cursor])
            cursor = cursor + 1
            continue
        sizes = whole_numbers(values[cursor])
        cursor = cursor + 1
        if (sizes < 0).any() or (cursor + sizes > stop).any():
            raise ValueError(f"a line of element {element.name} is too short")
        columns.append((values[ranges(cursor, sizes)], sizes))
        cursor = cursor + sizes
    return columns


def parse_rows(lines: list[str]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All numbers of some lines in a row, correctly rounded, and how many each line holds."""
    if not lines:
        return np.zeros(0), np.zeros(0, dtype=np.int64)
    try:
        table = np.loadtxt(lines, dtype=np.float64, comments=None, ndmin=2)
        if len(table) == len(lines):
            return table.reshape(-1), np.full(len(table), table.shape[1], dtype=np.int64)
    except ValueError:  # lines of different lengths, or no numbers, which the slower way names
        pass
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


def _binary(data: bytes, at: int, order: str, element: _Element) -> tuple[int, _Columns]:
    """Columns of a binary element; one structured view where all lists have the sizes of the first row."""
    if element.n == 0:
        return at, []
    sizes = _row_sizes(data, at, order, element)
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    for position, (item, size) in enumerate(zip(element.properties, sizes, strict=True)):
        if item.count_dtype:
            fields.append((f"n{position}", order + item.count_dtype))
        fields.append((f"v{position}", order + item.dtype, (size,) if item.count_dtype else ()))
    layout = np.dtype(fields)
    if at + element.n * layout.itemsize <= len(data):
        rows = np.frombuffer(data, dtype=layout, count=element.n, offset=at)
        lists = [position for position, item in enumerate(element.properties) if item.count_dtype]
        if all((rows[f"n{position}"] == sizes[position]).all() for position in lists):
            columns: _Columns = []
            for k, item in enumerate(element.properties):
                values = rows[f"v{k}"]
                is_list = bool(item.count_dtype)
                columns.append((values.reshape(-1), np.full(element.n, sizes[k])) if is_list else values)
            return at + element.n * layout.itemsize, columns
    if not any(item.count_dtype for item in element.properties):
        raise ValueError(f"the file ends before its {element.n} {element.name} elements do")
    return _binary_mixed(data, at, order, element)


def _row_sizes(data: bytes, at: int, order: str, element: _Element) -> list[int]:
    """List sizes in the row at `at` (0 for scalars)."""
    sizes: list[int] = []
    for item in element.properties:
        size = 0
        if item.count_dtype:
            dtype = np.dtype(order + item.count_dtype)
            if at + dtype.itemsize > len(data):
                raise ValueError(f"the file ends before its {element.n} {element.name} elements do")
            size = int(np.frombuffer(data, dtype, count=1, offset=at)[0])
            if size < 0:
                raise ValueError(f"a list of element {element.name} has a negative size")
            at += dtype.itemsize + size * np.dtype(item.dtype).itemsize
        else:
            at += np.dtype(item.dtype).itemsize
        sizes.append(size)
    return sizes


def _binary_mixed(data: bytes, at: int, order: str, element: _Element) -> tuple[int, _Columns]:
    """Rows of different lengths: where each starts is known only after walking all before it."""
    byteorder = "little" if order == "<" else "big"
    plan = [
        (np.dtype(item.count_dtype).itemsize if item.count_dtype else 0, np.dtype(item.dtype).itemsize)
        for item in element.properties
    ]
    if any(item.count_dtype.startswith("f") for item in element.properties):
        raise ValueError("list sizes are not integers")
    starts = [[0] * element.n for _ in plan]
    sizes = [[1] * element.n for _ in plan]
    end = len(data)
    for row in range(element.n):
        for column, (count_bytes, item_bytes) in enumerate(plan):
            size = 1
            if count_bytes:
                size = int.from_bytes(data[at : at + count_bytes], byteorder)
                at += count_bytes
                sizes[column][row] = size
            starts[column][row] = at
            at += size * item_bytes
            if at > end:
                raise ValueError(f"the file ends before its {element.n} {element.name} elements do")
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
