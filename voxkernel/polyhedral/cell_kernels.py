"""Polyhedral meshes: cells with polygonal faces, and the kernel of every cell."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from voxkernel._checks import as_depth, as_nonnegative
from voxkernel.errors import MeshError
from voxkernel.polyhedral.cell_solver import CellKernels, solve
from voxkernel.polyhedral.files import is_cell_folder, read_cells
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh

__all__ = ["CellKernels", "PolyhedralMesh", "cell_kernels", "is_polyhedral", "read_polyhedral"]

_SUFFIXES = (".hedra", ".mesh", ".vtu")


def is_polyhedral(path: str | os.PathLike[str]) -> bool:
    """Whether a path names a polyhedral mesh, by its name alone.

    Parameters
    ----------
    path : str or os.PathLike
        A file or a folder.

    Returns
    -------
    bool
        True for ``.hedra``, ``.mesh`` and ``.vtu`` files, and for folders whose surface files (``.off``,
        ``.ply``, ``.obj``) are numbered 0, 1, 2 ... or 1, 2, 3 ... without a gap: cells of one mesh. Any other
        folder is taken for a collection of shapes, but `read_polyhedral` reads it when asked to.

    Examples
    --------
    >>> is_polyhedral("voronoi.hedra"), is_polyhedral("bunny.ply")
    (True, False)
    """
    file = Path(path)
    if file.suffix.lower() in _SUFFIXES:
        return not file.is_dir()
    return file.is_dir() and is_cell_folder(file)


def read_polyhedral(path: str | os.PathLike[str]) -> PolyhedralMesh:
    r"""Read a volumetric mesh of polyhedral cells.

    Parameters
    ----------
    path : str or os.PathLike
        - a folder of ``.off``, ``.ply`` or ``.obj`` files, one cell each, in the order of the numbers in their
          names; faces counter-clockwise seen from outside, which is kept as it is;
        - ``.hedra``: vertices, faces, and cells that share the faces;
        - ``.mesh``: text files of Medit with tetrahedra, hexahedra, prisms or pyramids;
        - ``.vtu``: the same cells of VTK, and polyhedra; surface cells are passed over.

    Returns
    -------
    PolyhedralMesh
        Vertices and cells in the order of the file. A cell of a folder that cannot be read keeps its place
        and has a line in `problems`.

    Raises
    ------
    MeshReadError
        If the file is missing, of another kind, broken, or holds no cells with a volume; with the line where a
        text has a number that is not finite, a wrong count, a row or a keyword too many, or an index out of range.
    MeshError
        If an index of a `.vtu` is out of range.

    Notes
    -----
    But for folders the files do not say reliably on which side of a face a cell lies. The faces of each cell are
    turned alike by walking over its edges, then outward by the sign of its volume; `n_turned` counts the cells
    with a turned face. A cell that cannot be turned so is left as it is and fails in `cell_kernels`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> text = "4 4 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 1 2 3\n3 1 2 4\n3 1 3 4\n3 2 3 4\n4 1 2 3 4\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "one.hedra"
    ...     _ = file.write_text(text)
    ...     len(read_polyhedral(file))
    1
    """
    source = os.fsdecode(path)
    raw = read_cells(Path(path))
    try:
        return PolyhedralMesh._from_raw(raw, source)
    except MeshError as error:
        raise MeshError(f"'{source}': {error}") from error


def cell_kernels(mesh: Any, *, planarity_rtol: float = 1e-9, threads: int = 1) -> CellKernels:
    """Compute the kernel of every cell of a polyhedral mesh.

    Parameters
    ----------
    mesh : PolyhedralMesh, or a path
        Anything `read_polyhedral` takes, or its result.
    planarity_rtol : float
        Faces less planar than this, for their size, count as their triangles; as `TriangleMesh.from_polygons`.
    threads : int
        Threads, at least 1; the result does not depend on it.

    Returns
    -------
    CellKernels
        One row per cell. A cell that is open, inconsistently oriented, inside out or without volume is a
        row with its reason, never an error.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the mesh or a number cannot be used.

    Notes
    -----
    A compiled loop makes the planes, finds the largest ball between them by a dual simplex and decides by signs
    with error bounds: solid where a point is certainly inside, empty where a few planes certainly exclude each
    other, the cell itself where no vertex is in front of a plane (exactly). What stays undecided, and every
    kernel that is flat or too thin for floating point, goes to the code of `exact_kernel`, so the answers agree.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = PolyhedralMesh.from_cells([(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])])
    >>> kernels = cell_kernels(mesh)
    >>> kernels.dimension.tolist(), kernels.volume_share.tolist(), round(float(kernels.inradius[0]), 6)
    ([3], [1.0], 0.211325)
    """
    if isinstance(mesh, str | os.PathLike):
        mesh = read_polyhedral(mesh)
    if not isinstance(mesh, PolyhedralMesh):
        raise TypeError(f"`mesh` must be a PolyhedralMesh or a path; got {type(mesh).__name__}")
    rtol = as_nonnegative("planarity_rtol", planarity_rtol)
    return solve(mesh, rtol, as_depth("threads", threads, 1, 256))
