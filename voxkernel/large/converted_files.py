"""Text files and polygons: read once, in stretches, into temporary files of triangles that are mapped."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from voxkernel._input_file import input_file
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.large.chunks import Chunk, Piece, check_ids, pieces_of
from voxkernel.large.temporary_arrays import TemporaryRows
from voxkernel.mesh.files import read_polygons
from voxkernel.mesh.polygons import polygon_planes
from voxkernel.mesh.usual_files import usual_parts

__all__ = ["ConvertedFile"]

_RTOL = 1e-9  # as of `as_mesh`
_MOST_POLYGONS = 1 << 17  # cut at a time

_Triangles = tuple[NDArray[np.float64], NDArray[np.int64] | None]


class ConvertedFile:
    """A file that cannot be mapped as it is; polygons are cut into triangles, which are facets each.

    Triangles share vertices by number; those of a text ``.stl`` share equal corners. What is unusual in a file is read
    in memory, by the parser that names the line of an error.
    """

    def __init__(self, path: str | os.PathLike[str], folder: str | os.PathLike[str] | None) -> None:
        self.path = Path(input_file(path, MeshReadError))
        self.name = f"'{self.path}'"
        self.n_facets: int | None = None
        self._folder = folder
        self._kept: _Triangles | None = None

    def pieces(self, size: int) -> Iterator[Piece]:
        """The triangles, `size` at a time, read here: the temporary files are no one else's."""
        points, faces = self._triangles()
        self.n_facets = len(points) // 3 if faces is None else len(faces)
        return (piece.read() for piece in pieces_of(self, self.n_facets, size))

    def chunk(self, number: int, size: int) -> Chunk:
        """Some of the triangles."""
        points, faces = self._triangles()
        first = number * size
        if faces is None:
            return Chunk(np.array(points[3 * first : 3 * (first + size)]).reshape(-1, 3, 3), None)
        ids = np.array(faces[first : first + size])
        check_ids(self.name, number, first, ids, len(points))
        return Chunk(np.array(points[ids]), ids)

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Corners of some triangles."""
        points, faces = self._triangles()
        return np.array(points.reshape(-1, 3, 3)[facets] if faces is None else points[faces[facets]])

    def _triangles(self) -> _Triangles:
        if self._kept is None:
            try:
                self._kept = self._converted()
            except OSError as error:
                if isinstance(error, MeshReadError):
                    raise
                raise MeshReadError(f"{self.name} cannot be streamed: {error.strerror or error}") from error
        return self._kept

    def _converted(self) -> _Triangles:
        points = TemporaryRows(np.float64, 3, self._folder)
        flat, sizes = TemporaryRows(np.int64, 1, self._folder), TemporaryRows(np.int64, 1, self._folder)
        only_triangles = True
        for part in usual_parts(self.path):
            if part is None:
                found = read_polygons(self.path)
                return self._cut(*found) if (found.sizes != 3).any() else (found.vertices, found.flat.reshape(-1, 3))
            points.write(part.points)
            flat.write(part.flat)
            sizes.write(part.sizes)
            only_triangles &= bool((part.sizes == 3).all())
        if not points.n or (not sizes.n and self.path.suffix.lower() != ".stl"):
            raise MeshError(f"{self.name} must hold facets; got none")
        if not sizes.n:
            return points.rows(), None
        if only_triangles:
            return points.rows(), flat.rows().reshape(-1, 3)
        return self._cut(points.rows(), flat.rows().reshape(-1), sizes.rows().reshape(-1))

    def _cut(self, points: NDArray[np.float64], flat: NDArray[np.int64], sizes: NDArray[np.int64]) -> _Triangles:
        """Cut polygons as in memory."""
        faces, at = TemporaryRows(np.int64, 3, self._folder), 0
        for first in range(0, len(sizes), _MOST_POLYGONS):
            some = np.array(sizes[first : first + _MOST_POLYGONS])
            if some.min() < 3:
                got = f"{some.min()} in polygon {first + int(some.argmin())}"
                raise MeshError(f"{self.name}: `polygons` must have at least 3 corners each; got {got}")
            ids = np.array(flat[at : at + int(some.sum())])
            at += len(ids)
            owner = np.repeat(np.arange(first, first + len(some)), some)
            wrong = np.flatnonzero((ids < 0) | (ids >= len(points)))
            if len(wrong):
                text = f"must hold vertex ids from 0 to {len(points) - 1}; got {ids[wrong[0]]}"
                raise MeshError(f"{self.name}, polygon {owner[wrong[0]]}: `polygons` {text}")
            used, local = np.unique(ids, return_inverse=True)
            corners = np.array(points[used])
            is_bad = ~np.isfinite(corners).all(axis=1)
            if is_bad.any():
                polygon = owner[int(np.argmax(np.take(is_bad, local)))]
                raise MeshError(f"{self.name}, polygon {polygon}: `vertices` must be finite; got NaN or infinity")
            faces.write(used[polygon_planes(corners, local.reshape(-1), some, _RTOL).triangles])
        return points, faces.rows()
