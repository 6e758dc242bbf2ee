"""`PolyhedralMesh`: cells with polygonal faces, each with its own side of every face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_nonnegative, as_points, check_index_range, read_only
from voxkernel._frozen import Frozen
from voxkernel.errors import MeshError
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.polygons import flatten_polygons
from voxkernel.polyhedral.cell_sides import cell_polygons, outward
from voxkernel.polyhedral.files import RawCells, join_cells

__all__ = ["PolyhedralMesh"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PolyhedralMesh(Frozen):
    """Cells with polygonal faces that may be shared, each cell with its own side of every face.

    Make one with :func:`read_polyhedral`, `from_cells` or `from_faces`. All arrays are read-only.

    Parameters
    ----------
    vertices : (n, 3) float64
        World coordinates as given.
    face_offsets, face_vertices : (f + 1,) and (j,) int64
        Face i has the corners ``face_vertices[face_offsets[i]:face_offsets[i + 1]]``.
    cell_offsets, cell_faces : (m + 1,) and (k,) int64
        Cell i has the faces ``cell_faces[cell_offsets[i]:cell_offsets[i + 1]]``.
    cell_flips : (k,) bool
        Whether the cell uses that face turned over, so that its corners are counter-clockwise from outside.
    problems : tuple of str
        Of each cell, what was found wrong with it when it was read; "" for most.
    n_turned : int
        Cells of which faces were turned, against the file, to make them face outward.
    oriented_by : {"file", "reader"}
        Whether the sides of the faces are the file's or were found by walking over the edges of each cell.
    source : str
        Where the mesh came from, for messages.
    """

    vertices: NDArray[np.float64]
    face_offsets: NDArray[np.int64]
    face_vertices: NDArray[np.int64]
    cell_offsets: NDArray[np.int64]
    cell_faces: NDArray[np.int64]
    cell_flips: NDArray[np.bool_]
    problems: tuple[str, ...]
    n_turned: int
    oriented_by: str
    source: str

    @classmethod
    def from_cells(
        cls, cells: Sequence[tuple[ArrayLike, Sequence[Sequence[int]]]], *, source: str = "arrays"
    ) -> PolyhedralMesh:
        """Make a mesh of separate cells whose faces are counter-clockwise seen from outside.

        Parameters
        ----------
        cells : sequence of (vertices, polygons)
            Of each cell (n, 3) coordinates and its faces as vertex ids. A cell may be broken; it fails later, alone.
        source : str
            Name for messages.

        Returns
        -------
        PolyhedralMesh
            Nothing is turned.

        Raises
        ------
        MeshError
            If there is no cell, or an index is out of range.

        Examples
        --------
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        >>> PolyhedralMesh.from_cells([(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])])
        PolyhedralMesh(1 cells, 4 faces, 4 vertices, source='arrays')
        """
        parts = [(_coordinates(v), *flatten_polygons(p)) for v, p in cells]
        for points, flat, _ in parts:
            check_index_range("polygons", flat, len(points), error=MeshError)
        return cls._from_raw(join_cells(parts, [""] * len(parts)), source)

    @classmethod
    def from_faces(
        cls,
        vertices: ArrayLike,
        faces: Sequence[Sequence[int]],
        cells: Sequence[Sequence[int]],
        *,
        source: str = "arrays",
    ) -> PolyhedralMesh:
        """Make a mesh of shared faces; each cell's faces are turned outward, whichever way round they are.

        Parameters
        ----------
        vertices : (n, 3) array_like
            World coordinates.
        faces : sequence of index sequences
            Corners of each face, in order, in either direction.
        cells : sequence of index sequences
            Faces of each cell.
        source : str
            Name for messages.

        Returns
        -------
        PolyhedralMesh
            `n_turned` counts the cells of which faces had to be turned.

        Raises
        ------
        MeshError
            If there is no cell, or an index is out of range.
        TypeError
            If the ids are not integers.

        Examples
        --------
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        >>> PolyhedralMesh.from_faces(corners, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]], [[0, 1, 2, 3]]).n_turned
        1
        """
        points = _coordinates(vertices).copy()
        flat, sizes = flatten_polygons(faces)
        ids, counts = flatten_polygons(cells)
        raw = RawCells(points, flat, sizes, ids, counts, [""] * len(counts), True)
        return cls._from_raw(raw, source)

    @classmethod
    def _from_raw(cls, raw: RawCells, source: str) -> PolyhedralMesh:
        """Check indices, find the sides of the faces where the file does not say them, freeze."""
        if len(raw.counts) == 0:
            raise MeshError("`cells` must hold at least one cell; got 0")
        check_index_range("faces", raw.flat, len(raw.vertices), error=MeshError)
        check_index_range("cells", raw.cell_faces, len(raw.sizes), error=MeshError)
        arrays = (
            np.ascontiguousarray(raw.vertices, dtype=np.float64),
            np.concatenate([[0], np.cumsum(raw.sizes)]).astype(np.int64),
            np.ascontiguousarray(raw.flat, dtype=np.int64),
            np.concatenate([[0], np.cumsum(raw.counts)]).astype(np.int64),
            np.ascontiguousarray(raw.cell_faces, dtype=np.int64),
        )
        problems = list(raw.problems)
        flips = np.zeros(len(raw.cell_faces), np.bool_)
        n_turned = outward(*arrays, flips, problems) if raw.is_unoriented else 0
        for array in arrays:
            read_only(array)
        by = "reader" if raw.is_unoriented else "file"
        return cls(*arrays, read_only(flips), tuple(problems), n_turned, by, source)

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self.cell_offsets) - 1

    def __repr__(self) -> str:
        """Name the sizes."""
        sizes = f"{len(self)} cells, {len(self.face_offsets) - 1} faces, {len(self.vertices)} vertices"
        return f"PolyhedralMesh({sizes}, source={self.source!r})"

    def cell(self, index: int, *, planarity_rtol: float = 1e-9) -> TriangleMesh:
        """Give one cell as a surface.

        Parameters
        ----------
        index : int
            0 .. ``len(mesh)`` - 1.
        planarity_rtol : float
            As `TriangleMesh.from_polygons`.

        Returns
        -------
        TriangleMesh
            Facet k is the k-th face of the cell; only its own vertices.

        Raises
        ------
        IndexError
            If there is no such cell.
        MeshError
            If the cell is no surface.

        Examples
        --------
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        >>> mesh = PolyhedralMesh.from_cells([(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])])
        >>> mesh.cell(0).facts().is_closed
        True
        """
        if not 0 <= index < len(self):
            raise IndexError(f"`index` must be in 0..{len(self) - 1}; got {index}")
        if self.problems[index] and self.cell_offsets[index] == self.cell_offsets[index + 1]:
            raise MeshError(self.problems[index])
        vertices, flat, sizes = cell_polygons(
            self.vertices, self.face_offsets, self.face_vertices,
            self.cell_offsets, self.cell_faces, self.cell_flips, index,
        )  # fmt: skip
        points = as_points("vertices", vertices, error=MeshError)
        source = f"cell {index} of {self.source}"
        rtol = as_nonnegative("planarity_rtol", planarity_rtol)
        return TriangleMesh._from_flat(points, flat, sizes, planarity_rtol=rtol, source=source)


def _coordinates(vertices: ArrayLike) -> NDArray[np.float64]:
    """Points of the right shape; numbers that are not finite spoil only the cells that use them."""
    points = np.asarray(vertices, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError(f"`vertices` must have shape (n, 3); got {points.shape}")
    return points
