"""`stream_mesh`: files, folders, arrays and chunks of the caller -> a surface that is read in chunks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np

from voxkernel._checks import as_depth
from voxkernel.errors import MeshReadError
from voxkernel.large.array_chunks import ArraySource, ChunkSource, ParquetFile, Tiles
from voxkernel.large.chunks import Source
from voxkernel.large.file_chunks import PlyFile, StlFile
from voxkernel.large.streamed_surface import StreamedSurface
from voxkernel.large.surface_reader import StreamProgress, SurfaceReader

__all__ = ["reader_of", "stream_mesh"]

_SUFFIXES = (".parquet", ".ply", ".stl")


def stream_mesh(
    source: Any,
    *,
    chunk_facets: int = 1 << 18,
    progress: Callable[[StreamProgress], object] | None = None,
) -> StreamedSurface:
    """Open a surface that need not fit in memory: it is read in chunks, as often as it takes.

    Parameters
    ----------
    source : path, sequence of paths, (vertices, faces), iterable or callable
        - A binary ``.ply`` or ``.stl`` file of triangles, which is mapped into memory; a ``.parquet`` file of facets,
          a row each, in columns x0 y0 z0 x1 y1 z1 x2 y2 z2 (with pyarrow).
        - A folder or a sequence of such files: the tiles of one surface, in the order of their names or as given.
        - A pair of arrays (n, 3) and (m, 3), which may be mapped files.
        - A function without arguments that returns an iterator of such pairs, or a list of them; each pair has
          vertex ids of its own.
    chunk_facets : int
        Facets that are held at a time, 1 to 2**24; the results do not depend on it.
    progress : callable, optional
        Called with a `StreamProgress` after every chunk of every pass.

    Returns
    -------
    StreamedSurface
        For `exact_kernel`, `voxel_kernel`, `starshapeness`, `violation` and `best_center`.

    Raises
    ------
    MeshReadError
        If a file is missing, no binary ``.ply`` or ``.stl``, or ends too early; some of it only when it is read.
    MeshError
        If arrays have the wrong shape; when it is read, if a facet is no triangle, names a vertex that is not there,
        or is not finite: chunk and facet are named.
    ValueError
        If `source` can be read only once, or `chunk_facets` is out of range.
    TypeError
        If `source` is something else.

    Notes
    -----
    Triangles of one ``.ply`` file or pair of arrays share vertices by number, as in memory. Those of ``.stl``,
    ``.parquet``, tiles and chunks share equal corners, as ``.stl`` does in memory. Both matter only to whether the
    surface is closed, which is decided by hashes of its edges: a closed surface is always found to be closed, an open
    one is with a probability of 2**-128 if the hashes are as good as random numbers.

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
    return StreamedSurface(SurfaceReader(_source(source), size, progress))


def reader_of(surface: StreamedSurface, facets: Any) -> SurfaceReader:
    """Give what reads a stream; `facets` of it are refused."""
    if facets is not None:
        raise ValueError("`facets` must be None for a streamed surface; got facets (stream a part of the surface)")
    return surface._reader


def _source(source: Any) -> Source:
    if isinstance(source, str | os.PathLike):
        return _of_path(Path(os.fsdecode(source)))
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
            return Tiles([_of_file(Path(os.fsdecode(path))) for path in source])
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


def _of_path(path: Path) -> Source:
    if not path.is_dir():
        return _of_file(path)
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES and file.is_file())
    if not files:
        raise MeshReadError(f"'{path}' must hold {' or '.join(_SUFFIXES)} files; got none")
    return Tiles([_of_file(file) for file in files])


def _of_file(path: Path) -> Source:
    kinds = {".ply": PlyFile, ".stl": StlFile, ".parquet": ParquetFile}
    suffix = path.suffix.lower()
    if suffix not in kinds:
        raise MeshReadError(f"`source` must be a file ending in {' '.join(_SUFFIXES)} to be streamed; got '{path}'")
    return kinds[suffix](path)
