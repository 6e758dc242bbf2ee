"""Arithmetic on triangles: which vertices they use, normals, areas and volumes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel import _core

__all__ = [
    "bounds_of",
    "corner_areas",
    "doubled_areas",
    "doubled_normals",
    "facet_normals",
    "scale_exponent",
    "scaled_triangle_areas",
    "triangle_areas",
    "triple_products",
    "unit_normals",
    "unscaled",
    "used_vertices",
    "without_strays",
]


def scale_exponent(vertices: NDArray[np.float64]) -> int:
    """The e with max |coordinate| in [2**(e-1), 2**e): products of coordinates / 2**e cannot overflow."""
    return int(np.frexp(max(float(vertices.max()), -float(vertices.min())))[1])


def used_vertices(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The vertices that a face refers to, in order: no other one may change an answer."""
    used = np.zeros(len(vertices), np.bool_)
    used[faces.ravel()] = True
    return vertices if used.all() else vertices[used]


def without_strays(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Leave out the vertices that no face refers to; the arrays themselves where there are none."""
    used = np.zeros(len(vertices), np.bool_)
    used[faces.ravel()] = True
    if used.all():
        return vertices, faces
    return vertices[used], (np.cumsum(used) - 1)[faces]


def bounds_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 3) lowest and highest coordinates."""
    return np.array([[x.min() for x in points.T], [x.max() for x in points.T]])  # by columns, which is quicker


def unscaled(values: Any, exponent: int) -> Any:
    """``values * 2**exponent``; infinite where that is too large for a float."""
    with np.errstate(over="ignore", under="ignore"):
        return np.ldexp(values, exponent)


def _crossed(u: Iterable[NDArray[np.float64]], v: Iterable[NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
    """Cross products, given and returned as columns."""
    (ux, uy, uz), (vx, vy, vz) = u, v
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def doubled_normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3) twice the area times the outward unit normal of triangles (m, 3, 3); differences first."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.stack(_crossed(u.T, v.T), axis=1)


def doubled_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) twice the areas of triangles (m, 3, 3)."""
    return np.linalg.norm(doubled_normals(corners), axis=1)


def unit_normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3) outward unit normals of triangles (m, 3, 3); 0 where floats see no area."""
    doubled = doubled_normals(corners)
    length = np.linalg.norm(doubled, axis=1, keepdims=True)
    return np.divide(doubled, length, out=np.zeros_like(doubled), where=length > 0.0)


def facet_normals(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """(m, 3) unit normals; scaled by a power of two, so that no product overflows and no bit changes."""
    vertices, triangles = without_strays(vertices, triangles)
    return unit_normals(np.ldexp(vertices, -scale_exponent(vertices))[triangles])


def triple_products(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) a . (b x c): six times the signed volumes of the tetrahedra from the origin to triangles."""
    return np.einsum("ij,ij->i", a, np.cross(b, c))


def triangle_areas(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """(m,) areas; differences first, so a mesh far from the origin loses nothing."""
    vertices, triangles = without_strays(vertices, triangles)
    exponent = scale_exponent(vertices)
    return unscaled(scaled_triangle_areas(vertices, triangles, exponent), 2 * exponent)


def corner_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) areas of triangles (m, 3, 3), by columns."""
    a, b, c = (corners[:, k].T for k in range(3))
    x, y, z = _crossed(b - a, c - a)
    return 0.5 * np.sqrt(x * x + y * y + z * z)


def scaled_triangle_areas(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], exponent: int
) -> NDArray[np.float64]:
    """(m,) areas in units of ``4**exponent``."""
    return _core.triangle_areas(np.ascontiguousarray(vertices), np.ascontiguousarray(triangles), exponent)
