"""Affine maps of surfaces: from a matrix, its sign decided exactly, to the arrays of the image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_points, read_only
from voxkernel.errors import MeshError
from voxkernel.mesh.triangles import triangle_areas
from voxkernel.mesh.zero_area import exact_integers, has_area

__all__ = ["Affine", "affine_image", "as_affine"]


class Affine(NamedTuple):
    """The map ``x -> linear x + shift``."""

    linear: NDArray[np.float64]
    shift: NDArray[np.float64]
    is_reflection: bool

    def apply(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Move points (n, 3); by columns, so that equal points stay equal. Overflow gives infinity or NaN."""
        x, y, z = points.T
        moved = np.empty_like(points)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            for axis, (row, step) in enumerate(zip(self.linear, self.shift, strict=True)):
                moved[:, axis] = x * row[0] + y * row[1] + z * row[2] + step
        return moved


def as_affine(name: str, value: object) -> Affine:
    """Finite and not singular, from (4, 4) with last row 0 0 0 1, (3, 4) or (3, 3)."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raise MeshError(f"`{name}` must have shape (4, 4), (3, 4) or (3, 3); got rows of different lengths") from None
    if raw.shape not in ((4, 4), (3, 4), (3, 3)):
        shape = tuple(int(n) for n in raw.shape)
        raise MeshError(f"`{name}` must have shape (4, 4), (3, 4) or (3, 3); got {shape}")
    rows = as_points(name, raw, columns=raw.shape[1], copy=True, error=MeshError)
    if len(rows) == 4 and rows[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise MeshError(f"`{name}` must be affine, its last row 0 0 0 1; got {rows[3].tolist()}")
    linear = rows[:3, :3]
    shift = rows[:3, 3] if rows.shape[1] == 4 else np.zeros(3)
    (a, b, c), (d, e, f), (g, h, i) = exact_integers(linear).tolist()
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if determinant == 0:
        raise MeshError(f"`{name}` must not be singular; got determinant 0")
    return Affine(linear, shift, determinant < 0)


def affine_image(
    affine: Affine,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    plane_corners: NDArray[np.int64],
    plane_areas: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64] | None]:
    """Vertices, faces, plane corners and plane areas of a mesh after a map; a reflection turns the facets round.

    Areas of triangles are left for later; that of a polygon grows as that of the three corners of its plane does.
    """
    moved = affine.apply(vertices)
    if not np.isfinite(moved).all():
        raise MeshError("`matrix` must keep coordinates finite; got a map that makes them too large for floats")
    if not has_area(moved, faces):
        raise MeshError("`matrix` must leave a facet with positive area; got a map that leaves none")
    is_shared = plane_corners is faces
    areas = None
    if not is_shared and plane_areas is not None:
        before, after = (triangle_areas(points, plane_corners) for points in (vertices, moved))
        areas = read_only(plane_areas * np.divide(after, before, out=np.zeros_like(after), where=before > 0.0))
    if affine.is_reflection:
        faces = read_only(np.ascontiguousarray(faces[:, [0, 2, 1]]))
        plane_corners = faces if is_shared else read_only(np.ascontiguousarray(plane_corners[:, [0, 2, 1]]))
    return read_only(moved), faces, plane_corners, areas
