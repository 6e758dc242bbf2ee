"""A shape and what is known about it -> `KernelPolytope`."""

from __future__ import annotations

from typing import Any

import numpy as np

from voxkernel._checks import read_only
from voxkernel.exact.kernel_polytope import KernelPolytope
from voxkernel.exact.kernel_shape import Shape
from voxkernel.halfspaces import HalfSpaces

__all__ = ["empty_kernel", "polytope_of"]

# Above what a number below the normal range of doubles loses, several times over.
_LEAST = 2.0**-1070


def polytope_of(planes: HalfSpaces, dimension: int, shape: Shape, **facts: Any) -> KernelPolytope:
    """Bring a shape to world coordinates; `facts` are the fields that it does not know."""
    scale = planes.scale
    return KernelPolytope(
        dimension=dimension,
        vertices=read_only(planes.to_world(shape.vertices)),
        face_starts=read_only(shape.face_starts),
        face_vertices=read_only(shape.face_vertices),
        face_facets=read_only(planes.facet_ids[shape.rows]),
        vertex_rows=read_only(shape.vertex_rows),
        volume=shape.volume * scale**3,
        area=shape.area * scale**2,
        centroid=read_only(planes.to_world(shape.centroid)),
        inertia=read_only(shape.inertia * scale**5),
        deepest_point=read_only(planes.to_world(shape.deepest)),
        clearance=shape.clearance * scale,
        max_residual=shape.residual * scale,
        volume_bounds=_volume_bounds(shape, scale) if dimension == 3 else (0.0, 0.0),
        _flat_vertices=tuple(shape.corners),
        **facts,
    )


def _volume_bounds(shape: Shape, scale: float) -> tuple[float, float]:
    """Bounds that hold where the volume is too small or too large for a double with all its digits, too."""
    lower, upper = (
        max(0.0, shape.volume * (1.0 - shape.rounding) - _LEAST) * scale**3,
        (shape.volume * (1.0 + shape.rounding) + _LEAST) * scale**3,
    )
    return max(0.0, float(np.nextafter(lower, -np.inf))), float(np.nextafter(upper, np.inf))


def empty_kernel(**facts: Any) -> KernelPolytope:
    """A kernel without points."""
    nowhere = read_only(np.full(3, np.nan))
    return KernelPolytope(
        dimension=-1,
        vertices=read_only(np.empty((0, 3))),
        face_starts=read_only(np.zeros(1, np.int64)),
        face_vertices=read_only(np.empty(0, np.int64)),
        face_facets=read_only(np.empty(0, np.int64)),
        vertex_rows=read_only(np.empty((0, 3), np.int64)),
        volume=0.0,
        area=0.0,
        centroid=nowhere,
        inertia=read_only(np.zeros((3, 3))),
        deepest_point=nowhere,
        clearance=float("nan"),
        max_residual=0.0,
        volume_bounds=(0.0, 0.0),
        **facts,
    )
