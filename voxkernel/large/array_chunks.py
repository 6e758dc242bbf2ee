"""Streams of arrays: chunks made by the caller, facets of Parquet files, and several sources as one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.large.chunks import Chunk, Piece, Source, check_finite, check_ids, refusal
from voxkernel.large.stored_file import StoredFile

__all__ = ["ArraySource", "ChunkSource", "ParquetFile", "Tiles"]

_REAL = "fiu"  # kinds of numbers
_COLUMNS = tuple(f"{axis}{corner}" for corner in range(3) for axis in "xyz")


class ArraySource:
    """Vertices and triangles in arrays, which may be mapped files; they share vertices by number."""

    def __init__(self, vertices: Any, faces: Any) -> None:
        self.name = "arrays"
        self._vertices, self._faces = _array("`vertices`", vertices), _array("`faces`", faces)
        if self._vertices.ndim != 2 or self._vertices.shape[1] != 3:
            raise MeshError(f"`vertices` must have shape (n, 3); got {self._vertices.shape}")
        if self._vertices.dtype.kind not in _REAL:
            raise TypeError(f"`vertices` must be an array of real numbers; got dtype {self._vertices.dtype}")
        if self._faces.ndim != 2 or self._faces.shape[1] != 3:
            raise MeshError(f"`faces` must have shape (m, 3); got {self._faces.shape} (triangulate first)")
        if self._faces.dtype.kind not in "iu":
            raise TypeError(f"`faces` must be integers; got {self._faces.dtype}")
        self.n_facets: int | None = len(self._faces)

    def pieces(self, size: int) -> Iterator[Chunk]:
        """Read the faces `size` at a time."""
        for number, first in enumerate(range(0, len(self._faces), size)):
            part = np.ascontiguousarray(self._faces[first : first + size])
            check_ids(self.name, number, first, part, len(self._vertices))
            ids = part.astype(np.int64)
            yield Chunk(self._vertices[ids].astype(np.float64), ids)

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Corners of some facets."""
        return self._vertices[self._faces[facets]].astype(np.float64)


class ChunkSource:
    """Pairs (vertices, faces), the ids of each pair its own; equal corners of all of them are one vertex."""

    def __init__(self, make: Callable[[], Iterable[Any]]) -> None:
        self.name = "stream"
        self.n_facets: int | None = None
        self._make = make

    def pieces(self, size: int) -> Iterator[Chunk]:
        """Ask for the pairs once more; large ones come in parts."""
        first = 0
        for number, pair in enumerate(self._pairs()):
            where = f"{self.name}, chunk {number}"
            if not isinstance(pair, tuple | list) or len(pair) != 2:
                raise MeshError(f"{where}: must be a pair (vertices, faces); got {type(pair).__name__}")
            points, faces = _array(f"{where}: `vertices`", pair[0]), _array(f"{where}: `faces`", pair[1])
            if points.ndim != 2 or points.shape[1] != 3:
                raise MeshError(f"{where}: `vertices` must have shape (n, 3); got {points.shape}")
            if points.dtype.kind not in _REAL:
                raise MeshError(f"{where}: `vertices` must be real numbers; got dtype {points.dtype}")
            if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
                raise MeshError(f"{where}: `faces` must be integers of shape (m, 3); got {faces.dtype} {faces.shape}")
            check_ids(self.name, number, first, faces, len(points))
            ids = faces.astype(np.int64)
            for start in range(0, len(ids), size):
                corners = points[ids[start : start + size]].astype(np.float64)
                check_finite(self.name, number, first + start, corners)
                yield Chunk(np.ascontiguousarray(corners), None)
            first += len(ids)

    def _pairs(self) -> Iterator[Any]:
        found: Any = self._make()
        try:
            return iter(found)
        except TypeError:
            raise MeshError(
                f"{self.name}: the function must return pairs (vertices, faces), one after the other; "
                f"got {type(found).__name__}"
            ) from None

    def take(self, facets: NDArray[np.int64]) -> None:
        """There is no way but a pass."""


def _array(what: str, given: Any) -> NDArray[Any]:
    try:
        return np.asarray(given)
    except ValueError:
        raise MeshError(f"{what} must be an array; got rows of different lengths") from None


class ParquetFile:
    """Facets as rows of nine numbers, x0 y0 z0 x1 y1 z1 x2 y2 z2; equal corners are one vertex."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self.name = os.fspath(path), f"'{os.fspath(path)}'"
        try:
            schema = optional("pyarrow.parquet").read_schema(self.path)
            self.n_facets: int | None = optional("pyarrow.parquet").read_metadata(self.path).num_rows
        except (OSError, optional("pyarrow").ArrowException) as error:
            raise MeshReadError(f"{self.name} cannot be streamed: {' '.join(str(error).split())[:200]}") from None
        missing = [name for name in _COLUMNS if name not in schema.names]
        if missing:
            raise MeshReadError(f"{self.name} must have the columns {' '.join(_COLUMNS)}; got none called {missing[0]}")

        types = optional("pyarrow").types
        for name in _COLUMNS:
            kind = schema.field(name).type
            if not (types.is_floating(kind) or types.is_integer(kind)):
                raise MeshReadError(f"{self.name} must have numbers in the column {name}; got {kind}")
        self._stored = StoredFile.of(Path(self.path))

    def pieces(self, size: int) -> Iterator[Chunk]:
        """Read the rows `size` at a time."""
        return self._stored.watched(self.name, self._read(size))

    def _read(self, size: int) -> Iterator[Chunk]:
        try:
            yield from self._batches(size)
        except MeshReadError:
            raise
        except (OSError, optional("pyarrow").ArrowException) as error:
            raise MeshReadError(f"{self.name} cannot be read: {' '.join(str(error).split())[:200]}") from None

    def _batches(self, size: int) -> Iterator[Chunk]:
        first = 0
        with optional("pyarrow.parquet").ParquetFile(self.path) as file:
            for number, batch in enumerate(file.iter_batches(batch_size=size, columns=list(_COLUMNS))):
                columns = [batch.column(name) for name in _COLUMNS]
                for name, column in zip(_COLUMNS, columns, strict=True):
                    if column.null_count:
                        facet = first + int(np.argmax(column.is_null().to_numpy(zero_copy_only=False)))
                        raise refusal(self.name, number, facet, f"{name} must be a number; got null")
                table = np.stack([column.to_numpy(zero_copy_only=False) for column in columns], axis=1)
                yield Chunk(table.astype(np.float64).reshape(-1, 3, 3), None)
                first += len(table)

    def take(self, facets: NDArray[np.int64]) -> None:
        """There is no way but a pass."""


class _TilePiece(NamedTuple):
    """A piece of a tile, whose corners are known by their positions."""

    piece: Piece
    name: str
    number: int
    first: int

    @property
    def n_facets(self) -> int:
        return self.piece.n_facets

    def read(self) -> Chunk:
        corners = self.piece.read().corners
        check_finite(self.name, self.number, self.first, corners)
        return Chunk(corners, None)


class Tiles:
    """Several sources as one surface; equal corners are one vertex, within a tile and across."""

    def __init__(self, tiles: Sequence[Source], *, name: str = "") -> None:
        self.name = name or f"{len(tiles)} tiles"
        self._tiles = tiles

    @property
    def n_facets(self) -> int | None:
        """Those of all tiles, where every tile knows them."""
        counts = [tile.n_facets for tile in self._tiles]
        return None if None in counts else sum(n for n in counts if n is not None)

    def pieces(self, size: int) -> Iterator[Piece]:
        """Go from tile to tile; an error names its chunk and facet in the tile."""
        for tile in self._tiles:
            first = 0
            for number, piece in enumerate(tile.pieces(size)):
                yield _TilePiece(piece, tile.name, number, first)
                first += piece.n_facets

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Corners of some facets, if every tile knows them without a pass."""
        if self.n_facets is None:
            return None
        starts = np.cumsum([0, *(tile.n_facets or 0 for tile in self._tiles)])
        found = np.empty((len(facets), 3, 3))
        for tile, (low, high) in zip(self._tiles, pairwise(starts.tolist()), strict=True):
            mine = np.flatnonzero((facets >= low) & (facets < high))
            if len(mine):
                corners = tile.take(facets[mine] - low)
                if corners is None:
                    return None
                found[mine] = corners
        return found
