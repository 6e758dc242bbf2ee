"""Paths to polyhedral meshes: which name one, and reading it."""

from __future__ import annotations

import os
from pathlib import Path

from voxkernel.errors import MeshError
from voxkernel.polyhedral.files import is_cell_folder, read_cells
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh

__all__ = ["is_polyhedral", "read_polyhedral"]

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
