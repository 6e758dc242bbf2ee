"""The local frame of a surface and its facet planes in it, each with a bound on its error."""

from __future__ import annotations

from collections.abc import Iterable
from math import frexp, ldexp, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import StopFlag, facet_planes
from voxkernel._threads import run_parts, stretches
from voxkernel.errors import MeshError
from voxkernel.halfspaces.integer_planes import bits_of, round_plane, triangle_plane
from voxkernel.halfspaces.rational_program import rank_of

__all__ = ["LARGEST", "THINNEST", "LocalFrame", "local_planes", "power_of_two", "span_space"]

LARGEST = 2.0**200
THINNEST = 2.0**-300


class LocalFrame(NamedTuple):
    """Where local coordinates begin, their unit, and bits with which every coordinate of a surface is an integer."""

    origin: NDArray[np.float64]
    scale: float
    bits: int

    @classmethod
    def of_range(
        cls, low: NDArray[np.float64], high: NDArray[np.float64], smallest: float, thinnest: float = THINNEST
    ) -> LocalFrame:
        """The frame of vertices with this bounding box and this smallest magnitude but zero."""
        origin, scale = _local_frame(low, high)
        _check_spans((high - low).tolist(), thinnest)
        return cls(origin, scale, bits_of(smallest))


def local_planes(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], frame: LocalFrame, threads: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Local normals, offsets, areas and errors of facet planes; the error is negative where there is no area."""
    n = len(corners)
    normals, offsets = np.empty((n, 3)), np.empty(n)
    areas, errors = np.empty(n), np.empty(n)

    def fill(rows: slice, _: StopFlag) -> int:
        arrays = normals[rows], offsets[rows], areas[rows], errors[rows]
        return facet_planes(vertices, corners[rows], frame.origin, 1.0 / frame.scale, *arrays)

    if sum(run_parts(fill, stretches(n, threads), threads)):
        for i in np.flatnonzero(errors == -1.0):
            plane = triangle_plane(vertices, corners[i], frame.bits)
            normals[i], offsets[i], areas[i], errors[i] = round_plane(plane, *frame)
    return normals, offsets, areas, errors


def power_of_two(value: float) -> float:
    """Choose the smallest power of two that is at least `value`, so that scaling is exact."""
    if value == 0.0:
        return 1.0
    mantissa, exponent = frexp(value)
    return ldexp(1.0, exponent - (mantissa == 0.5))


def _local_frame(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    lower, upper = low.tolist(), high.tolist()
    largest = max(map(abs, lower + upper))
    span = max(v - u for u, v in zip(lower, upper, strict=True))
    if largest > LARGEST or span < 1 / LARGEST:
        raise MeshError(
            "`vertices` must lie within 2**200 of the origin and span at least 2**-200, so that volumes are numbers; "
            f"got a largest coordinate of {largest:.3g} and a span of {span:.3g} (rescale first)"
        )
    origin = [u + 0.5 * (v - u) for u, v in zip(lower, upper, strict=True)]
    square = sum(max(v - o, o - u) ** 2 for u, o, v in zip(lower, origin, upper, strict=True))
    return np.array(origin), power_of_two(sqrt(square) * (1 + 1e-12))


def _check_spans(spans: list[float], thinnest: float) -> None:
    thin = [v for v in spans if 0.0 < v < max(spans) * thinnest]
    if thin:
        raise MeshError(
            "`vertices` must span, along each axis, nothing or at least 2**-300 of their largest span; got spans "
            f"of {thin[0]:.3g} and {max(spans):.3g} (rescale first)"
        )


def span_space(normals: NDArray[np.float64], exact: Iterable[tuple[int, int, int]]) -> bool:
    """Whether normals span space: facets that all run along one direction enclose nothing, closed or not."""
    for rows in (normals[:: max(1, len(normals) // 64)], normals):
        if _least_spread(rows) > 1e-9:
            return True
    return rank_of(exact) == 3


def _least_spread(normals: NDArray[np.float64]) -> float:
    """A lower bound of the mean square of unit normals along any direction, up to rounding."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = (normals.T @ normals / len(normals)).tolist()
    # The product of the eigenvalues; two of them have a product of at most (trace / 2)^2 = 1/4.
    return 4.0 * (xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz))
