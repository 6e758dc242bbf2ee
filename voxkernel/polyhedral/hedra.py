"""Text of .hedra: vertices, faces, and cells that share the faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.ply import ranges
from voxkernel.polyhedral.text_numbers import as_count, as_numbers, as_whole, split_lines

__all__ = ["parse_hedra"]

_Ids = NDArray[np.int64]


def parse_hedra(text: str) -> tuple[NDArray[np.float64], _Ids, _Ids, _Ids, _Ids]:
    """Vertices, corners of all faces in a row, face sizes, faces of all cells in a row, cell sizes; ids from 0.

    The file has the counts of vertices, faces and cells; then their rows. Faces and cells are (count, numbers from 1).
    Face numbers of a cell may be negative; files do not agree on what that means, so the sign is not used.
    """
    rows = [(line, words) for line, words in enumerate(split_lines(text), start=1) if words]
    if not rows:
        raise ValueError("the file is empty")
    line, head = rows[0]
    if len(head) != 3:
        raise ValueError(f"line {line}: its first line is not the numbers of vertices, faces and cells")
    names = ("vertices", "faces", "cells")
    n_vertices, n_faces, n_cells = (as_count(word, line, name) for word, name in zip(head, names, strict=True))
    n_rows = 1 + n_vertices + n_faces + n_cells
    if len(rows) < n_rows:
        raise ValueError(f"it ends before its {n_vertices} vertices, {n_faces} faces and {n_cells} cells do")
    if len(rows) > n_rows:
        counts = f"{n_vertices} vertices, {n_faces} faces and {n_cells} cells"
        raise ValueError(f"line {rows[n_rows][0]}: there are rows after the {counts}")
    middle, end = 1 + n_vertices, 1 + n_vertices + n_faces
    for line, words in rows[1:middle]:
        if len(words) != 3:
            raise ValueError(f"line {line}: a vertex must have 3 coordinates; got {len(words)} numbers")
    values, _, _ = _flat(rows[1:middle])
    corners, corner_lines, sizes = _counted(rows[middle:end], "face")
    faces, face_lines, cell_sizes = _counted(rows[end:], "cell")
    flat = as_whole(corners, corner_lines, 1, n_vertices, "vertex number") - 1
    cell_faces = as_whole(np.abs(faces), face_lines, 1, n_faces, "face number (without its sign)") - 1
    return values.reshape(-1, 3), flat, sizes, cell_faces, cell_sizes


def _flat(rows: list[tuple[int, list[str]]]) -> tuple[NDArray[np.float64], _Ids, _Ids]:
    """All numbers of some rows, the line of each, and how many each row has."""
    width = np.array([len(words) for _, words in rows], np.int64)
    lines = np.repeat(np.array([line for line, _ in rows], np.int64), width)
    return as_numbers([word for _, words in rows for word in words], lines), lines, width


def _counted(rows: list[tuple[int, list[str]]], name: str) -> tuple[NDArray[np.float64], _Ids, _Ids]:
    """Rows that start with the number of what follows: that, its lines, and the numbers."""
    values, lines, width = _flat(rows)
    starts = np.cumsum(width) - width
    wrong = np.flatnonzero(values[starts] != width - 1)
    if len(wrong):
        at = int(starts[wrong[0]])
        raise ValueError(
            f"line {lines[at]}: a {name} does not have as many numbers as it says: "
            f"{values[at]:.17g}, and {width[wrong[0]] - 1} follow"
        )
    sizes = width - 1
    after = ranges(starts + 1, sizes)
    return values[after], lines[after], sizes
