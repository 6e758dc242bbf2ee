"""The cube an octree divides, and half-spaces and domains expressed in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_positive, read_only
from voxkernel._frozen import Frozen
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.relaxed.facet_weights import WeighedPlanes

__all__ = [
    "DEFAULT_DEPTH", "MAX_DEPTH", "MIN_DEPTH", "RootCube", "cube_arrays", "cube_frame", "cube_planes", "root_cube",
]  # fmt: skip

DEFAULT_DEPTH = 7
MIN_DEPTH, MAX_DEPTH = 3, 20
_UNIT = 2.0**-53


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RootCube(Frozen):
    """The cube an octree divides: lower corner and edge in world units, rows of `axes` are its directions."""

    corner: NDArray[np.float64]
    edge: float
    axes: NDArray[np.float64]

    def to_world(self, unit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points of the unit cube to world coordinates."""
        return self.corner + (unit * self.edge) @ self.axes


def root_cube(
    corners: NDArray[np.float64],
    axes: NDArray[np.float64],
    *,
    depth: int | None = None,
    voxel_size: float | None = None,
) -> tuple[RootCube, int]:
    """Place the root cube around points and choose its depth from whichever of the two is given."""
    # A base among the points is taken off before they are turned, so that what turning rounds is small beside the
    # cube: a few units in the last place of its size, which 1e-9 of the edge covers. What is left is as large as the
    # coordinates are far from 0, M: each coordinate of a corner that was rounded once, and of the lower corner below,
    # is off by at most u M, the point by sqrt(3) u M along any axis, both together by less than 4 u M on each side.
    points = corners if len(corners) else np.zeros((1, 3))
    base = 0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)
    along = (points - base) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    middle = 0.5 * (low + high)
    extent = float((high - low).max())
    edge = (extent * (1 + 1e-9) if extent else 1.0) + 8.0 * _UNIT * float(np.abs(points).max())
    if voxel_size is None:
        levels = DEFAULT_DEPTH if depth is None else as_depth("depth", depth, MIN_DEPTH, MAX_DEPTH)
    else:
        size = as_positive("voxel_size", voxel_size)
        levels = max(MIN_DEPTH, int(np.ceil(np.log2(edge / size))))
        if levels > MAX_DEPTH:
            raise ValueError(f"`voxel_size` must be at least {edge / 2**MAX_DEPTH:.6g} for this surface; got {size}")
        edge = size * 2**levels
    return RootCube(read_only(base + (middle - 0.5 * edge) @ axes), edge, axes), levels


def cube_frame(planes: HalfSpaces, cube: RootCube, depth: int) -> NDArray[np.float64]:
    """Say how planes come from their local frame into the unit cube, as the compiled core takes it, (15,).

    Nine numbers turn the normals, offsets are scaled by the thirteenth and moved by the turned normal times the three
    before it; the pad is the error times the fourteenth and the last one. It covers the bound of the plane itself, the
    change of coordinates, and the sums made while descending; each is a few units in the last place of numbers of the
    size of the cube.
    """
    scale = planes.scale / cube.edge
    along = (planes.origin - cube.corner) / cube.edge @ cube.axes.T
    far = float(np.linalg.norm(along)) + 2.0
    least_pad = _UNIT * (32.0 * (far + scale) + 8.0 * (depth + 8))
    return np.array([*cube.axes.ravel(), *along, scale, far + scale, least_pad])


def cube_planes(
    planes: HalfSpaces, cube: RootCube, depth: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Express half-spaces in the unit cube: normals, offsets, |a|_1 and the pad that covers all rounding."""
    frame = cube_frame(planes, cube, depth)
    scale, error_factor, least_pad = frame[12:]
    normals = planes.local_normals @ cube.axes.T
    offsets = planes.local_offsets * scale + normals @ frame[9:12]
    return normals, offsets, np.abs(normals).sum(axis=1), planes.local_errors * error_factor + least_pad


def cube_arrays(
    planes: WeighedPlanes, domain: Domain, cube: RootCube, depth: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], int]:
    """Express domain and facets in the unit cube, the domain first.

    Returns normals, offsets, |a|_1, pads, weights (1 for the domain) and the number of domain planes.
    """
    border = HalfSpaces.from_planes(domain.normals, domain.offsets)
    parts = cube_planes(border, cube, depth), cube_planes(planes.facets, cube, depth)
    normals, offsets, reach, pads = (np.concatenate(pair) for pair in zip(*parts, strict=True))
    weights = np.concatenate([np.ones(len(border), np.int64), planes.weights])
    return normals, offsets, reach, pads, weights, len(border)
