"""Area centroid and principal frame of triangles that come in blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.triangles import doubled_areas

__all__ = ["BLOCK", "area_frame"]

# Triangles in a block: sums over blocks of another size are rounded otherwise.
BLOCK = 1 << 16

Blocks = Callable[[], Iterable[NDArray[np.float64]]]


def area_frame(blocks: Blocks) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute area centroid and principal frame in three passes over the corners (m, 3, 3), `BLOCK` at a time."""
    base = next(iter(blocks()))[0, 0].copy()
    total, first = 0.0, np.zeros(3)
    for corners in blocks():
        moved = corners - base
        areas = 0.5 * doubled_areas(moved)
        total += areas.sum()
        first += areas @ moved.mean(axis=1)
    mean = first / total
    second = np.zeros((3, 3))
    for areas, moved, middles in _about(mean, base, blocks):
        weighted = areas[:, None]
        part = 9.0 * (middles * weighted).T @ middles
        for k in range(3):
            part += (moved[:, k] * weighted).T @ moved[:, k]
        second += part
    _, vectors = np.linalg.eigh(second / 12.0)
    frame = vectors[:, ::-1].T.copy()
    third = np.zeros(2)
    for areas, _, middles in _about(mean, base, blocks):
        third += [areas @ (middles @ frame[row]) ** 3 for row in range(2)]
    frame[:2][third < 0] *= -1
    frame[2] = np.cross(frame[0], frame[1])
    return base + mean, frame


def _about(
    mean: NDArray[np.float64], base: NDArray[np.float64], blocks: Blocks
) -> Iterable[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Areas, corners and middles relative to the centroid; `base` first, so that far surfaces lose nothing."""
    for corners in blocks():
        moved = corners - base
        yield 0.5 * doubled_areas(moved), moved - mean, moved.mean(axis=1) - mean
