"""One cell out of many, and which side of its faces is out."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import orient_cells
from voxkernel.mesh.zero_area import exact_integers

__all__ = ["cell_polygons", "exact_volume", "outward"]

_FAULTS = {
    -1: "open or not a surface: an edge does not have exactly two faces",
    -2: "its faces cannot be turned alike: the surface is one-sided",
    -3: "its faces form several separate surfaces, whose sides are not known",
}


def cell_polygons(
    vertices: NDArray[np.float64],
    face_offsets: NDArray[np.int64],
    face_vertices: NDArray[np.int64],
    cell_offsets: NDArray[np.int64],
    cell_faces: NDArray[np.int64],
    cell_flips: NDArray[np.bool_],
    index: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices, flat ids and sizes of the faces of one cell, vertices in the order of first use."""
    rows = range(int(cell_offsets[index]), int(cell_offsets[index + 1]))
    loops: list[NDArray[np.int64]] = []
    for row in rows:
        face = cell_faces[row]
        loop = face_vertices[face_offsets[face] : face_offsets[face + 1]]
        loops.append(loop[::-1] if cell_flips[row] else loop)
    flat = np.concatenate(loops) if loops else np.zeros(0, np.int64)
    used, first, ids = np.unique(flat, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return vertices[used[order]], rank[ids], np.array([len(loop) for loop in loops], np.int64)


def exact_volume(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Fraction:
    """Volume a closed surface encloses, exactly."""
    points = exact_integers(vertices)
    largest = np.unravel_index(np.abs(vertices).argmax(), vertices.shape)
    if points[largest] == 0:
        return Fraction(0)
    unit = Fraction(float(vertices[largest])) / points[largest]
    a, b, c = (points[triangles[:, k]] - points[0] for k in range(3))
    cross = (
        a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1])
        + a[:, 1] * (b[:, 2] * c[:, 0] - b[:, 0] * c[:, 2])
        + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    )
    return int(cross.sum()) * unit**3 / 6


def outward(
    vertices: NDArray[np.float64],
    face_offsets: NDArray[np.int64],
    face_vertices: NDArray[np.int64],
    cell_offsets: NDArray[np.int64],
    cell_faces: NDArray[np.int64],
    flips: NDArray[np.bool_],
    problems: list[str],
) -> int:
    """Turn the faces of every cell outward by changing `flips`; count the cells with a turned face."""
    arrays = (vertices, face_offsets, face_vertices, cell_offsets, cell_faces)
    answer = np.zeros(len(cell_offsets) - 1, np.int64)
    orient_cells(*arrays, flips, answer)
    for cell in np.flatnonzero(answer < 1).tolist():
        if answer[cell] < 0:
            problems[cell] = problems[cell] or _FAULTS[int(answer[cell])]
            continue
        points, flat, sizes = cell_polygons(*arrays, flips, cell)
        if np.isfinite(points).all() and exact_volume(points, _fans(flat, sizes)) < 0:
            flips[cell_offsets[cell] : cell_offsets[cell + 1]] ^= True
    owner = np.repeat(np.arange(len(answer)), np.diff(cell_offsets))
    return len(np.unique(owner[flips]))


def _fans(flat: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Every polygon as triangles about its first corner."""
    starts = np.cumsum(sizes) - sizes
    rows = [flat[[s, s + k, s + k + 1]] for s, n in zip(starts, sizes, strict=True) for k in range(1, n - 1)]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)
