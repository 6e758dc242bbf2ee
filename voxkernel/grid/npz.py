"""`SparseGrid` <-> .npz files."""

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from voxkernel._input_file import input_file
from voxkernel._npz import DAMAGE, NpzArrays, is_shallow, read_json
from voxkernel._output_file import whole_file
from voxkernel.errors import GridReadError
from voxkernel.grid.named_grids import NamedGrids
from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["read_npz", "read_npz_file", "write_npz"]

_FORMAT = "voxkernel-grid"
_VERSION = 1
_ARRAYS = ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_mask", "tile_values", "leaf_values")
_INACTIVE = ("inactive_ijk", "inactive_log2", "inactive_values")


def write_npz(
    path: str | os.PathLike[str],
    grids: SparseGrid | Iterable[SparseGrid] | NamedGrids,
    *,
    metadata: Mapping[str, Any] | None = None,
) -> None:
    """Write grids to a compressed .npz file: a few kilobytes for what is megabytes as .vdb.

    Parameters
    ----------
    path : path
        Replaced in one step; no suffix is added.
    grids : SparseGrid, iterable of SparseGrid, or KernelGrid
        In order. Of a `KernelGrid` both grids and what `KernelGrid.read` needs, but for the planes of its domain,
        which `KernelGrid.write` adds.
    metadata : mapping of str to bool, int, float, str, list or mapping, optional
        Metadata of the file.

    Raises
    ------
    TypeError
        If `grids` holds anything else, or metadata that JSON has no form for.

    Notes
    -----
    Arrays are named ``0.tile_ijk``, ``0.leaf_mask``, ..., ``1.tile_ijk``; the entry ``header`` is JSON with
    the format, its version (1), the metadata, and each grid's name, class, background and metadata.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "a.npz")
    >>> write_npz(path, SparseGrid.from_ijk([[0, 0, 0]], name="inside"))
    >>> read_npz(path)
    (SparseGrid('inside', 1 active voxel, 0 tiles, 1 leaf, mask),)
    """
    about = dict(metadata or {})
    if isinstance(grids, NamedGrids):
        about, grids = {**grids.file_metadata(), **about}, grids.to_grids().values()
    listed = [grids] if isinstance(grids, SparseGrid) else list(grids)
    arrays: dict[str, NDArray[Any]] = {}
    described: list[dict[str, Any]] = []
    for n, grid in enumerate(listed):
        if not isinstance(cast(object, grid), SparseGrid):
            raise TypeError(f"`grids` must hold SparseGrid only; got {type(grid).__name__}")
        described.append(
            {
                "name": grid.name,
                "grid_class": grid.grid_class,
                "background": grid.background.hex(),
                "metadata": {key: _plain(value) for key, value in grid.metadata.items()},
            }
        )
        for name in (*_ARRAYS, "origin", "linear", *(_INACTIVE if len(grid.inactive_log2) else ())):
            if (array := getattr(grid, name)) is not None:
                arrays[f"{n}.{name}"] = array
    header = {"format": _FORMAT, "version": _VERSION, "metadata": about, "grids": described}
    arrays["header"] = np.array(json.dumps(header))
    with whole_file(path) as file:
        np.savez_compressed(file, **cast(Any, arrays))


def _plain(value: Any) -> Any:
    """Metadata as JSON has it; tuples come back as tuples."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def read_npz(path: str | os.PathLike[str]) -> tuple[SparseGrid, ...]:
    """Read the grids that `write_npz` wrote.

    Parameters
    ----------
    path : path
        An .npz file of this library.

    Returns
    -------
    tuple of SparseGrid
        In the order of writing.

    Raises
    ------
    GridReadError
        If the file is missing, damaged, of another kind, or of a newer version.

    Notes
    -----
    Nothing is unpacked before the file's sizes and shapes fit each other; pickles are never loaded.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "a.npz")
    >>> write_npz(path, [SparseGrid.from_ijk([[0, 0, 0]], values=[0.5])])
    >>> read_npz(path)[0].values_at([[0, 0, 0]])
    array([0.5], dtype=float32)
    """
    return read_npz_file(path)[0]


def read_npz_file(path: str | os.PathLike[str]) -> tuple[tuple[SparseGrid, ...], dict[str, Any]]:
    """Read the grids and the metadata of the file; see `read_npz`."""
    input_file(path, GridReadError)
    try:
        with NpzArrays(path) as arrays:
            header = read_json(arrays.text("header"))
            if header["format"] != _FORMAT or header["version"] != _VERSION:
                raise GridReadError(
                    f"{path}: `path` must be a {_FORMAT} file of version {_VERSION}; "
                    f"got {str(header['format'])[:40]!r} of version {header['version']!r:.40}"
                )
            metadata = header.get("metadata", {})
            if not isinstance(metadata, dict) or not is_shallow(metadata, 4):
                raise ValueError("its metadata is not that of grids")
            grids = tuple(_grid_from(arrays, n, facts) for n, facts in enumerate(header["grids"]))
            return grids, cast("dict[str, Any]", metadata)
    except GridReadError:
        raise
    except (*DAMAGE, TypeError, AttributeError, IndexError) as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise GridReadError(f"{path}: `path` must be an .npz file of this library: {reason}") from error


def _grid_from(arrays: NpzArrays, n: int, facts: Mapping[str, Any]) -> SparseGrid:
    """One grid; its constructor checks the arrays."""
    names = (*_ARRAYS, "origin", "linear", *_INACTIVE)
    given = {name: arrays[f"{n}.{name}"] for name in names if f"{n}.{name}" in arrays}
    metadata = {k: tuple(v) if isinstance(v, list) else v for k, v in facts["metadata"].items()}
    return SparseGrid(
        **given,
        name=facts["name"],
        grid_class=facts["grid_class"],
        background=float.fromhex(facts["background"]),
        metadata=metadata,
    )
