"""What every source of a stream gives: triangles in chunks, as often as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from voxkernel.errors import MeshError

__all__ = ["Chunk", "Indexed", "IndexedPiece", "Piece", "Source", "check_finite", "check_ids", "pieces_of", "refusal"]


class Chunk(NamedTuple):
    """Some triangles: corners (m, 3, 3), and the vertex ids (m, 3) where triangles share vertices by number."""

    corners: NDArray[np.float64]
    ids: NDArray[np.int64] | None

    @property
    def n_facets(self) -> int:
        """Triangles."""
        return len(self.corners)

    def read(self) -> Chunk:
        """Nothing is left to read."""
        return self


class Piece(Protocol):
    """A chunk that has been read, or what another thread or process needs to read it."""

    @property
    def n_facets(self) -> int:
        """Triangles."""
        ...

    def read(self) -> Chunk:
        """Read it, if it has not been read."""
        ...


class Source(Protocol):
    """Triangles that can be read again and again, in the same order.

    `n_facets` is None where that is known only at the end of a pass. `take` gives the corners (k, 3, 3) of some
    facets without a pass, or None where it cannot.
    """

    name: str

    @property
    def n_facets(self) -> int | None:
        """Triangles."""
        ...

    def pieces(self, size: int) -> Iterator[Piece]:
        """All of it, at most `size` triangles at a time."""
        ...

    def take(self, facets: NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Corners of some facets."""
        ...


class Indexed(Protocol):
    """A source whose chunks can be read in any order, wherever its file is."""

    def chunk(self, number: int, size: int) -> Chunk:
        """Read chunk `number` of those of `size` triangles."""
        ...


class IndexedPiece(NamedTuple):
    """Chunk `number` of a source."""

    source: Indexed
    number: int
    size: int
    n_facets: int

    def read(self) -> Chunk:
        """Read it."""
        return self.source.chunk(self.number, self.size)


def pieces_of(source: Indexed, n: int, size: int) -> Iterator[IndexedPiece]:
    """All chunks of a source of `n` triangles."""
    for number, first in enumerate(range(0, n, size)):
        yield IndexedPiece(source, number, size, min(size, n - first))


def refusal(name: str, chunk: int, facet: int, text: str) -> MeshError:
    """An error that names chunk and facet."""
    return MeshError(f"{name}, chunk {chunk}, facet {facet}: {text}")


def check_ids(name: str, chunk: int, first: int, ids: NDArray[Any], n_vertices: int) -> None:
    """Refuse vertex ids that are none; `first` is the facet that the chunk begins with."""
    if not len(ids) or (ids.min() >= 0 and ids.max() < n_vertices):
        return
    row, column = np.argwhere((ids < 0) | (ids >= n_vertices))[0]
    text = f"`faces` must hold vertex ids from 0 to {n_vertices - 1}; got {ids[row, column]}"
    raise refusal(name, chunk, first + int(row), text)


def check_finite(name: str, chunk: int, first: int, corners: NDArray[np.float64]) -> None:
    """Refuse corners that are no numbers."""
    if np.isfinite(corners).all():
        return
    row = int(np.argmin(np.isfinite(corners).all(axis=(1, 2))))
    raise refusal(name, chunk, first + row, "`vertices` must be finite; got NaN or infinity")
