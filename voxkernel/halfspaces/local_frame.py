"""The local frame of a surface, and what floating point leaves open about its facet planes in it."""

from __future__ import annotations

from collections.abc import Iterable
from math import frexp, ldexp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import least_spread, plane_frame
from voxkernel.errors import MeshError
from voxkernel.halfspaces.integer_planes import bits_of, round_plane, triangle_plane
from voxkernel.halfspaces.rational_program import rank_of
from voxkernel.mesh import TriangleMesh

__all__ = [
    "LARGEST",
    "THINNEST",
    "LocalFrame",
    "check_extent",
    "check_frame",
    "power_of_two",
    "settle_planes",
    "span_space",
]

LARGEST = 2.0**200
THINNEST = 2.0**-300


class LocalFrame(NamedTuple):
    """Where local coordinates begin, their unit, and bits with which every coordinate of a surface is an integer."""

    origin: NDArray[np.float64]
    scale: float
    bits: int

    @classmethod
    def of_range(cls, low: NDArray[np.float64], high: NDArray[np.float64], smallest: float) -> LocalFrame:
        """The frame of vertices with this bounding box and this smallest magnitude but zero."""
        origin, scale, spans, largest, _ = plane_frame(np.array([low, high]), np.array([[0, 1, 1]]))
        check_frame(spans, largest, THINNEST)
        return cls(origin, scale, bits_of(smallest))


def check_frame(spans: tuple[float, float, float], largest: float, thinnest: float) -> None:
    """Refuse surfaces that span too much or too little for doubles; `thinnest` is a share of the largest span."""
    widest = max(spans)
    if largest > LARGEST or widest < 1 / LARGEST:
        raise MeshError(
            "`vertices` must lie within 2**200 of the origin and span at least 2**-200, so that volumes are numbers; "
            f"got a largest coordinate of {largest:.3g} and a span of {widest:.3g} (rescale first)"
        )
    if min(spans) >= widest * thinnest:
        return
    thin = [v for v in spans if 0.0 < v < widest * thinnest]
    if thin:
        raise MeshError(
            "`vertices` must span, along each axis, nothing or at least 2**-300 of their largest span; got spans "
            f"of {thin[0]:.3g} and {widest:.3g} (rescale first)"
        )


def check_extent(mesh: TriangleMesh) -> None:
    """Refuse a surface whose extent is beyond floating point, as its half-spaces would."""
    _, _, spans, largest, _ = plane_frame(mesh.vertices, mesh.faces)
    check_frame(spans, largest, THINNEST)


def settle_planes(
    vertices: NDArray[np.float64],
    corners: NDArray[np.int64],
    frame: LocalFrame,
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    areas: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> None:
    """Decide in integers the facets that floating point left open: plane and area, or an error below 0 for none."""
    for i in np.flatnonzero(errors == -1.0):
        plane = triangle_plane(vertices, corners[i], frame.bits)
        normals[i], offsets[i], areas[i], errors[i] = round_plane(plane, *frame)


def power_of_two(value: float) -> float:
    """Choose the smallest power of two that is at least `value`, so that scaling is exact."""
    if value == 0.0:
        return 1.0
    mantissa, exponent = frexp(value)
    return ldexp(1.0, exponent - (mantissa == 0.5))


def span_space(normals: NDArray[np.float64], exact: Iterable[tuple[int, int, int]]) -> bool:
    """Whether normals span space: facets that all run along one direction enclose nothing, closed or not."""
    for step in (max(1, len(normals) // 64), 1):
        if least_spread(normals, step) > 1e-9:
            return True
    return rank_of(exact) == 3
