"""Triangles of glTF files, .gltf and .glb, whose buffers are mapped into memory.

Khronos Group, glTF 2.0 Specification, 2021: sections 3.5 (scenes, nodes), 3.6 (buffers, accessors), 3.7 (meshes), 4.4
(the binary form).
"""

from __future__ import annotations

import base64
import binascii
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from voxkernel._input_file import input_file
from voxkernel.errors import MeshReadError
from voxkernel.large.chunks import Chunk, Piece, check_ids, pieces_of
from voxkernel.large.stored_file import StoredFile

__all__ = ["gltf_primitives"]

_INDICES = {5121: "u1", 5123: "<u2", 5125: "<u4"}
_TRIANGLES = 4
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_MOST_JSON = 1 << 28


def gltf_primitives(path: str | os.PathLike[str]) -> list[GltfPrimitive]:
    """The triangles of all meshes of the scene, moved by its nodes."""
    file = Path(input_file(path, MeshReadError))
    try:
        return _File(file).primitives()
    except (ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise MeshReadError(f"'{file}' cannot be streamed: {kind}{' '.join(str(error).split())[:200]}") from None


class GltfPrimitive:
    """Indexed triangles and where they stand; corners are moved in doubles."""

    def __init__(self, name: str, points: _View, ids: _View | None, matrix: NDArray[np.float64]) -> None:
        self.name, self._points, self._ids, self._matrix = name, points, ids, matrix
        self._is_mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)  # then the corners run the other way round
        self.n_facets: int | None = (points.n if ids is None else ids.n) // 3

    def pieces(self, size: int) -> Iterator[Piece]:
        """The triangles, `size` at a time."""
        pieces: Iterator[Piece] = pieces_of(self, self.n_facets or 0, size)
        for view in (self._points, self._ids):
            if view is not None and view.stored is not None:
                pieces = view.stored.watched(self.name, pieces)
        return pieces

    def chunk(self, number: int, size: int) -> Chunk:
        """Read some of the triangles."""
        first = number * size
        where = f"{self.name}, chunk {number}, facet {first}"
        rows = np.arange(first, min(first + size, self.n_facets or 0))
        ids = self._corner_ids(rows, where)
        check_ids(self.name, number, first, ids, self._points.n)
        return Chunk(self._placed(ids, where), None)

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Corners of some triangles."""
        return self._placed(self._corner_ids(facets, self.name), self.name)

    def _corner_ids(self, facets: NDArray[np.int64], where: str) -> NDArray[np.int64]:
        corners = 3 * facets[:, None] + np.arange(3)
        if self._ids is not None:
            corners = self._ids.rows(where)[:, 0][corners].astype(np.int64)
        return corners[:, ::-1].copy() if self._is_mirrored else corners

    def _placed(self, ids: NDArray[np.int64], where: str) -> NDArray[np.float64]:
        with np.errstate(invalid="ignore"):  # a NaN may be a signalling one; none is accepted
            corners = self._points.rows(where)[ids].astype(np.float64)
        if np.array_equal(self._matrix, np.eye(4)):
            return corners
        return corners @ self._matrix[:3, :3].T + self._matrix[:3, 3]


class _View:
    """Rows of numbers somewhere in a buffer: a file, or bytes."""

    def __init__(self, source: Path | bytes, start: int, n: int, stride: int, dtype: str, width: int) -> None:
        self._source, self._start, self.n, self._stride = source, start, n, stride
        self.stored = None if isinstance(source, bytes) else StoredFile.of(source)
        self._dtype, self._width = np.dtype(dtype), width

    def rows(self, where: str) -> NDArray[Any]:
        """The rows, mapped."""
        if not self.n:
            return np.empty((0, self._width), self._dtype)
        size = self._stride * (self.n - 1) + self._dtype.itemsize * self._width
        if isinstance(self._source, bytes):
            data = np.frombuffer(self._source, np.uint8)[self._start : self._start + size]
        else:
            assert self.stored is not None
            data = self.stored.mapped(np.uint8, self._start, size, where=where)
        return np.ndarray((self.n, self._width), self._dtype, data, strides=(self._stride, self._dtype.itemsize))


class _File:
    """A file, its JSON, and where its buffers are."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._binary: tuple[int, int] | None = None  # start and length of the buffer of a .glb
        with file.open("rb") as stream:
            head = stream.read(12)
            if head[:4] != b"glTF":
                text = head + stream.read(_MOST_JSON)
            else:
                text = self._chunks(stream)
        document = json.loads(text)
        if not isinstance(document, dict):
            raise ValueError("it is no glTF")
        self._document: dict[str, Any] = document
        used = [name for name in self._document.get("extensionsRequired", []) if name != "KHR_materials_unlit"]
        if used:
            raise ValueError(f"it needs the extension {used[0]}")

    def _chunks(self, stream: Any) -> bytes:
        text, at, end = b"", 12, self._file.stat().st_size
        while at + 8 <= end:
            stream.seek(at)
            head = stream.read(8)
            size, kind = int.from_bytes(head[:4], "little"), int.from_bytes(head[4:], "little")
            if at + 8 + size > end:
                raise ValueError(f"it ends {at + 8 + size - end} bytes before its chunks do")
            if kind == _JSON and not text:
                text = stream.read(size)
            elif kind == _BIN and self._binary is None:
                self._binary = at + 8, size
            at += 8 + size
        if not text:
            raise ValueError("it has no JSON")
        return text

    def primitives(self) -> list[GltfPrimitive]:
        document, found = self._document, list[GltfPrimitive]()
        scenes = document.get("scenes")
        nodes = document.get("nodes", [])
        if scenes:
            roots = scenes[document.get("scene", 0)].get("nodes", [])
        else:
            roots = sorted(set(range(len(nodes))) - {c for node in nodes for c in node.get("children", [])})
        waiting = [(node, np.eye(4), 0) for node in reversed(roots)]
        while waiting:
            i, above, level = waiting.pop()
            if level > len(nodes):
                raise ValueError("its nodes form a circle")
            matrix = above @ _matrix(nodes[i])
            if "mesh" in nodes[i]:
                found += [p for k, _ in enumerate(document["meshes"][nodes[i]["mesh"]]["primitives"])
                          if (p := self._primitive(nodes[i]["mesh"], k, matrix)) is not None]  # fmt: skip
            waiting += [(child, matrix, level + 1) for child in reversed(nodes[i].get("children", []))]
        if not found:
            raise ValueError("it has no triangles")
        return found

    def _primitive(self, mesh: int, k: int, matrix: NDArray[np.float64]) -> GltfPrimitive | None:
        primitive = self._document["meshes"][mesh]["primitives"][k]
        mode = primitive.get("mode", _TRIANGLES)
        if mode < _TRIANGLES:  # points and lines
            return None
        if mode > _TRIANGLES:
            raise ValueError(f"mesh {mesh} has triangles in strips or fans (mode {mode})")
        points = self._view(primitive["attributes"]["POSITION"], {5126: "<f4"}, "VEC3", 3)
        ids = self._view(primitive["indices"], _INDICES, "SCALAR", 1) if "indices" in primitive else None
        return GltfPrimitive(f"'{self._file}', mesh {mesh}, primitive {k}", points, ids, matrix)

    def _view(self, accessor: int, dtypes: dict[int, str], kind: str, width: int) -> _View:
        found = self._document["accessors"][accessor]
        if "sparse" in found or "bufferView" not in found:
            raise ValueError(f"accessor {accessor} is sparse")
        if found["componentType"] not in dtypes or found["type"] != kind:
            raise ValueError(f"accessor {accessor} has the type {found['componentType']} {found['type']}")
        dtype, n = dtypes[found["componentType"]], int(found["count"])
        view = self._document["bufferViews"][found["bufferView"]]
        size = np.dtype(dtype).itemsize * width
        stride = int(view.get("byteStride", size))
        offset = int(found.get("byteOffset", 0))
        if n < 0 or offset < 0 or stride < size or (n and offset + stride * (n - 1) + size > int(view["byteLength"])):
            raise ValueError(f"accessor {accessor} is larger than its buffer view")
        source, start = self._buffer(int(view["buffer"]), int(view.get("byteOffset", 0)) + int(view["byteLength"]))
        return _View(source, start + int(view.get("byteOffset", 0)) + offset, n, stride, dtype, width)

    def _buffer(self, number: int, end: int) -> tuple[Path | bytes, int]:
        """Where a buffer is, which must be at least `end` bytes long, and where in that it starts."""
        uri = self._document["buffers"][number].get("uri")
        source, start = self._file, 0
        if uri is None:
            if self._binary is None:
                raise ValueError(f"buffer {number} is nowhere")
            start, size = self._binary
        elif uri.startswith("data:"):
            try:
                source = base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error as error:
                raise ValueError(f"buffer {number} is no base64: {error}") from None
            size = len(source)
        else:
            source = self._file.parent / unquote(uri)
            if not source.is_file():
                raise ValueError(f"its buffer '{source}' does not exist")
            size = source.stat().st_size
        if size < end:
            raise ValueError(f"buffer {number} ends {end - size} bytes too early")
        return source, start


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """Where a node stands in the one above."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = (float(v) for v in node.get("rotation", (0, 0, 0, 1)))
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    placed = np.eye(4)
    placed[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), np.float64)
    placed[:3, 3] = node.get("translation", (0, 0, 0))
    return placed
