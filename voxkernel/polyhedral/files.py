"""Files of polyhedral meshes: folders of cells, .hedra, Medit .mesh, .vtu; order and digits as in the file.

They have parsers of their own because meshio 5.3 rounds the coordinates of a version 1 `.mesh` to float32, sorts the
polyhedra of a `.vtu` by their number of vertices, so that cell numbers are lost, and refuses polyhedra beside other
cells, and because a damaged `.vtu` ends the process in VTK.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._input_file import input_file
from voxkernel.errors import MeshReadError
from voxkernel.mesh.files import read_polygons
from voxkernel.mesh.ply import ranges
from voxkernel.polyhedral.hedra import parse_hedra
from voxkernel.polyhedral.medit import parse_medit

if TYPE_CHECKING:
    from voxkernel.polyhedral.vtu import VtuPiece

__all__ = ["RawCells", "is_cell_folder", "join_cells", "read_cells"]

_CELL_SUFFIXES = (".obj", ".off", ".ply")
_TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_PRISM = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_VOXEL = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6))


def _long_prism(n: int) -> tuple[tuple[int, ...], ...]:
    sides = ((i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n))
    return (tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides)


_MEDIT = {
    "tetrahedra": _TETRAHEDRON, "hexahedra": _HEXAHEDRON, "prisms": _PRISM, "wedges": _PRISM, "pyramids": _PYRAMID,
}  # fmt: skip
# Files number VTK's wedges (13) either way round: documents say one, VTK's own code the other.
_VTK = {
    10: _TETRAHEDRON, 11: _VOXEL, 12: _HEXAHEDRON, 13: _PRISM, 14: _PYRAMID, 15: _long_prism(5), 16: _long_prism(6),
}  # fmt: skip
_VTK_POLYHEDRON, _VTK_FLAT = 42, range(10)


class RawCells(NamedTuple):
    """Cells as files hold them: corners of all faces in a row, face sizes, faces of all cells, cell sizes."""

    vertices: NDArray[np.float64]
    flat: NDArray[np.int64]
    sizes: NDArray[np.int64]
    cell_faces: NDArray[np.int64]
    counts: NDArray[np.int64]
    problems: list[str]
    is_unoriented: bool


def read_cells(path: Path) -> RawCells:
    """Read by the kind of path; every failure is a MeshReadError of one line that names it."""
    if not path.exists():
        raise MeshReadError(f"`path` must be an existing file or folder; got '{path}'")
    if path.is_dir():
        return _read_folder(path)
    path = input_file(path, MeshReadError)
    suffix = path.suffix.lower()
    parsers = {".hedra": _read_hedra, ".mesh": _read_medit}
    if suffix not in (*parsers, ".vtu"):
        raise MeshReadError(f"`path` must be a folder or end in one of .hedra .mesh .vtu; got '{path}'")
    try:
        raw = (
            _parse_vtu(path.read_bytes()) if suffix == ".vtu" else parsers[suffix](path.read_text("ascii", "replace"))
        )
        if not len(raw.counts):
            raise ValueError("it holds no cells with a volume")
        return raw
    except OSError as error:
        raise MeshReadError(f"'{path}' cannot be read: {error.strerror or error}") from error
    except (ValueError, IndexError, OverflowError, MemoryError) as error:
        reason = " ".join(str(error).split())[:300]
        raise MeshReadError(f"'{path}' is not a readable {suffix} file: {reason}") from error


# ---------------------------------------------------------------- folders


def _cell_files(folder: Path) -> list[Path]:
    """Surface files directly in a folder, in the order of the numbers in their names."""
    files = [f for f in folder.iterdir() if f.suffix.lower() in _CELL_SUFFIXES and f.is_file()]

    def key(file: Path) -> list[tuple[int, str]]:
        return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"(\d+)", file.name)]

    return sorted(files, key=key)


def is_cell_folder(folder: Path) -> bool:
    """Whether the surface files of a folder are numbered without a gap from 0 or 1."""
    names = [file.stem for file in _cell_files(folder)]
    if not names or not all(name.isdecimal() for name in names):
        return False
    first = int(names[0])
    return first in (0, 1) and [int(name) for name in names] == list(range(first, first + len(names)))


def _read_folder(folder: Path) -> RawCells:
    files = _cell_files(folder)
    if not files:
        raise MeshReadError(f"`path` must hold .off, .ply or .obj files, one per cell; got '{folder}' without")
    cells: list[tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]] = []
    problems: list[str] = []
    nothing = (np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64))
    for file in files:
        problem = ""
        cell = nothing
        try:
            content = read_polygons(file)
            if (content.flat < 0).any() or (content.flat >= len(content.vertices)).any():
                problem = f"'{file}' has a face with a vertex number out of range"
            elif not len(content.sizes):
                problem = f"'{file}' has no faces"
            else:
                cell = (content.vertices, content.flat, content.sizes)
        except MeshReadError as error:
            problem = str(error)
        cells.append(cell)
        problems.append(problem)
    return join_cells(cells, problems)


def join_cells(
    cells: Sequence[tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]], problems: list[str]
) -> RawCells:
    """Put separate cells, each (vertices, flat ids, sizes), into one table without sharing anything."""
    if not cells:
        none = np.zeros(0, np.int64)
        return RawCells(np.zeros((0, 3)), none, none, none, none, [], False)
    first = np.cumsum([0, *(len(cell[0]) for cell in cells)])
    flat = np.concatenate([cell[1] + at for cell, at in zip(cells, first[:-1], strict=True)]).astype(np.int64)
    sizes = np.concatenate([cell[2] for cell in cells])
    counts = np.array([len(cell[2]) for cell in cells], np.int64)
    return RawCells(np.concatenate([c[0] for c in cells]), flat, sizes, np.arange(len(sizes)), counts, problems, False)


# ---------------------------------------------------------------- files


def _read_hedra(text: str) -> RawCells:
    """Cells whose faces are shared."""
    arrays = parse_hedra(text)
    return RawCells(*arrays, [""] * len(arrays[-1]), True)


def _read_medit(text: str) -> RawCells:
    """Cells of four kinds, in the order of the file."""
    vertices, tables = parse_medit(text, {name: 1 + max(map(max, faces)) for name, faces in _MEDIT.items()})
    return _standard_cells(vertices, [(ids, _MEDIT[name]) for name, ids in tables])


def _standard_cells(
    vertices: NDArray[np.float64], parts: Sequence[tuple[NDArray[np.int64], tuple[tuple[int, ...], ...]]]
) -> RawCells:
    """Cells of a few kinds, each a table of vertex ids and the faces of the kind; every cell has its own faces."""
    flats = [np.concatenate([ids[:, list(face)] for face in faces], axis=1).reshape(-1) for ids, faces in parts]
    sizes = [np.tile([len(face) for face in faces], len(ids)) for ids, faces in parts]
    counts = [np.full(len(ids), len(faces)) for ids, faces in parts]
    none = [np.zeros(0, np.int64)]
    flat, size, count = (np.concatenate(none + list(rows)).astype(np.int64) for rows in (flats, sizes, counts))
    return RawCells(vertices, flat, size, np.arange(len(size)), count, [""] * len(count), True)


def _parse_vtu(data: bytes) -> RawCells:
    """Cells of all pieces in the order of the file; those without a volume are passed over."""
    from voxkernel.polyhedral.vtu import parse_vtu

    parts: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]] = []
    points: list[NDArray[np.float64]] = []
    n = 0
    for piece in parse_vtu(data):
        flat, sizes, counts = _cells_of_piece(piece)
        parts.append((flat + n, sizes, counts))
        points.append(piece.points)
        n += len(piece.points)
    flat, sizes, counts = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    vertices = np.concatenate(points)
    return RawCells(vertices, flat, sizes, np.arange(len(sizes)), counts, [""] * len(counts), True)


def _cells_of_piece(piece: VtuPiece) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Corners of all faces in a row, sizes of the faces, numbers of faces of the cells that have a volume."""
    polyhedra = np.flatnonzero(piece.types == _VTK_POLYHEDRON)
    n_faces, n_flat = np.zeros(len(piece.types), np.int64), np.zeros(len(piece.types), np.int64)
    n_faces[polyhedra] = np.diff(piece.cell_faces)[polyhedra]
    n_flat[polyhedra] = np.diff(piece.face_offsets[piece.cell_faces])[polyhedra] if len(polyhedra) else 0
    kinds = {int(kind): np.flatnonzero(piece.types == kind) for kind in np.unique(piece.types)}
    for kind, rows in kinds.items():
        if kind in _VTK:
            corners = 1 + max(max(face) for face in _VTK[kind])
            wrong = rows[np.diff(piece.offsets)[rows] != corners]
            if len(wrong):
                raise ValueError(f"cell {wrong[0]} of type {kind} does not have {corners} points")
            n_faces[rows], n_flat[rows] = len(_VTK[kind]), sum(map(len, _VTK[kind]))
        elif kind != _VTK_POLYHEDRON and kind not in _VTK_FLAT:
            raise ValueError(f"cell {rows[0]} is of VTK type {kind}, which is not a linear cell")
    flat, sizes = np.empty(int(n_flat.sum()), np.int64), np.empty(int(n_faces.sum()), np.int64)
    flat_at, face_at = np.cumsum(n_flat) - n_flat, np.cumsum(n_faces) - n_faces
    for kind, rows in kinds.items():
        if kind == _VTK_POLYHEDRON:  # their faces are in the order of the cells
            flat[ranges(flat_at[rows], n_flat[rows])] = piece.face_points
            sizes[ranges(face_at[rows], n_faces[rows])] = np.diff(piece.face_offsets)
        elif kind in _VTK:
            order = np.array([corner for face in _VTK[kind] for corner in face])
            flat[flat_at[rows, None] + np.arange(len(order))] = piece.connectivity[piece.offsets[rows, None] + order]
            sizes[face_at[rows, None] + np.arange(len(_VTK[kind]))] = [len(face) for face in _VTK[kind]]
    return flat, sizes, n_faces[n_faces > 0]
