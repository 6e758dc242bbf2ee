"""Which triangles have exactly zero area: a float filter, then exact integers for the undecided."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["exact_integers", "has_area", "is_degenerate"]

# Shewchuk 1997, orient2d stage A: |error of the 2x2 determinant| <= (3 + 16 u) u (|p| + |q|), u = 2^-53.
_BOUND = (3.0 + 16.0 * 2.0**-53) * 2.0**-53
_UNDERFLOW = 1e-290  # far above what underflow of a product of two doubles can hide
_CHUNK = 1 << 16


def exact_integers(values: NDArray[np.float64]) -> NDArray[np.object_]:
    """Python ints `k` with ``values == k * 2**e`` for one common e, so signs and products are exact."""
    mantissa, exponent = np.frexp(values)
    mantissa = (mantissa * 2.0**53).astype(np.int64)
    used = exponent[mantissa != 0]
    lowest = int(used.min()) if used.size else 0
    shift = np.where(mantissa != 0, exponent - lowest, 0)
    return np.left_shift(mantissa.astype(object), shift.astype(object))


def _certainly_has_area(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Conservative: True only where one component of the cross product is provably not zero."""
    with np.errstate(over="ignore", invalid="ignore"):
        origin = vertices.take(triangles[:, 0], axis=0)
        u = (vertices.take(triangles[:, 1], axis=0) - origin).T
        v = (vertices.take(triangles[:, 2], axis=0) - origin).T
        certain = np.zeros(len(triangles), dtype=bool)
        for i, j in ((0, 1), (1, 2), (2, 0)):
            p, q = u[i] * v[j], u[j] * v[i]
            certain |= np.abs(p - q) > _BOUND * (np.abs(p) + np.abs(q)) + _UNDERFLOW
    return certain


def is_degenerate(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(m,) True where the three corners are exactly collinear (or equal), decided without a tolerance."""
    degenerate = np.zeros(len(triangles), dtype=bool)
    for start in range(0, len(triangles), _CHUNK):
        part = triangles[start : start + _CHUNK]
        open_ids = np.flatnonzero(~_certainly_has_area(vertices, part))
        if open_ids.size == 0:
            continue
        a, b, c = part[open_ids].T
        repeated = (a == b) | (b == c) | (c == a)
        degenerate[start + open_ids[repeated]] = True
        rest = open_ids[~repeated]
        if rest.size:
            corners = exact_integers(vertices[part[rest]])
            u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
            zero = np.ones(len(rest), dtype=bool)
            for i, j in ((0, 1), (1, 2), (2, 0)):
                zero &= u[:, i] * v[:, j] == u[:, j] * v[:, i]
            degenerate[start + rest] = zero
    return degenerate


def has_area(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> bool:
    """Is any triangle not degenerate? Stops at the first block that settles it."""
    for start in range(0, len(triangles), _CHUNK):
        if _certainly_has_area(vertices, triangles[start : start + _CHUNK]).any():
            return True
    return not bool(is_degenerate(vertices, triangles).all())
