"""Planes gathered in thick ones, so that bounds over cells stay certain though few planes are held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["ThickPlanes"]

_FINEST = 2.0**-14  # widths are powers of two, so that planes gathered once stay together
_UNIT = 2.0**-53


class ThickPlanes:
    """At most about `most` planes of the unit cube, each with a weight and a pad that covers all it stands for.

    Planes whose normals and offsets fall into one cell of a lattice of `width` become one: the first, with the sum
    of the weights. |n . x - d| of another member differs in the cube by at most |n - n'|_1 + |d - d'|, which is
    added to the pad. As long as there are no more than `most`, all stay as they are.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self.width = 0.0
        self.normals, self.offsets = np.empty((0, 3)), np.empty(0)
        self.pads, self.weights = np.empty(0), np.empty(0, np.int64)

    def add(
        self,
        normals: NDArray[np.float64],
        offsets: NDArray[np.float64],
        pads: NDArray[np.float64],
        weights: NDArray[np.int64],
    ) -> None:
        """Take in more planes."""
        self.normals = np.concatenate([self.normals, normals])
        self.offsets = np.concatenate([self.offsets, offsets])
        self.pads = np.concatenate([self.pads, pads])
        self.weights = np.concatenate([self.weights, weights])
        if self.width:
            self._gather()
        while len(self.offsets) > self._most:
            self.width = 2.0 * self.width if self.width else _FINEST
            self._gather()

    def _gather(self) -> None:
        cells = np.floor(np.column_stack([self.normals, self.offsets]) / self.width).astype(np.int64)
        order = np.lexsort(cells.T)
        is_first = np.concatenate([[True], (np.diff(cells[order], axis=0) != 0).any(axis=1)])
        starts = np.flatnonzero(is_first)
        heads = order[starts][np.cumsum(is_first) - 1]  # of each, in the order
        apart = np.abs(self.normals[order] - self.normals[heads]).sum(axis=1)
        apart += np.abs(self.offsets[order] - self.offsets[heads])
        pads = self.pads[order] + apart * (1.0 + 16.0 * _UNIT)
        pads[starts] = self.pads[order[starts]]
        self.pads = np.maximum.reduceat(pads, starts)
        self.weights = np.add.reduceat(self.weights[order], starts)
        self.normals, self.offsets = self.normals[order[starts]], self.offsets[order[starts]]
