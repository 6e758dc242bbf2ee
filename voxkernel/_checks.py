"""Shape, dtype, finiteness and index-range checks, with one style of message.

Every function takes the *name* of the argument first and returns a clean copy or view of the value.
A wrong Python type is a ``TypeError``; a wrong shape, value or range is a ``ValueError``, or the
exception class given as ``error`` (a mesh constructor passes ``MeshError``).
"""

import math
import operator
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "as_choice",
    "as_depth",
    "as_each",
    "as_facet_ids",
    "as_indices",
    "as_integers",
    "as_nonnegative",
    "as_path",
    "as_points",
    "as_positive",
    "as_real",
    "as_share",
    "check_index_range",
    "read_only",
]

_Array = TypeVar("_Array", bound=NDArray[Any])


def read_only(array: _Array) -> _Array:
    """Return `array` itself, marked not writeable: results must not change after they were checked."""
    array.setflags(write=False)  # `array.flags` makes an object of its own first
    return array


def _shape(array: NDArray[Any]) -> str:
    """Shapes as a user types them: ``(3,)``, ``(4, 2)``."""
    return str(tuple(int(n) for n in array.shape))


def _as_array(raw: NDArray[Any], dtype: type[np.generic], copy: bool) -> NDArray[Any]:
    """C-contiguous `dtype`; a copy only where it is needed or asked for (one spelling for NumPy 1 and 2)."""
    if copy:
        return np.array(raw, dtype=dtype, order="C")
    return np.ascontiguousarray(raw, dtype=dtype)


def as_points(
    name: str,
    value: object,
    *,
    columns: int = 3,
    copy: bool = False,
    error: type[ValueError] = ValueError,
) -> NDArray[np.float64]:
    """Finite C-contiguous float64 (n, `columns`); n may be 0. Shares memory where it can unless `copy`."""
    try:
        raw = np.asarray(value)
    except ValueError:  # ragged nested sequences
        raise error(f"`{name}` must have shape (n, {columns}); got rows of different lengths") from None
    if raw.ndim == 1 and raw.size == 0:
        raw = np.zeros((0, columns))
    if raw.dtype.kind not in "fiu":
        raise TypeError(f"`{name}` must be an array of real numbers; got dtype {raw.dtype}")
    if raw.ndim != 2 or raw.shape[1] != columns:
        raise error(f"`{name}` must have shape (n, {columns}); got {_shape(raw)}")
    points = _as_array(raw, np.float64, copy)
    finite = np.isfinite(points)
    if not finite.all():
        row = int(np.flatnonzero(~finite.all(axis=1))[0])
        bad = points[row][~finite[row]][0]
        raise error(f"`{name}` must be finite; got {bad} in row {row}")
    return points


def as_integers(
    name: str,
    value: object,
    *,
    shape: str,
    ndim: int,
    columns: int | None = None,
    copy: bool = False,
    error: type[ValueError] = ValueError,
) -> NDArray[np.int64]:
    """C-contiguous int64 with `ndim` axes (and `columns`); floats and bools are refused, not rounded."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raise error(f"`{name}` must have shape {shape}; got rows of different lengths") from None
    if raw.size == 0 and raw.ndim == 1:
        raw = np.zeros((0,) if ndim == 1 else (0, columns or 0), dtype=np.int64)
    if raw.dtype.kind not in "iu":
        raise TypeError(f"`{name}` must be an array of integers; got dtype {raw.dtype}")
    if raw.ndim != ndim or (columns is not None and raw.shape[-1] != columns):
        hint = " (give quads and larger polygons to from_polygons)" if columns == 3 and raw.ndim == 2 else ""
        raise error(f"`{name}` must have shape {shape}; got {_shape(raw)}{hint}")
    if raw.dtype == np.uint64 and raw.size and int(raw.max()) > np.iinfo(np.int64).max:
        raise error(f"`{name}` must fit in int64; got {int(raw.max())}")
    return _as_array(raw, np.int64, copy)


def check_index_range(
    name: str, indices: NDArray[np.int64], upper: int, *, error: type[ValueError] = ValueError
) -> None:
    """Raise unless 0 <= index < `upper` for all; two passes without temporaries."""
    if indices.size == 0:
        return
    low, high = int(indices.min()), int(indices.max())
    if low < 0 or high >= upper:
        wrong = low if low < 0 else high
        raise error(f"`{name}` must be in 0..{upper - 1}; got {wrong}")


def as_indices(
    name: str, value: object, *, upper: int, error: type[ValueError] = ValueError
) -> NDArray[np.int64]:
    """int64 (n,) with 0 <= index < `upper`."""
    indices = as_integers(name, value, shape="(n,)", ndim=1, error=error)
    check_index_range(name, indices, upper, error=error)
    return indices


def as_facet_ids(
    name: str, value: object, *, upper: int, error: type[ValueError] = ValueError
) -> NDArray[np.int64]:
    """Sorted unique int64 ids from integer ids in 0..upper-1 or from a bool mask of length `upper`."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raise error(f"`{name}` must have shape (n,); got rows of different lengths") from None
    if raw.dtype.kind == "b":
        if raw.shape != (upper,):
            raise error(f"`{name}` as a mask must have shape ({upper},); got {_shape(raw)}")
        return np.flatnonzero(raw).astype(np.int64, copy=False)
    return np.unique(as_indices(name, raw, upper=upper, error=error))


def as_real(name: str, value: object) -> float:
    """Finite float from any real number (NumPy scalars and 0-d arrays included; bool and text refused)."""
    if isinstance(value, bool | np.bool_ | str | bytes):
        raise TypeError(f"`{name}` must be a real number; got {type(value).__name__}")
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise TypeError(f"`{name}` must be a real number; got {type(value).__name__}") from None
    except OverflowError:
        raise ValueError(f"`{name}` must be finite as a double; got a larger {type(value).__name__}") from None
    if not math.isfinite(number):
        raise ValueError(f"`{name}` must be finite; got {number}")
    return number


def as_positive(name: str, value: object) -> float:
    """Finite float > 0."""
    number = as_real(name, value)
    if number <= 0.0:
        raise ValueError(f"`{name}` must be > 0; got {number:g}")
    return number


def as_nonnegative(name: str, value: object) -> float:
    """Finite float >= 0."""
    number = as_real(name, value)
    if number < 0.0:
        raise ValueError(f"`{name}` must be >= 0; got {number:g}")
    return number


def as_share(name: str, value: object) -> float:
    """Finite float in [0, 1]: a part of a surface by area."""
    number = as_nonnegative(name, value)
    if number > 1.0:
        raise ValueError(f"`{name}` must be at most 1, the whole surface; got {number:g}")
    return number


def as_each(name: str, values: object, check: Callable[[str, object], float]) -> tuple[float, ...]:
    """One or more numbers, each as `check` makes it; a single number is refused, so that results keep their type."""
    try:
        items = list(values)  # type: ignore[call-overload]
    except TypeError:
        raise TypeError(f"`{name}` must be a sequence of numbers; got {type(values).__name__}") from None
    if not items:
        raise ValueError(f"`{name}` must hold at least one number; got none")
    return tuple(check(name, item) for item in items)


def as_depth(name: str, value: object, lo: int, hi: int) -> int:
    """Integer in lo..hi; 3.0 and True are refused."""
    if isinstance(value, bool | np.bool_):
        raise TypeError(f"`{name}` must be an integer; got {type(value).__name__}")
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"`{name}` must be an integer; got {type(value).__name__}") from None
    if not lo <= number <= hi:
        raise ValueError(f"`{name}` must be in {lo}..{hi}; got {number}")
    return number


def as_path(name: str, value: object) -> Path:
    """Path of a file to write, from text or any path; whether it can be written is seen when it is."""
    if not isinstance(value, str | os.PathLike):
        raise TypeError(f"`{name}` must be a path; got {type(value).__name__}")
    return Path(value)


def as_choice(name: str, value: object, choices: Sequence[str]) -> str:
    """One of `choices`, for Literal options."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"`{name}` must be one of {', '.join(map(repr, choices))}; got {value!r}")
    return value
