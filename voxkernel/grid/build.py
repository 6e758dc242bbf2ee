"""Grids from tiles and leaves, voxel lists, points and dense arrays: the constructors of `SparseGrid`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points
from voxkernel.grid import cell_runs
from voxkernel.grid.array_checks import array_of, coordinates, frame_of, linear_of
from voxkernel.grid.blocks import blocks_from_dense, leaves_from_voxels
from voxkernel.grid.cell_runs import Body
from voxkernel.grid.morton import REACH

if TYPE_CHECKING:
    from voxkernel.grid.sparse_grid import GridClass, SparseGrid

__all__ = ["from_dense", "from_ijk", "from_points", "from_tiles_and_leaves"]


def from_tiles_and_leaves(
    cls: type[SparseGrid],
    tile_ijk: ArrayLike,
    tile_log2: ArrayLike,
    leaf_ijk: ArrayLike,
    leaf_mask: ArrayLike,
    *,
    tile_values: ArrayLike | None = None,
    leaf_values: ArrayLike | None = None,
    background: float = 0.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    voxel_size: float = 1.0,
    linear: ArrayLike | None = None,
    name: str = "",
    grid_class: GridClass = "unknown",
    metadata: Mapping[str, Any] | None = None,
) -> SparseGrid:
    """Grid from arrays that are already tiles and leaves; checks them and shares their memory.

    Parameters
    ----------
    tile_ijk, tile_log2 : (T, 3) int32, (T,) int8
        Aligned cubes of ``2**tile_log2`` active voxels.
    leaf_ijk, leaf_mask : (L, 3) int32, (L, 8) uint64
        Leaves and their active voxels.
    tile_values, leaf_values : (T,) float32, (L, 512) float32, optional
        Values of a float grid.
    background : float, default 0
        Value outside tiles and leaves.
    origin : (3,) float64
        Lower corner of voxel (0, 0, 0) in world units.
    voxel_size : float, default 1
        Edge of a voxel; used when `linear` is not given.
    linear : (3, 3) float64, optional
        Edges of a voxel as columns; wins over `voxel_size`.
    name, grid_class, metadata : str, str, mapping, optional
        See the class.

    Returns
    -------
    SparseGrid
        Empty arrays give an empty grid. Arrays already in Morton order are not copied.

    Raises
    ------
    TypeError, ValueError
        As for the class.

    Examples
    --------
    >>> import numpy as np
    >>> from voxkernel import SparseGrid
    >>> masks = np.zeros((1, 8), dtype=np.uint64)
    >>> masks[0, 2] = 1 << 9  # x = 2, y = 1, z = 1
    >>> grid = SparseGrid.from_tiles_and_leaves([[0, 0, 0]], [4], [[-8, 0, 0]], masks)
    >>> grid.active_voxel_count
    4097
    >>> grid.active_bbox.tolist()
    [[-6, 0, 0], [15, 15, 15]]
    """
    return cls(
        cast(NDArray[np.int32], tile_ijk),
        cast(NDArray[np.int8], tile_log2),
        cast(NDArray[np.int32], leaf_ijk),
        cast(NDArray[np.uint64], leaf_mask),
        cast("NDArray[np.float32] | None", tile_values),
        cast("NDArray[np.float32] | None", leaf_values),
        background=background,
        origin=cast(NDArray[np.float64], origin),
        linear=linear_of(voxel_size, linear),
        name=name,
        grid_class=grid_class,
        metadata=metadata or {},
    )


def from_ijk(
    cls: type[SparseGrid],
    ijk: ArrayLike,
    *,
    values: ArrayLike | None = None,
    background: float = 0.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    voxel_size: float = 1.0,
    linear: ArrayLike | None = None,
    name: str = "",
) -> SparseGrid:
    """Grid with the listed voxels active; full leaves become tiles.

    Parameters
    ----------
    ijk : (n, 3) int
        Voxel coordinates; repeats are allowed.
    values : (n,) float32, optional
        Value of each voxel; of repeats the last one counts.
    background, origin, voxel_size, linear, name
        See `from_tiles_and_leaves`.

    Returns
    -------
    SparseGrid
        n = 0 gives an empty grid.

    Raises
    ------
    TypeError, ValueError
        If `ijk` is not integer (n, 3) within [-2**23, 2**23), or `values` has another length.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_ijk([[0, 0, 0], [-1, 0, 0], [0, 0, 0]]).active_voxel_count
    2
    """
    voxels = coordinates("ijk", ijk)
    given = None if values is None else array_of("values", values, np.dtype(np.float32), (len(voxels),))
    leaf_code, leaf_mask, leaf_values = leaves_from_voxels(voxels, given, background)
    return _from_leaves(
        cls,
        leaf_code, leaf_mask, leaf_values, background, frame_of(origin, voxel_size, linear), name
    )


def from_points(
    cls: type[SparseGrid],
    xyz: ArrayLike,
    *,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    voxel_size: float = 1.0,
    linear: ArrayLike | None = None,
    name: str = "",
) -> SparseGrid:
    """Mask of the voxels in which at least one point lies.

    Parameters
    ----------
    xyz : (n, 3) float64
        Finite world points. A point on a shared face belongs to the voxel above it.
    origin, voxel_size, linear, name
        See `from_tiles_and_leaves`.

    Returns
    -------
    SparseGrid
        n = 0 gives an empty grid.

    Raises
    ------
    TypeError, ValueError
        If `xyz` is not finite real (n, 3), or a point lies beyond voxel +-2**23.

    Examples
    --------
    >>> from voxkernel import SparseGrid
    >>> SparseGrid.from_points([[0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]], voxel_size=0.5).to_ijk().tolist()
    [[-1, 0, 0], [0, 0, 0]]
    """
    points = as_points("xyz", xyz)
    frame_origin, frame_linear = frame_of(origin, voxel_size, linear)
    cells = np.floor((points - frame_origin) @ np.linalg.inv(frame_linear).T)
    if len(cells) and np.abs(cells).max() > REACH:
        raise ValueError(f"`xyz` must lie within {REACH} voxels of `origin`; use a larger `voxel_size`")
    return cls.from_ijk(cells.astype(np.int64), origin=frame_origin, linear=frame_linear, name=name)


def from_dense(
    cls: type[SparseGrid],
    array: ArrayLike,
    *,
    lower: ArrayLike = (0, 0, 0),
    background: float = 0.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    voxel_size: float = 1.0,
    linear: ArrayLike | None = None,
    name: str = "",
) -> SparseGrid:
    """Grid from a dense array indexed [i, j, k].

    Parameters
    ----------
    array : (nx, ny, nz) bool or float
        bool gives a mask; numbers give a float grid whose active voxels are those unlike `background`.
    lower : (3,) int, default (0, 0, 0)
        Voxel of ``array[0, 0, 0]``.
    background, origin, voxel_size, linear, name
        See `from_tiles_and_leaves`.

    Returns
    -------
    SparseGrid
        In the form of `prune`: cubes of one value are tiles.

    Raises
    ------
    TypeError, ValueError
        If `array` is not three-dimensional bool or real, or reaches beyond +-2**23.

    Examples
    --------
    >>> import numpy as np
    >>> from voxkernel import SparseGrid
    >>> grid = SparseGrid.from_dense(np.eye(3)[None], lower=(-1, 0, 0))
    >>> grid.values_at([[-1, 1, 1], [-1, 1, 2]])
    array([1., 0.], dtype=float32)
    """
    dense = np.asarray(array)
    if dense.ndim != 3 or dense.dtype.kind not in "bfiu":
        raise ValueError(f"`array` must be bool or real (nx, ny, nz); got {dense.dtype} {dense.shape}")
    corner = coordinates("lower", np.reshape(np.asarray(lower), (1, -1)))[0]
    if (corner + dense.shape > REACH).any():
        raise ValueError(f"`array` must end below voxel {REACH}; got shape {dense.shape} from {corner.tolist()}")
    leaf_code, leaf_mask, leaf_values = blocks_from_dense(dense, corner, np.float32(background))
    return _from_leaves(
        cls,
        leaf_code, leaf_mask, leaf_values, background, frame_of(origin, voxel_size, linear), name
    )


def _from_leaves(
    cls: type[SparseGrid],
    leaf_code: NDArray[np.int64],
    leaf_mask: NDArray[np.uint64],
    leaf_values: NDArray[np.float32] | None,
    background: float,
    frame: tuple[NDArray[np.float64], NDArray[np.float64]],
    name: str,
) -> SparseGrid:
    """Pruned grid from leaves with sorted codes."""
    no_values = None if leaf_values is None else np.zeros(0, dtype=np.float32)
    body = Body(np.zeros(0, np.int64), np.zeros(0, np.int8), no_values, leaf_code, leaf_mask, leaf_values)
    empty = cls(
        np.zeros((0, 3), np.int32),
        np.zeros(0, np.int8),
        np.zeros((0, 3), np.int32),
        np.zeros((0, 8), np.uint64),
        no_values,
        None if leaf_values is None else np.zeros((0, 512), dtype=np.float32),
        background=background,
        origin=frame[0],
        linear=frame[1],
        name=name,
    )
    return empty._with(cell_runs.merged(body), {})
