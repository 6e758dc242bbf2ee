"""A copy of a surface with at most so many facets, for everything that does not need them all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.triangles import bounds_of

__all__ = ["MOST_FACETS", "clustered", "smoothed", "thinned"]

MOST_FACETS = 20_000
_FINEST = 1e-5  # of the extent: least edge of a cell, so that cells can be numbered


def thinned(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], area: float, most: int = MOST_FACETS
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Join the vertices in each cell of a grid whose edge follows from the area, until few enough facets are left.

    Noise makes the area of small facets many times too large, and the cells: where fewer than half are left, they
    become smaller. A surface that is small enough is given back as it is; so is one that would lose nearly everything.
    """
    if len(faces) <= most:
        return vertices, faces
    cell = float(np.sqrt(2.0 * area / most))
    thin, triangles = clustered(vertices, faces, cell)
    for _ in range(4):
        few = len(triangles) / most
        if 0.5 <= few <= 1.0:
            break
        cell *= (1.1 if few > 1.0 else 1.2) * float(np.sqrt(max(few, 1e-3)))
        thin, triangles = clustered(vertices, faces, cell)
    if len(triangles) < 0.05 * most:
        return vertices, faces
    return thin, triangles


def clustered(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], cell: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Put the mean of the vertices in each cell of a grid in their place; triangles that fall together are one."""
    low, high = bounds_of(vertices)
    cell = max(cell, _FINEST * float((high - low).max()))
    columns = [np.floor((x - a) / cell + 0.5).astype(np.int64) for x, a in zip(vertices.T, low, strict=True)]
    sizes = [int(c.max()) + 1 for c in columns]
    number, count = _numbered((columns[0] * sizes[1] + columns[1]) * sizes[2] + columns[2], sizes)
    inside = np.bincount(number, minlength=count)
    means = np.column_stack([np.bincount(number, weights=x, minlength=count) / inside for x in vertices.T])
    a, b, c = (number[faces[:, k]] for k in range(3))
    kept = np.flatnonzero((a != b) & (b != c) & (c != a))
    return means, _distinct(np.column_stack([a[kept], b[kept], c[kept]]), count)


def _numbered(keys: NDArray[np.int64], sizes: list[int]) -> tuple[NDArray[np.int64], int]:
    """Number the cells in use in their order: by a table of all cells where that is small, else by sorting."""
    cells = sizes[0] * sizes[1] * sizes[2]
    if cells > 8 * len(keys) + 1_000_000:
        found, number = np.unique(keys, return_inverse=True)
        return number.ravel(), len(found)
    used = np.zeros(cells, np.bool_)
    used[keys] = True
    numbers = np.cumsum(used) - 1
    return numbers[keys], int(numbers[-1]) + 1


def _distinct(triangles: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Keep one of the triangles with the same corners in the same sense, the first one, in their order."""
    first = triangles.argmin(axis=1)
    rows = np.arange(len(triangles))
    a, b, c = (triangles[rows, (first + k) % 3] for k in range(3))
    # Sorted by the last two corners, then stably by the first: equal ones stand together, the first of them in front.
    order = np.argsort(b * np.int64(count) + c, kind="stable")
    order = order[np.argsort(a[order], kind="stable")]
    same = np.zeros(len(order), np.bool_)
    same[1:] = np.logical_and.reduce([x[order[1:]] == x[order[:-1]] for x in (a, b, c)])
    return np.column_stack([a, b, c])[np.sort(order[~same])]


def smoothed(vertices: NDArray[np.float64], faces: NDArray[np.int64], steps: int) -> NDArray[np.float64]:
    """Replace each vertex by the mean of it and its neighbours, so many times."""
    from scipy.sparse import csr_array

    n = len(vertices)
    ends = np.concatenate([faces, faces[:, [1, 2, 0]]]).ravel(), np.concatenate([faces[:, [1, 2, 0]], faces]).ravel()
    links = csr_array((np.ones(len(ends[0])), ends), shape=(n, n))  # adds up what is there twice
    links.data[:] = 1.0
    around = 1.0 / (1.0 + np.diff(links.indptr))[:, None]
    points = vertices
    for _ in range(steps):
        points = (points + links @ points) * around
    return points
