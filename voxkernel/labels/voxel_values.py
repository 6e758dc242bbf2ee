"""Any array of labels -> native, contiguous integers of a type the compiled core takes; what is no label is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["as_label_values", "check_label_type"]

_LARGEST = 2**63 - 1
_EXACT = 2**53  # from there on float64 does not hold every integer


def check_label_type(dtype: np.dtype[Any], error: type[Exception] = TypeError) -> None:
    """Refuse a type that holds no labels, before anything is read."""
    if dtype.kind not in "biuf" or dtype.itemsize > 8:
        raise error(f"`labels` must be integers, or floats with integer values; got dtype {dtype}")


def as_label_values(raw: NDArray[Any]) -> NDArray[Any]:
    """Give labels as uint8, uint16, uint32 or int64; shares memory where it can.

    Raises
    ------
    ValueError
        If a value is negative, not an integer, or above 2**63 - 1.
    """
    kind = raw.dtype.kind
    if kind == "b":
        return np.ascontiguousarray(raw).view(np.uint8)
    if kind == "f":
        return _of_floats(raw)
    native = np.ascontiguousarray(raw, dtype=raw.dtype.newbyteorder("="))
    if native.dtype == np.uint64:
        if native.size and int(native.max()) > _LARGEST:
            raise ValueError(f"`labels` must be at most 2**63 - 1; got {int(native.max())}")
        return native.view(np.int64)
    if kind == "u":
        return native
    if native.size and native.min() < 0:
        raise ValueError(f"`labels` must be >= 0, with 0 for the background; got {int(native.min())}")
    return native if native.itemsize == 8 else native.view(f"u{native.itemsize}")


def _of_floats(raw: NDArray[Any]) -> NDArray[np.int64]:
    values = np.ascontiguousarray(raw, dtype=np.float64)
    if not values.size:
        return values.astype(np.int64)
    low, high = values.min(), values.max()  # NaN where one is
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError(f"`labels` must be integers; got {values[~np.isfinite(values)][0]}")
    if low < 0:
        raise ValueError(f"`labels` must be >= 0, with 0 for the background; got {low:g}")
    if high > _EXACT:
        raise ValueError(f"`labels` as floats must be at most 2**53, beyond which integers are lost; got {high:g}")
    whole = values.astype(np.int64)
    if not np.array_equal(whole, values):
        raise ValueError(f"`labels` must be integers; got {values[whole != values][0]:g}")
    return whole
