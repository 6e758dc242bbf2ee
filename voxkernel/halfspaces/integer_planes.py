"""Planes of facets in exact integers, and exact numbers to and from doubles."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import frexp, isqrt

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "IntegerPlane",
    "bits_of",
    "dyadic_sum",
    "explicit_plane",
    "lattice_bits",
    "ratios",
    "round_plane",
    "to_float",
    "triangle_plane",
    "triangle_planes",
]

IntegerPlane = tuple[int, int, int, int]


def lattice_bits(values: NDArray[np.float64]) -> int:
    """Find bits so that every value times 2**bits is an integer."""
    if values.size == 0:
        return 0
    magnitudes = np.abs(values)
    return bits_of(float(np.min(magnitudes, where=magnitudes > 0, initial=np.inf)))


def bits_of(smallest: float) -> int:
    """Find bits for the smallest magnitude that is not zero."""
    if smallest == np.inf:
        return 0
    return max(0, 53 - frexp(smallest)[1])


def ratios(values: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Give doubles as exact fractions."""
    return [v.as_integer_ratio() for v in values.tolist()]


def dyadic_sum(a: int, p: int, b: int, q: int) -> Fraction:
    """Add a / p and b / q for powers of two p and q."""
    return Fraction(a + b * (p // q), p) if p >= q else Fraction(a * (q // p) + b, q)


def to_float(value: Fraction) -> float:
    """Round a fraction; infinite beyond the range of doubles."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else -float("inf")


def _to_integer(value: float, bits: int) -> int:
    numerator, denominator = value.as_integer_ratio()
    return (numerator << bits) // denominator


def triangle_plane(vertices: NDArray[np.float64], row: NDArray[np.int64], bits: int) -> IntegerPlane:
    """Give the plane through three vertices of the lattice."""
    p, q, r = row.tolist()
    return _plane_through(*(_lattice_point(vertices[corner], bits) for corner in (p, q, r)))


def triangle_planes(vertices: NDArray[np.float64], bits: int) -> Callable[[list[int]], IntegerPlane]:
    """Give the planes of triangles that share vertices: each vertex is made of integers once."""
    known: dict[int, tuple[int, int, int]] = {}

    def plane_of(row: list[int]) -> IntegerPlane:
        for corner in row:
            if corner not in known:
                known[corner] = _lattice_point(vertices[corner], bits)
        p, q, r = row
        return _plane_through(known[p], known[q], known[r])

    return plane_of


def _lattice_point(point: NDArray[np.float64], bits: int) -> tuple[int, int, int]:
    x, y, z = point.tolist()
    return _to_integer(x, bits), _to_integer(y, bits), _to_integer(z, bits)


def _plane_through(a: tuple[int, int, int], b: tuple[int, int, int], c: tuple[int, int, int]) -> IntegerPlane:
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a, b, c
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return nx, ny, nz, nx * ax + ny * ay + nz * az


def explicit_plane(row: NDArray[np.float64], bits: int) -> IntegerPlane:
    """Give a plane by its numbers in the lattice, times a power of two that makes them integers."""
    extra = max(0, lattice_bits(row) - bits)
    a, b, c = (_to_integer(float(v), bits + extra) for v in row[:3])
    d = _to_integer(float(row[3]), bits + extra)
    return a, b, c, d << bits


def round_plane(
    plane: IntegerPlane, origin: NDArray[np.float64], scale: float, bits: int
) -> tuple[tuple[float, float, float], float, float, float]:
    """Round an exact plane to a local one; error -2 where the normal is exactly zero."""
    a, b, c, d = plane
    square = a * a + b * b + c * c
    if square == 0:
        return (0.0, 0.0, 0.0), 0.0, 0.0, -2.0
    shift = 64
    length = isqrt(square << (2 * shift))
    normal = (
        float(Fraction(a << shift, length)),
        float(Fraction(b << shift, length)),
        float(Fraction(c << shift, length)),
    )
    ox, oy, oz = (Fraction(float(v)) * (1 << bits) for v in origin)
    distance = (d - a * ox - b * oy - c * oz) * (1 << shift) / length
    unit = Fraction(scale) * (1 << bits)
    area = Fraction(length, 1 << shift) / (2 * unit * unit)
    return normal, float(distance / unit), float(area), 8 * 2.0**-53
