"""Binary PLY and STL files, mapped into memory and read in chunks."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from voxkernel._input_file import input_file
from voxkernel.errors import MeshReadError
from voxkernel.large.chunks import Chunk, Piece, check_ids, pieces_of, refusal
from voxkernel.large.stored_file import StoredFile
from voxkernel.mesh.ply import INDEX_NAMES, Element, parse_header

__all__ = ["NotMapped", "PlyFile", "StlFile"]

_LONGEST_HEADER = 1 << 20
_STL_ROW = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_HEAD = 84
_PACKED = np.dtype([(axis, np.float64) for axis in "xyz"])
_SCANNED = 1 << 20  # faces looked at in one go


class NotMapped(Exception):
    """A file that is text, or holds more than triangles of one size in a row."""


class PlyFile:
    """A binary PLY file of triangles; they share vertices by number."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        file = input_file(path, MeshReadError)
        self.path, self.name = Path(file), f"'{file}'"
        with open(file, "rb") as stream:
            head = stream.read(_LONGEST_HEADER)
        try:
            order, elements, at, _ = parse_header(head)
            if not order:
                raise NotMapped
            self._stored = StoredFile.of(self.path)
            self._place(order, elements, at, self._stored.size)
        except ValueError as error:
            raise MeshReadError(f"{self.name} cannot be streamed: {error}") from None
        if self._size > self._end and self._has_polygons():
            raise NotMapped

    def _place(self, order: str, elements: list[Element], at: int, size: int) -> None:
        """Find where rows of vertices and faces begin; lists stand in the rows of faces only, three long."""
        found: dict[str, tuple[int, int, np.dtype[np.void]]] = {}
        for element in elements:
            lists = [item.name for item in element.properties if item.count_dtype]
            if lists and (element.name != "face" or len(lists) > 1):
                raise NotMapped
            row = np.dtype([
                part for item in element.properties
                for part in (
                    [("size", order + item.count_dtype), ("corners", order + item.dtype, (3,))]
                    if item.count_dtype else [(item.name, order + item.dtype)]
                )
            ])  # fmt: skip
            if element.name == "face":
                element.find(*INDEX_NAMES)
                if not lists or np.dtype(row["corners"].base).kind not in "iu":
                    raise ValueError("faces have no list of vertex ids")
            if element.name == "vertex":
                for axis in "xyz":
                    element.find(axis)
            found[element.name] = at, element.n, row
            at += element.n * row.itemsize
        if "vertex" not in found or "face" not in found:
            raise ValueError("it has no vertices or no faces")
        self._vertices, self._faces = found["vertex"], found["face"]
        self.n_facets: int | None = self._faces[1]
        self._end, self._size = at, size

    def _rows(self, where: str) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Map the vertices and the faces."""
        (a, n, vertex), (b, m, face) = self._vertices, self._faces
        return self._stored.mapped(vertex, a, n, where=where), self._stored.mapped(face, b, m, where=where)

    def _has_polygons(self) -> bool:
        """Whether, behind nothing but triangles, there is a face of more corners."""
        at, m, row = self._faces
        faces = np.memmap(self.path, row, "r", offset=at, shape=(m,)) if m else np.empty(0, row)
        for first in range(0, m, _SCANNED):
            sizes = faces["size"][first : first + _SCANNED]
            other = np.flatnonzero(sizes != 3)
            if len(other):
                return int(sizes[other[0]]) > 3
        return False

    def _check_end(self, chunk_size: int) -> None:
        """Refuse a file of another length than its header says, with the facet where it ends."""
        if self._size == self._end:
            return
        at, m, row = self._faces
        with open(self.path, "rb") as stream:
            stream.seek(at)
            data = stream.read(row.itemsize)
        if len(data) == row.itemsize and (n := int(np.frombuffer(data, row)["size"][0])) != 3:
            raise self._other_size(0, 0, n)
        if self._size > self._end:
            raise MeshReadError(
                f"{self.name} cannot be streamed: it has {self._size - self._end} bytes more than {m} triangles take"
            )
        facet = max(0, self._size - at) // row.itemsize
        if facet >= m or self._size < at:
            raise MeshReadError(f"{self.name} cannot be streamed: it ends before its vertices and faces do")
        where = f"chunk {facet // chunk_size}, facet {facet}"
        raise MeshReadError(f"{self.name}, {where}: the file ends before its {m} facets do")

    def _other_size(self, chunk: int, facet: int, n: int) -> Exception:
        return refusal(self.name, chunk, facet, f"must be a triangle to be streamed; got {n} corners")

    def pieces(self, size: int) -> Iterator[Piece]:
        """The faces, `size` at a time."""
        self._check_end(size)
        return self._stored.watched(self.name, pieces_of(self, self._faces[1] if self._vertices[1] else 0, size))

    def chunk(self, number: int, size: int) -> Chunk:
        """Read some of the faces."""
        first = number * size
        points, faces = self._rows(f"{self.name}, chunk {number}, facet {first}")
        rows = np.asarray(faces[first : first + size])
        other = np.flatnonzero(rows["size"] != 3)
        if len(other):
            raise self._other_size(number, first + int(other[0]), int(rows["size"][other[0]]))
        ids = np.ascontiguousarray(rows["corners"]).astype(np.int64)
        check_ids(self.name, number, first, ids, len(points))
        return Chunk(_positions(points, ids), ids)

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Corners of some facets."""
        points, faces = self._rows(self.name)
        return _positions(points, np.asarray(faces["corners"][facets]).astype(np.int64))


def _positions(rows: NDArray[np.void], ids: NDArray[np.int64]) -> NDArray[np.float64]:
    """Coordinates of vertices, float64, whatever else is in their rows."""
    layout = rows.dtype
    # Rows as opaque bytes: four times faster than three numbers at an odd place each.
    picked = np.take(np.asarray(rows).view(f"V{layout.itemsize}"), ids.reshape(-1)).view(layout)
    if layout == _PACKED:
        return picked.view(np.float64).reshape(-1, 3, 3)
    with np.errstate(invalid="ignore"):  # a NaN may be a signalling one; none is accepted
        return np.stack([picked["x"], picked["y"], picked["z"]], axis=1).astype(np.float64).reshape(-1, 3, 3)


class StlFile:
    """A binary STL file: a soup, whose equal corners are one vertex."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        file = input_file(path, MeshReadError)
        self.path, self.name = Path(file), f"'{file}'"
        self._stored = StoredFile.of(self.path)
        self._size = self._stored.size
        with open(file, "rb") as stream:
            head = stream.read(_STL_HEAD)
        n = int.from_bytes(head[80:], "little")
        if self._size != _STL_HEAD + _STL_ROW.itemsize * n and head.lstrip()[:5].lower() == b"solid":
            raise NotMapped
        if len(head) < _STL_HEAD:
            raise MeshReadError(f"{self.name} cannot be streamed: it ends within its first 84 bytes")
        self.n_facets: int | None = n

    def _rows(self, where: str) -> NDArray[np.void]:
        return self._stored.mapped(_STL_ROW, _STL_HEAD, self.n_facets or 0, where=where)

    def pieces(self, size: int) -> Iterator[Piece]:
        """The facets, `size` at a time."""
        n = self.n_facets or 0
        missing = _STL_HEAD + _STL_ROW.itemsize * n - self._size
        if missing > 0:
            facet = (self._size - _STL_HEAD) // _STL_ROW.itemsize
            where = f"chunk {facet // size}, facet {facet}"
            raise MeshReadError(f"{self.name}, {where}: the file ends before its {n} facets do")
        if missing < 0:
            raise MeshReadError(f"{self.name} cannot be streamed: it has {-missing} bytes more than {n} facets take")
        return self._stored.watched(self.name, pieces_of(self, n, size))

    def chunk(self, number: int, size: int) -> Chunk:
        """Read some of the facets."""
        first = number * size
        rows = self._rows(f"{self.name}, chunk {number}, facet {first}")
        return Chunk(_doubles(rows[first : first + size]["corners"]), None)

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Corners of some facets."""
        return _doubles(self._rows(self.name)["corners"][facets])


def _doubles(corners: NDArray[np.float32]) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore"):  # a NaN may be a signalling one; none is accepted
        return np.ascontiguousarray(corners).astype(np.float64)
