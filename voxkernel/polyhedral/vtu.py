"""VTK's XML files of unstructured grids (.vtu): several pieces, polyhedra old and new."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from voxkernel._vtk_arrays import Arrays, check_points, count_of, indices_of, open_pieces, points_of, row_starts

__all__ = ["VtuPiece", "parse_vtu"]


class VtuPiece(NamedTuple):
    """One piece: points, and of each cell its type, its points and, of polyhedra, its faces."""

    points: NDArray[np.float64]
    types: NDArray[np.int64]
    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]  # n + 1
    face_points: NDArray[np.int64]
    face_offsets: NDArray[np.int64]  # faces + 1
    cell_faces: NDArray[np.int64]  # n + 1, into the faces


def parse_vtu(data: bytes) -> list[VtuPiece]:
    """Pieces of a file; ValueError names the array that is wrong."""
    pieces, source = open_pieces(data, "UnstructuredGrid")
    return [_piece(piece, source) for piece in pieces]


def _piece(piece: Element, source: Arrays) -> VtuPiece:
    n_points, n_cells = count_of(piece, "NumberOfPoints"), count_of(piece, "NumberOfCells")
    points = points_of(piece, source)
    found = indices_of(piece, "Cells", source)
    if not n_cells and not found:
        found = {name: np.zeros(0, np.int64) for name in ("connectivity", "offsets", "types")}
    for name in ("connectivity", "offsets", "types"):
        if name not in found:
            raise ValueError(f"there is no array '{name}'")
    types = found["types"]
    if len(types) != n_cells:
        raise ValueError(f"array 'types' has {len(types)} values for {n_cells} cells")
    offsets = row_starts(found, "offsets", n_cells, len(found["connectivity"]))
    check_points(found["connectivity"], "connectivity", n_points)
    faces = _polyhedra(found, types) if (types == 42).any() else (offsets[:0],) * 3
    if len(faces[0]):
        check_points(faces[0], "faces", n_points)
    return VtuPiece(points, types, found["connectivity"], offsets, *faces)


_Faces = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


def _polyhedra(found: dict[str, NDArray[np.int64]], types: NDArray[np.int64]) -> _Faces:
    """Faces of the polyhedra in one row: their points, where each starts, and where those of each cell start."""
    if "face_connectivity" in found:  # since version 2.3
        for name in ("face_offsets", "polyhedron_to_faces", "polyhedron_offsets"):
            if name not in found:
                raise ValueError(f"there are polyhedra but no array '{name}'")
        flat, order = found["face_connectivity"], found["polyhedron_to_faces"]
        starts = row_starts(found, "face_offsets", len(found["face_offsets"]), len(flat))
        cells = row_starts(found, "polyhedron_offsets", len(types), len(order))
        check_points(order, "polyhedron_to_faces", len(starts) - 1)
        if not np.array_equal(np.sort(order), np.arange(len(starts) - 1)):
            raise ValueError("array 'polyhedron_to_faces' must name every face once")
        sizes = np.diff(starts)[order]
        first = np.cumsum(sizes) - sizes
        picked = np.repeat(starts[order] - first, sizes) + np.arange(int(sizes.sum()))
        faces = flat[picked], np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64), cells
    else:
        faces = _face_stream(found, types)
    if (np.diff(faces[2])[types == 42] == 0).any() or (np.diff(faces[2])[types != 42] != 0).any():
        raise ValueError("polyhedra must have faces, and no other cells")
    return faces


def _face_stream(found: dict[str, NDArray[np.int64]], types: NDArray[np.int64]) -> _Faces:
    """Before: for each polyhedron the number of its faces, then the size and points of each; -1 for other cells."""
    for name in ("faces", "faceoffsets"):
        if name not in found:
            raise ValueError(f"there are polyhedra but no array '{name}'")
    stream, ends = found["faces"].tolist(), found["faceoffsets"].tolist()
    if len(ends) != len(types):
        raise ValueError(f"array 'faceoffsets' has {len(ends)} values for {len(types)} cells")
    flat: list[int] = []
    starts, cells = [0], [0]
    at = 0
    for cell, (kind, end) in enumerate(zip(types.tolist(), ends, strict=True)):
        if kind == 42:
            if not at < end <= len(stream):
                raise ValueError(f"array 'faceoffsets' goes from {at} to {end} at cell {cell}, of {len(stream)}")
            n_faces = stream[at]
            at += 1
            for _ in range(n_faces):
                size = stream[at] if at < end else -1
                if size < 0 or size > end - at - 1:
                    raise ValueError(f"array 'faces' ends inside cell {cell}")
                flat += stream[at + 1 : at + 1 + size]
                starts.append(len(flat))
                at += 1 + size
            if n_faces < 0 or at != end:
                raise ValueError(f"array 'faces' has {end - at} values too many in cell {cell}")
        cells.append(len(starts) - 1)
    if at != len(stream):
        raise ValueError(f"array 'faces' has {len(stream) - at} values after the last cell")
    return np.array(flat, np.int64), np.array(starts, np.int64), np.array(cells, np.int64)
