"""`stream_mesh`: files, folders, arrays and chunks of the caller -> a surface that is read in chunks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from voxkernel._checks import as_choice, as_depth
from voxkernel.errors import MeshReadError
from voxkernel.large.array_chunks import ArraySource, ChunkSource, ParquetFile, Tiles
from voxkernel.large.chunks import Source
from voxkernel.large.converted_files import ConvertedFile
from voxkernel.large.file_chunks import NotMapped, PlyFile, StlFile
from voxkernel.large.gltf_buffers import gltf_primitives
from voxkernel.large.streamed_surface import StreamedSurface
from voxkernel.large.surface_reader import StreamProgress, SurfaceReader
from voxkernel.large.zarr_facets import ZarrFacets

__all__ = ["reader_of", "stream_mesh"]

_SUFFIXES = (".glb", ".gltf", ".obj", ".off", ".parquet", ".ply", ".stl", ".zarr")

Folder = str | os.PathLike[str] | None


def stream_mesh(
    source: Any,
    *,
    chunk_facets: int = 1 << 18,
    edges: Literal["hashed", "sorted"] = "hashed",
    temporary_folder: str | os.PathLike[str] | None = None,
    progress: Callable[[StreamProgress], object] | None = None,
) -> StreamedSurface:
    """Open a surface that need not fit in memory: it is read in chunks, as often as it takes.

    Parameters
    ----------
    source : path, sequence of paths, (vertices, faces), iterable or callable
        - A binary ``.ply`` or ``.stl`` file of triangles, which is mapped into memory; a ``.glb`` or ``.gltf``, whose
          buffers are, with the triangles of its scene moved by their nodes.
        - A text ``.ply`` or ``.stl``, an ``.obj`` or ``.off``, or one of polygons, which are cut into triangles: it is
          read once, in stretches, into temporary files; each triangle is a facet.
        - A ``.parquet`` file of facets, a row each, in columns x0 y0 z0 x1 y1 z1 x2 y2 z2 (with pyarrow); a ``.zarr``
          array (n, 9) or (n, 3, 3) of the same (with zarr).
        - A folder or a sequence of such files: the tiles of one surface, in the order of their names or as given.
        - A pair of arrays (n, 3) and (m, 3), which may be mapped files.
        - A function without arguments that returns an iterator of such pairs, or a list of them; each pair has
          vertex ids of its own.
    chunk_facets : int
        Facets that are held at a time, 1 to 2**24; the results do not depend on it.
    edges : {"hashed", "sorted"}
        How it is decided whether the surface is closed: by hashes, see Notes; or exactly, by its edges in temporary
        files, which take 24 bytes for each edge of a facet, 56 where facets share corners by position.
    temporary_folder : path, optional
        Where temporary files are made, by default where the system has them. They are gone with the process, however
        it ends; on Linux they never have a name.
    progress : callable, optional
        Called with a `StreamProgress` after every chunk of every pass.

    Returns
    -------
    StreamedSurface
        For `exact_kernel`, `voxel_kernel`, `starshapeness`, `violation`, `best_center` and `visible_fraction`.

    Raises
    ------
    MeshReadError
        If a file is missing, of another kind, or ends too early; some of it only when it is read.
    MeshError
        If arrays have the wrong shape; when it is read, if a facet of arrays is no triangle, or one names a vertex that
        is not there, or is not finite: chunk and facet are named.
    ValueError
        If `source` can be read only once, or `chunk_facets` is out of range.
    TypeError
        If `source` is something else.

    Notes
    -----
    Triangles of one ``.ply``, ``.obj`` or ``.off`` file or pair of arrays share vertices by number, as in memory. Those
    of ``.stl``, ``.glb``, ``.parquet``, ``.zarr``, tiles and chunks share equal corners, as ``.stl`` does in memory.
    Both matter only to whether the surface is closed, which is decided by hashes of its edges: a closed surface is
    always found to be closed, an open one is with a probability of 2**-128 if the hashes are as good as random numbers.

    Examples
    --------
    >>> import voxkernel
    >>> corners, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> surface = voxkernel.stream_mesh((corners, faces), chunk_facets=1)
    >>> kernel = voxkernel.exact_kernel(surface)
    >>> kernel.dimension, round(kernel.volume, 12)
    (3, 0.166666666667)
    """
    size = as_depth("chunk_facets", chunk_facets, 1, 1 << 24)
    is_sorted = as_choice("edges", edges, ("hashed", "sorted")) == "sorted"
    if temporary_folder is not None and not os.path.isdir(temporary_folder):
        raise ValueError(f"`temporary_folder` must be an existing folder; got {os.fspath(temporary_folder)!r}")
    reader = SurfaceReader(
        _source(source, temporary_folder), size, progress, is_sorted=is_sorted, folder=temporary_folder
    )
    return StreamedSurface(reader)


def reader_of(surface: StreamedSurface, facets: Any) -> SurfaceReader:
    """Give what reads a stream; `facets` of it are refused."""
    if facets is not None:
        raise ValueError("`facets` must be None for a streamed surface; got facets (stream a part of the surface)")
    return surface._reader


def _source(source: Any, folder: Folder) -> Source:
    if isinstance(source, str | os.PathLike):
        return _of_path(Path(os.fsdecode(source)), folder)
    if callable(source):
        return ChunkSource(cast("Callable[[], Iterable[Any]]", source))
    if isinstance(source, Iterator):
        kind = type(source).__name__
        raise ValueError(
            "`source` must be readable again, as every answer takes several passes; "
            f"got a {kind} that can be read once (give the function that makes it)"
        )
    if isinstance(source, tuple | list) and len(source) == 2 and not _are_paths(source) and not _is_pair(source[0]):
        return ArraySource(*source)
    if isinstance(source, Iterable):
        if isinstance(source, tuple | list) and source and _are_paths(source):
            return Tiles([_of_file(Path(os.fsdecode(path)), folder) for path in source])
        return ChunkSource(cast("Iterable[Any]", source).__iter__)
    raise TypeError(
        "`source` must be a path, several paths, a pair (vertices, faces), an iterable of pairs or a function that "
        f"returns one; got {type(source).__name__}"
    )


def _are_paths(items: Any) -> bool:
    return all(isinstance(item, str | os.PathLike) for item in items)


def _is_pair(item: Any) -> bool:
    """Whether it is a pair of arrays rather than an array of points."""
    return isinstance(item, tuple | list) and len(item) == 2 and all(np.ndim(part) == 2 for part in item)


def _of_path(path: Path, folder: Folder) -> Source:
    if not path.is_dir() or path.suffix.lower() == ".zarr":
        return _of_file(path, folder)
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES)
    if not files:
        raise MeshReadError(f"'{path}' must hold {' or '.join(_SUFFIXES)} files; got none")
    return Tiles([_of_file(file, folder) for file in files])


def _of_file(path: Path, folder: Folder) -> Source:
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise MeshReadError(f"'{path}' cannot be streamed: it must end in {' '.join(_SUFFIXES)}")
    if suffix == ".parquet":
        return ParquetFile(path)
    if suffix == ".zarr":
        return ZarrFacets(path)
    if suffix in (".glb", ".gltf"):
        return Tiles(gltf_primitives(path), name=f"'{path}'")
    try:
        if suffix == ".ply":
            return PlyFile(path)
        if suffix == ".stl":
            return StlFile(path)
    except NotMapped:
        pass
    return ConvertedFile(path, folder)
