"""Solid kernels that are thin or small: stretched until they are round, with dual points rounded once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import planes_reaching
from voxkernel._frozen import Frozen
from voxkernel.exact.dual_hull import DualHull, Polyhedron, polyhedron_of_duals
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.integer_planes import IntegerPlane

__all__ = ["Stretched", "axes_of_cloud", "axes_of_corners", "stretched_polyhedron"]

_UNIT = 2.0**-53
_BITS = 60
_REACHES = (64.0, 2.0**16)
_ROUND = 1e3
_ROUNDS = 4

RationalPoint = tuple[Fraction, Fraction, Fraction]
Axes = tuple[RationalPoint, RationalPoint, RationalPoint]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Stretched(Frozen):
    """A polyhedron { center + basis @ y } and the same in round coordinates y.

    `factor` is the determinant of `basis`, rounded once; `misfit` bounds |a . y - 1| about its middle.
    """

    solid: Polyhedron
    round_vertices: NDArray[np.float64]
    basis: NDArray[np.float64]
    factor: float
    misfit: float


def axes_of_cloud(planes: HalfSpaces, cloud: NDArray[np.float64]) -> Axes | None:
    """Give axes, lattice vectors, in which a cloud about the origin is round; None for a flat cloud."""
    _, _, axes = np.linalg.svd(cloud, full_matrices=False)
    sizes = np.abs(cloud @ axes.T).max(axis=0)
    if not (sizes > 0).all():
        return None
    unit = Fraction(planes.scale) * planes.lattice_unit
    x, y, z = (
        _vector(Fraction(v) * Fraction(size) * unit for v in axis)
        for axis, size in zip(axes.tolist(), sizes.tolist(), strict=True)
    )
    return x, y, z


def axes_of_corners(corners: Sequence[RationalPoint]) -> Axes | None:
    """Give three exact corners, seen from the origin inside them, that span nearly as much as any three."""
    size = max(abs(v) for c in corners for v in c)
    bits = 128
    while bits < 1 << 14:
        grid = [_vector(round(v / size * (1 << bits)) for v in c) for c in corners]
        first = max(grid, key=lambda c: _dot(c, c))
        second = max(grid, key=lambda c: _dot(_cross(first, c), _cross(first, c)))
        normal = _cross(first, second)
        third = max(grid, key=lambda c: abs(_dot(normal, c)))
        # Rounding to the grid must be nothing next to the thickness.
        if abs(_dot(normal, third)).bit_length() > 2 * bits + _BITS:
            x, y, z = (_vector(size * v / (1 << bits) for v in c) for c in (first, second, third))
            return x, y, z
        bits *= 2
    return None


def stretched_polyhedron(planes: HalfSpaces, point: RationalPoint, axes: Axes) -> Stretched | None:
    """Intersect half-spaces about a point strictly inside, in coordinates in which they are round.

    In x = point + axes y, the half-space n . x <= d is a . y <= 1 with a = axes^T n / (d - n . point).
    Point and axes are rational, so a is an exact rational of the input and rounded only once:
    neither a small distance nor a nearly parallel normal loses digits. Where the polyhedron turns out
    not to be round, its own corners make new axes.

    Parameters
    ----------
    planes : HalfSpaces
        Those that may bound the kernel.
    point : 3 Fraction
        Lattice coordinates, strictly inside all of them.
    axes : 3 x 3 Fraction
        Rows are lattice vectors, not in one plane.

    Returns
    -------
    Stretched or None
        None where Qhull gives up or the polyhedron is unbounded.
    """
    integers = planes.integer_planes(range(len(planes)))
    found = None
    for _ in range(_ROUNDS):
        if _dot(_cross(axes[0], axes[1]), axes[2]) < 0:  # faces must not be turned over
            axes = axes[1], axes[0], axes[2]
        found = _polyhedron(planes, integers, point, axes)
        if found is None:
            return None
        y = found.round_vertices
        widths = np.ptp(y, axis=0)
        if widths.max() <= _ROUND * widths.min() and np.abs(y).max() <= _ROUND:
            return found
        corners = [_combination(v, axes) for v in y[:: max(1, len(y) // 256)].tolist()]
        again = axes_of_corners(corners)
        if again is None:
            return found
        axes = again
    return found


def _polyhedron(
    planes: HalfSpaces, integers: list[IntegerPlane], point: RationalPoint, axes: Axes
) -> Stretched | None:
    """Read one polyhedron off the hull of its dual points, first about the point, then about its middle."""
    # Integers for speed, with so many bits that the thinnest axes stay apart; the basis is what they say.
    sizes = [max(abs(v) for v in w) for w in axes]
    bits = 64
    whole: list[tuple[int, int, int]] = []
    determinant = 0
    while determinant.bit_length() <= 2 * bits + _BITS and bits < 1 << 14:
        bits *= 2
        whole = [_vector(round(v / size * (1 << bits)) for v in w) for w, size in zip(axes, sizes, strict=True)]
        determinant = _dot(_cross(whole[0], whole[1]), whole[2])
    if determinant <= 0:
        return None
    factors = [size / (1 << bits) for size in sizes]
    duals = np.empty((len(planes), 3))
    for i, (a, b, c, d) in enumerate(integers):
        distance = d - (a * point[0] + b * point[1] + c * point[2])
        if distance <= 0:
            return None
        for k, (u, v, w) in enumerate(whole):
            duals[i, k] = float((a * u + b * v + c * w) * factors[k] / distance)
    unit = Fraction(planes.scale) * planes.lattice_unit
    basis = np.array([[float(v * f / unit) for v in w] for w, f in zip(whole, factors, strict=True)]).T
    factor = float(determinant * factors[0] * factors[1] * factors[2] / unit**3)
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    for reach in _REACHES:
        found = polyhedron_of_duals(duals, cube / reach)
        if found is None:
            return None
        if found.is_closed:
            break
    else:
        return None
    # Once more about the middle: a point near a face has a far dual point, next to which others are lost.
    middle = found.vertices.mean(axis=0)
    centered = duals / (1.0 - duals @ middle)[:, None]
    again = polyhedron_of_duals(centered, cube / (2 * _REACHES[-1]))
    if again is not None and again.is_closed:
        found = replace(again, vertices=again.vertices + middle)
    center = planes.from_lattice(point)
    solid = Polyhedron(center, found.vertices @ basis.T, found.start, found.ring, found.rows)
    return Stretched(solid, found.vertices, basis, factor, _misfit(found, duals, middle))


def _misfit(found: DualHull, duals: NDArray[np.float64], middle: NDArray[np.float64]) -> float:
    """Bound max |a . y - 1| over the corners of every face and a . y - 1 over all corners and rows, about the middle.

    `duals` are exact but for one rounding each. Moving every plane a . y = 1 by the misfit scales the
    polyhedron about its middle, so three times the misfit bounds the relative error of the volume.
    """
    height = 1.0 - duals @ middle
    centered = duals / height[:, None]
    lengths = np.sqrt((centered**2).sum(axis=1))
    corners = found.vertices - middle
    extent = float(np.sqrt((corners**2).sum(axis=1).max()))
    # Two roundings of each number and those of the product a . middle, whose terms may be larger than `height`.
    blur = _UNIT * (4.0 + 4.0 * np.sqrt((duals**2).sum(axis=1)) * float(np.sqrt(middle @ middle)) / height)
    rows, excess, pads = planes_reaching(
        np.divide(centered, lengths[:, None]), 1.0 / lengths, extent * blur, np.zeros(3), corners, 0.0
    )
    owner = np.repeat(found.rows, np.diff(found.start))
    products = np.einsum("ij,ij->i", centered[owner], corners[found.ring])
    on_face = np.abs(products - 1.0) + (blur[owner] + 8.0 * _UNIT) * lengths[owner] * extent
    return max(float(on_face.max()), float(np.max((excess + pads) * lengths[rows], initial=0.0)))


def _cross(a: Sequence[Any], b: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Cross product of exact vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Dot product of exact vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _combination(y: Sequence[float], axes: Axes) -> RationalPoint:
    u, v, w = (Fraction(s) for s in y)
    return _vector(u * a + v * b + w * c for a, b, c in zip(*axes, strict=True))


def _vector(values: Iterable[Any]) -> tuple[Any, Any, Any]:
    x, y, z = values
    return x, y, z
