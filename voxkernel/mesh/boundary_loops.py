"""Boundary loops of a surface, each made when it is asked for: a soup has as many as facets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from voxkernel import _core

__all__ = ["BoundaryLoops", "boundary_loops"]


class BoundaryLoops(Sequence[NDArray[np.int64]]):
    """Loops of vertex ids: a sequence of (k,) int64 arrays, read-only, held as one array with the ends of its parts."""

    __slots__ = ("_starts", "_vertices")

    def __init__(self, vertices: NDArray[np.integer[Any]], starts: NDArray[np.integer[Any]]) -> None:
        self._vertices, self._starts = vertices, starts

    def __len__(self) -> int:
        return len(self._starts) - 1

    @overload
    def __getitem__(self, index: int) -> NDArray[np.int64]: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[NDArray[np.int64], ...]: ...
    def __getitem__(self, index: int | slice) -> NDArray[np.int64] | tuple[NDArray[np.int64], ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        at = range(len(self))[index]
        loop = self._vertices[self._starts[at] : self._starts[at + 1]].astype(np.int64)
        loop.setflags(write=False)
        return loop

    def __iter__(self) -> Iterator[NDArray[np.int64]]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"BoundaryLoops({len(self)} loops, {len(self._vertices)} vertices)"

    def __reduce__(self) -> tuple[Any, ...]:
        return BoundaryLoops, (self._vertices, self._starts)


def boundary_loops(faces: NDArray[np.int64], n_vertices: int, border: NDArray[np.int64]) -> BoundaryLoops:
    """Chain boundary half-edges into simple loops, in the order in which they close."""
    return BoundaryLoops(*_core.boundary_loops(faces, n_vertices, border))
