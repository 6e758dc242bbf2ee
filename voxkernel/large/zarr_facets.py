"""Facets in a Zarr array: (n, 9) or (n, 3, 3) numbers; equal corners are one vertex."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.errors import MeshReadError
from voxkernel.large.chunks import Chunk, Piece, pieces_of

__all__ = ["ZarrFacets"]


class ZarrFacets:
    """An array of corners, a row each facet."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self.name = os.fspath(path), f"'{os.fspath(path)}'"
        if not os.path.exists(self.path):
            raise MeshReadError(f"`path` must be an existing file; got {self.name}")
        shape, dtype = tuple(self._array().shape), np.dtype(self._array().dtype)
        if shape[1:] not in ((9,), (3, 3)) or dtype.kind not in "fiu":
            raise MeshReadError(
                f"{self.name} must hold facets as an array (n, 9) or (n, 3, 3) of numbers; got {shape} of {dtype}"
            )
        self.n_facets: int | None = shape[0]

    def _array(self) -> Any:
        zarr = optional("zarr")
        try:
            return zarr.open_array(self.path, mode="r")
        except Exception as error:  # Zarr has errors of many kinds
            raise MeshReadError(f"{self.name} cannot be streamed: {' '.join(str(error).split())[:200]}") from None

    def pieces(self, size: int) -> Iterator[Piece]:
        """The rows, `size` at a time."""
        return pieces_of(self, self.n_facets or 0, size)

    def chunk(self, number: int, size: int) -> Chunk:
        """Read some of the rows."""
        first = number * size
        try:
            rows = self._array()[first : min(first + size, self.n_facets or 0)]
        except MeshReadError:
            raise
        except Exception as error:
            text = f"cannot be read: {' '.join(str(error).split())[:200]}"
            raise MeshReadError(f"{self.name}, chunk {number}, facet {first}: {text}") from None
        return Chunk(np.ascontiguousarray(rows, np.float64).reshape(-1, 3, 3), None)

    def take(self, facets: NDArray[np.int64]) -> None:
        """A pass reads its chunks but once."""
