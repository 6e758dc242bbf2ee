"""Arrays of VTK's XML files, read without VTK, whose reader trusts the counts and ends the process.

Every array is as long as the bytes of the file make it; what the file claims is compared with that. Text, binary and
appended data (raw or base64), compressed or not, either byte order.
"""

from __future__ import annotations

import binascii
import lzma
import re
import zlib
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional

__all__ = ["Arrays", "check_points", "count_of", "indices_of", "open_pieces", "points_of", "row_starts"]

_TYPES = {f"{kind}{8 * n}": f"{kind[0].lower()}{n}" for kind in ("Int", "UInt", "Float") for n in (1, 2, 4, 8)}
_COMPRESSORS = ("vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor")
_MAX_DEPTH = 16
_MAX_GROWTH = {"vtkZLibDataCompressor": 1100, "vtkLZ4DataCompressor": 300, "vtkLZMADataCompressor": 10_000}


def open_pieces(data: bytes, kind: str) -> tuple[list[Element], Arrays]:
    """Give the pieces of a file of this kind, and what reads their arrays."""
    appended = re.search(rb"<AppendedData\b[^<>]*>", data)
    head = data if appended is None else data[: appended.end()] + b"</AppendedData></VTKFile>"
    root = _tree(head)
    if root.tag != "VTKFile" or root.get("type") != kind:
        raise ValueError(f"it is no VTKFile of type {kind}")
    arrays = Arrays(root, data, appended)
    pieces = root.findall(f"{kind}/Piece")
    if not pieces:
        raise ValueError("it has no Piece")
    return pieces, arrays


def points_of(piece: Element, source: Arrays) -> NDArray[np.float64]:
    """Give the points of a piece, (n, 3), all finite."""
    n_points = count_of(piece, "NumberOfPoints")
    arrays = piece.findall("Points/DataArray")
    if len(arrays) != 1:
        raise ValueError(f"a Piece must have one array of Points; got {len(arrays)}")
    if arrays[0].get("NumberOfComponents", "3") != "3":
        raise ValueError(f"the points have {arrays[0].get('NumberOfComponents')} coordinates, not 3")
    with np.errstate(invalid="ignore"):  # a NaN may be a signalling one
        points = source.read(arrays[0]).astype(np.float64)
    if len(points) != 3 * n_points:
        raise ValueError(f"{len(points)} coordinates are not those of {n_points} points")
    wrong = np.flatnonzero(~np.isfinite(points))
    if len(wrong):
        raise ValueError(f"point {wrong[0] // 3} of {n_points} is not finite: a coordinate is {points[wrong[0]]}")
    return points.reshape(-1, 3)


def indices_of(piece: Element, section: str, source: Arrays) -> dict[str, NDArray[np.int64]]:
    """Give the arrays of indices of a section by name."""
    found: dict[str, NDArray[np.int64]] = {}
    for array in piece.findall(f"{section}/DataArray"):
        name = array.get("Name", "?")
        if name in found:
            raise ValueError(f"there are two arrays '{name}'")
        found[name] = _indices(source.read(array), name)
    return found


def _tree(text: bytes) -> Element:
    """XML without declarations of its own: those can make a small file large."""
    builder = TreeBuilder()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _MAX_DEPTH:
            raise ValueError(f"line {parser.CurrentLineNumber}: elements are nested deeper than {_MAX_DEPTH}")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        raise ValueError(f"line {parser.CurrentLineNumber}: a document type is not allowed")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(f"it is no XML: {error}") from None
    return builder.close()


class Arrays:
    """How a file writes its arrays, and the bytes after `_` of its AppendedData."""

    def __init__(self, root: Element, data: bytes, appended: re.Match[bytes] | None) -> None:
        order, header = root.get("byte_order", "LittleEndian"), root.get("header_type", "UInt32")
        self.compressor = root.get("compressor", "")
        if order not in ("LittleEndian", "BigEndian"):
            raise ValueError(f"byte_order is '{order}'")
        if header not in ("UInt32", "UInt64"):
            raise ValueError(f"header_type is '{header}'")
        if self.compressor and self.compressor not in _COMPRESSORS:
            raise ValueError(f"compressor is '{self.compressor}'")
        self.order = "<" if order == "LittleEndian" else ">"
        self.header = np.dtype(self.order + ("u4" if header == "UInt32" else "u8"))
        self.body, self.is_raw, self.n_read = b"", False, 0
        element = root.find("AppendedData")
        if appended is not None and element is not None:
            encoding = element.get("encoding", "raw")
            if encoding not in ("raw", "base64"):
                raise ValueError(f"encoding of the AppendedData is '{encoding}'")
            self.is_raw = encoding == "raw"
            start = data.find(b"_", appended.end())
            stop = data.rfind(b"</AppendedData")
            tail = re.fullmatch(rb"</AppendedData\s*>\s*</VTKFile\s*>\s*", data[max(stop, 0) :])
            if start < 0 or stop < start or data[appended.end() : start].strip() or tail is None:
                raise ValueError("the AppendedData does not start with '_' or does not end")
            self.body = data[start + 1 : stop]

    def read(self, array: Element) -> NDArray[Any]:
        """The numbers of a DataArray, as many as there are."""
        name = array.get("Name", "?")
        kind = _TYPES.get(array.get("type", ""))
        if kind is None or kind in ("f1", "f2"):
            raise ValueError(f"array '{name}' is of type '{array.get('type')}'")
        try:
            return self._read(array, np.dtype(self.order + kind))
        except (ValueError, zlib.error, lzma.LZMAError, EOFError, OSError) as error:
            raise ValueError(f"array '{name}': {error}") from None

    def _read(self, array: Element, dtype: np.dtype[Any]) -> NDArray[Any]:
        form = array.get("format", "")
        if form == "ascii":
            return _numbers((array.text or "").split(), dtype)
        if form == "binary":
            octets = self._blocks(_Base64("".join((array.text or "").split()).encode("ascii", "replace"), 0))
        elif form == "appended":
            at = count_of(array, "offset")
            if at >= len(self.body):
                raise ValueError(f"offset {at} is beyond the {len(self.body)} bytes of the AppendedData")
            stream = _Raw(self.body, at) if self.is_raw else _Base64(self.body, at)
            octets = self._blocks(stream)
            self.n_read += stream.n_read
            if self.n_read > 2 * len(self.body):
                raise ValueError("it lies over other arrays in the AppendedData")
        else:
            raise ValueError(f"format is '{form}'")
        if len(octets) % dtype.itemsize:
            raise ValueError(f"{len(octets)} bytes are no whole number of values")
        return np.frombuffer(octets, dtype=dtype)

    def _blocks(self, stream: _Raw | _Base64) -> bytes:
        """One block after its size, or compressed blocks after a table of theirs."""
        item = self.header.itemsize
        if not self.compressor:
            (size,) = self._sizes(stream.read(0, item))
            return stream.read(0, item + size)[item:]
        (n,) = self._sizes(stream.read(0, item))
        if not n:
            return b""
        _, size, last, *packed = self._sizes(stream.read(0, (3 + n) * item))
        whole = stream.read((3 + n) * item, sum(packed))
        parts: list[bytes] = []
        at = 0
        for k, width in enumerate(packed):
            wanted = last if k == n - 1 and last else size
            parts.append(self._inflated(whole[at : at + width], wanted))
            at += width
        return b"".join(parts)

    def _sizes(self, octets: bytes) -> list[int]:
        return [int(value) for value in np.frombuffer(octets, dtype=self.header)]

    def _inflated(self, packed: bytes, size: int) -> bytes:
        """One block, which must be as long as the file says; no more than that is made of it."""
        if size > _MAX_GROWTH[self.compressor] * (len(packed) + 1):
            raise ValueError(f"a block of {len(packed)} bytes cannot hold the {size} bytes it claims")
        if self.compressor == "vtkZLibDataCompressor":
            made = zlib.decompressobj().decompress(packed, size + 1)
        elif self.compressor == "vtkLZMADataCompressor":
            made = lzma.LZMADecompressor(memlimit=1 << 28).decompress(packed, size + 1)
        else:
            made = optional("pyarrow").Codec("lz4_raw").decompress(packed, decompressed_size=size, asbytes=True)
        if len(made) != size:
            raise ValueError(f"a block holds {len(made)} bytes or more, not {size}")
        return made


class _Raw:
    """Bytes from a place on."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self._at, self.n_read = data, at, 0

    def read(self, start: int, size: int) -> bytes:
        """`size` bytes after the first `start`."""
        low = self._at + start
        if size > len(self._data) - low:
            raise ValueError(f"it claims {size} bytes, but {max(0, len(self._data) - low)} are left")
        self.n_read += size
        return self._data[low : low + size]


class _Base64:
    """Bytes written as base64, each text of them filled up to whole groups of four letters."""

    def __init__(self, text: bytes, at: int) -> None:
        self._text, self._at, self.n_read = text, at, 0

    def read(self, start: int, size: int) -> bytes:
        """`size` bytes of the text that follows the one of the first `start` bytes."""
        at = self._at + 4 * -(-start // 3)
        width = 4 * -(-size // 3)
        self.n_read += width
        if width > len(self._text) - at:
            raise ValueError(f"it claims {size} bytes, but the text ends after {max(0, len(self._text) - at) * 3 // 4}")
        try:
            made = binascii.a2b_base64(self._text[at : at + width])
        except binascii.Error as error:
            raise ValueError(f"its base64 is damaged: {error}") from None
        if len(made) < size:
            raise ValueError(f"its base64 gives {len(made)} bytes, not {size}")
        return made[:size]


def _numbers(words: list[str], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Numbers written as text; nothing is rounded to a whole number or wrapped into its range."""
    if dtype.kind == "f":
        if any("_" in word for word in words):
            raise ValueError("it holds something that is no number")
        return np.array(words, dtype=np.float64)
    whole = [int(word) for word in words if re.fullmatch(r"[+-]?[0-9]{1,20}", word)]
    limits = np.iinfo(dtype)
    if len(whole) < len(words) or (whole and not limits.min <= min(whole) <= max(whole) <= limits.max):
        raise ValueError(f"it holds something that is no whole number of type {dtype.name}")
    return np.array(whole, dtype=dtype)


def count_of(element: Element, name: str) -> int:
    """Give an attribute that is a count."""
    text = element.get(name, "")
    if not re.fullmatch(r"[0-9]{1,18}", text):
        raise ValueError(f"{name} must be a number from 0; got '{text[:40]}'")
    return int(text)


def _indices(values: NDArray[Any], name: str) -> NDArray[np.int64]:
    if values.dtype.kind == "f" or (values.dtype.kind == "u" and values.size and int(values.max()) >= 2**63):
        raise ValueError(f"array '{name}' does not hold indices")
    return values.astype(np.int64)


def check_points(values: NDArray[np.int64], name: str, upper: int) -> None:
    """Refuse an index that is none of a point."""
    if values.size and (int(values.min()) < 0 or int(values.max()) >= upper):
        wrong = int(values.min()) if int(values.min()) < 0 else int(values.max())
        raise ValueError(f"array '{name}' names point {wrong} of {upper}")


def row_starts(found: dict[str, NDArray[np.int64]], name: str, n: int, end: int) -> NDArray[np.int64]:
    """Where the `n` rows start and, last, end; files hold the ends."""
    ends = found[name]
    if len(ends) != n:
        raise ValueError(f"array '{name}' has {len(ends)} values, not {n}")
    starts = np.concatenate([[0], ends]).astype(np.int64)
    if (np.diff(starts) < 0).any() or int(starts[-1]) != end:
        raise ValueError(f"array '{name}' must rise from 0 to {end}; got {starts[:4].tolist()} .. {int(starts[-1])}")
    return starts
