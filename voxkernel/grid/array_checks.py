"""Checks that turn arrays given to `SparseGrid` into clean tiles and leaves."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points, as_positive
from voxkernel.grid.cell_runs import Body, Cells
from voxkernel.grid.morton import MAX_LOG2, REACH

__all__ = [
    "array_of",
    "check_overlap",
    "coordinates",
    "frame_of",
    "frozen",
    "in_order",
    "integers",
    "linear_of",
    "tiles_of",
]

_Array = TypeVar("_Array", bound=NDArray[Any])


def frozen(array: _Array) -> _Array:
    """A read-only view: the caller's own array stays as it is."""
    view = array.view()
    view.flags.writeable = False
    return view


def integers(name: str, value: object) -> NDArray[np.integer[Any]]:
    """Integer (n, 3) of any width, not copied when it is one already."""
    raw = np.asarray(value)
    if raw.ndim == 1 and raw.size == 0:
        raw = np.zeros((0, 3), dtype=np.int64)
    if raw.dtype.kind not in "iu":
        raise TypeError(f"`{name}` must be an array of integers; got dtype {raw.dtype}")
    if raw.ndim != 2 or raw.shape[1] != 3:
        raise ValueError(f"`{name}` must have shape (n, 3); got {raw.shape}")
    if raw.dtype == np.uint64:
        raw = np.minimum(raw, np.uint64(np.iinfo(np.int64).max)).astype(np.int64)
    return raw.astype(np.int64) if raw.dtype.itemsize < 4 or raw.dtype == np.uint32 else raw


def coordinates(name: str, value: object) -> NDArray[np.int32]:
    """int32 (n, 3) within the range that Morton codes cover."""
    raw = integers(name, value)
    if raw.size and (raw.min() < -REACH or raw.max() >= REACH):
        wrong = raw[((raw < -REACH) | (raw >= REACH)).any(axis=1)][0]
        raise ValueError(f"`{name}` must be in {-REACH}..{REACH - 1}; got {wrong.tolist()}")
    return np.ascontiguousarray(raw, dtype=np.int32)


def array_of(name: str, value: object, dtype: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Array of one shape and dtype; integers and floats are converted within their kind only."""
    raw = np.asarray(value)
    if raw.size == 0 and 0 in shape:
        raw = np.zeros(shape, dtype=dtype)
    allowed = "fiu" if dtype.kind == "f" else "iu"
    if raw.dtype.kind not in allowed:
        raise TypeError(f"`{name}` must be an array of {dtype}; got dtype {raw.dtype}")
    if raw.shape != shape:
        raise ValueError(f"`{name}` must have shape {shape}; got {raw.shape}")
    if dtype == np.uint64 and raw.dtype.kind == "i" and raw.size and raw.min() < 0:
        raise ValueError(f"`{name}` must be an array of {dtype}; got a negative number")
    with np.errstate(over="ignore"):  # a double beyond float32 becomes infinite, as it does in OpenVDB
        return np.ascontiguousarray(raw, dtype=dtype)


def tiles_of(prefix: str, ijk: object, log2: object) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
    """Aligned tiles."""
    corners = coordinates(f"{prefix}_ijk", ijk)
    raw = np.asarray(log2)
    if raw.size and raw.dtype.kind in "iu" and (raw.min() < 3 or raw.max() > MAX_LOG2):
        raise ValueError(f"`{prefix}_log2` must be in 3..{MAX_LOG2}; got {raw.min()}..{raw.max()}")
    sizes = array_of(f"{prefix}_log2", raw, np.dtype(np.int8), (len(corners),))
    off_grid = (corners & ((np.int32(1) << sizes.astype(np.int32)) - 1)[:, None]).any(axis=1)
    if off_grid.any():
        row = int(off_grid.argmax())
        raise ValueError(f"`{prefix}_ijk` must be a multiple of {1 << int(sizes[row])}; got {corners[row].tolist()}")
    return corners, sizes


def in_order(body: Body) -> tuple[Body, NDArray[np.intp] | None, NDArray[np.intp] | None]:
    """Sort tiles and leaves by code, and say how; None where they were sorted already."""
    tiles = leaves = None
    if (np.diff(body.tile_code) < 0).any():
        tiles = np.argsort(body.tile_code, kind="stable")
        tile_values = None if body.tile_values is None else body.tile_values[tiles]
        body = body._replace(tile_code=body.tile_code[tiles], tile_log2=body.tile_log2[tiles], tile_values=tile_values)
    if (np.diff(body.leaf_code) < 0).any():
        leaves = np.argsort(body.leaf_code, kind="stable")
        leaf_values = None if body.leaf_values is None else body.leaf_values[leaves]
        body = body._replace(
            leaf_code=body.leaf_code[leaves], leaf_mask=body.leaf_mask[leaves], leaf_values=leaf_values
        )
    return body, tiles, leaves


def check_overlap(cells: Cells) -> None:
    """Refuse two cells that share a voxel."""
    overlaps = cells.code[1:] <= cells.last[:-1]
    if overlaps.any():
        raise ValueError(f"tiles and leaves must not overlap; got {int(overlaps.sum())} overlapping pairs")


def linear_of(voxel_size: float, linear: ArrayLike | None) -> NDArray[np.float64]:
    """The (3, 3) part of a transform from either way of giving it."""
    if linear is None:
        return np.eye(3) * as_positive("voxel_size", voxel_size)
    matrix = as_points("linear", linear, copy=True)
    if matrix.shape != (3, 3):
        raise ValueError(f"`linear` must have shape (3, 3); got {matrix.shape}")
    if not np.isfinite(np.linalg.cond(matrix)) or np.linalg.det(matrix) == 0:
        raise ValueError(f"`linear` must be an invertible matrix; got {matrix.tolist()}")
    return matrix


def frame_of(
    origin: ArrayLike, voxel_size: float, linear: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origin (3,) and linear part (3, 3)."""
    corner = np.asarray(origin)
    if corner.shape != (3,):
        raise ValueError(f"`origin` must have shape (3,); got {corner.shape}")
    return as_points("origin", corner.reshape(1, 3), copy=True)[0], linear_of(voxel_size, linear)
