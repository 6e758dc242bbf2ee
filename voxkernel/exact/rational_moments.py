"""Moments of polytopes in rational arithmetic: flat ones, and thin or tiny solids."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from itertools import pairwise
from math import sqrt
from typing import TypeVar

from voxkernel.exact.meeting_points import HomogeneousPoint, RationalPoint

__all__ = ["flat_moments", "solid_moments"]

_Number = TypeVar("_Number", Fraction, int)
_ROOT_BITS = 52  # a double from 1 to 2 times two to this is an integer


def flat_moments(
    dimension: int, corners: list[RationalPoint], faces: list[list[int]]
) -> tuple[Fraction, RationalPoint]:
    """Area (its root rounded) and centroid of a point, a segment or a polygon, which is cut into triangles."""
    zero = Fraction(0)
    base = corners[0]
    relative = [[u - v for u, v in zip(c, base, strict=True)] for c in corners]
    area = zero
    weights: list[tuple[Fraction, list[Fraction]]] = []
    if dimension == 2:
        for i, j in faces:
            size = _length(_cross(relative[i], relative[j])) / 2
            area += size
            weights.append((size, [(u + v) / 3 for u, v in zip(relative[i], relative[j], strict=True)]))
    else:
        weights = [(Fraction(1), r) for r in relative]
    total = sum((w for w, _ in weights), zero)
    x, y, z = (sum((w * m[k] for w, m in weights), zero) / total + base[k] for k in range(3))
    return area, (x, y, z)


def solid_moments(
    corners: list[HomogeneousPoint], faces: list[list[int]]
) -> tuple[Fraction, Fraction, RationalPoint, list[list[Fraction]]]:
    """Volume, area (its root rounded), centroid and second central moment of a solid.

    It is cut into tetrahedra from corner 0. Corners are rounded to a grid so fine that no double of the result
    notices.
    """
    bx, by, bz, bw = corners[0]
    relative = [(x * bw - bx * w, y * bw - by * w, z * bw - bz * w, w * bw) for x, y, z, w in corners]
    farthest = reduce(_farther, ((max(abs(x), abs(y), abs(z)), w) for x, y, z, w in relative))
    size = Fraction(*farthest)
    bits = 256
    while True:
        power = size.numerator.bit_length() - size.denominator.bit_length() + 1 - bits
        volume6, area2, first24, second120 = _moments([_rounded(r, power) for r in relative], faces)
        # Rounding moves corners by one unit: the thinner the solid, the more bits its moments need.
        needed = 64 + 3 * (3 * bits - volume6.bit_length())
        if volume6 > 0 and bits >= needed:
            break
        bits = needed if volume6 > 0 else 4 * bits
    unit = Fraction(2) ** power
    mean = [Fraction(v, 4 * volume6) for v in first24]
    second = [
        [(Fraction(second120[p][q], 120) - Fraction(volume6, 6) * mean[p] * mean[q]) * unit**5 for q in range(3)]
        for p in range(3)
    ]
    x, y, z = (u * unit + Fraction(v, bw) for u, v in zip(mean, (bx, by, bz), strict=True))
    return Fraction(volume6, 6) * unit**3, area2 * unit**2 / 2, (x, y, z), second


def _farther(one: tuple[int, int], other: tuple[int, int]) -> tuple[int, int]:
    """The larger of two quotients with positive denominators, without a common divisor."""
    return other if other[0] * one[1] > one[0] * other[1] else one


def _rounded(point: HomogeneousPoint, power: int) -> tuple[int, int, int]:
    """A point divided by 2**power, each coordinate to the nearest integer, halves to even ones."""
    x, y, z, w = point
    if power < 0:
        x, y, z = x << -power, y << -power, z << -power
    else:
        w <<= power
    return _nearest(x, w), _nearest(y, w), _nearest(z, w)


def _nearest(numerator: int, denominator: int) -> int:
    whole, rest = divmod(numerator, denominator)
    rest <<= 1
    return whole + (rest > denominator or (rest == denominator and whole & 1 == 1))


def _moments(
    corners: list[tuple[int, int, int]], faces: list[list[int]]
) -> tuple[int, Fraction, list[int], list[list[int]]]:
    """6 x volume, 2 x area, 24 x first and 120 x second moment about the origin, in integers but for the area.

    A tetrahedron from the origin over a, b, c adds to 24 times the first moment its part of 6 times the volume, times
    a + b + c, and to 120 times the second a a + b b + c c + (a + b + c)(a + b + c). Parts of a corner are summed first.
    """
    area = 0  # times 2**_ROOT_BITS
    parts = [0] * len(corners)
    xx = yy = zz = xy = xz = yz = 0
    for ring in faces:
        a = ring[0]
        ax, ay, az = corners[a]
        for b, c in pairwise(ring[1:]):
            bx, by, bz = corners[b]
            cx, cy, cz = corners[c]
            ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            largest = max(abs(nx), abs(ny), abs(nz))
            if largest == 0:
                continue
            area += largest * int(
                sqrt((nx / largest) ** 2 + (ny / largest) ** 2 + (nz / largest) ** 2) * 2.0**_ROOT_BITS
            )
            part = ax * nx + ay * ny + az * nz
            if part == 0:
                continue
            parts[a] += part
            parts[b] += part
            parts[c] += part
            tx, ty, tz = ax + bx + cx, ay + by + cy, az + bz + cz
            px, py = part * tx, part * ty
            xx += px * tx
            xy += px * ty
            xz += px * tz
            yy += py * ty
            yz += py * tz
            zz += part * tz * tz
    x = y = z = 0
    for part, (cx, cy, cz) in zip(parts, corners, strict=True):
        px, py, pz = part * cx, part * cy, part * cz
        x, y, z = x + px, y + py, z + pz
        xx += px * cx
        xy += px * cy
        xz += px * cz
        yy += py * cy
        yz += py * cz
        zz += pz * cz
    return sum(parts) // 3, Fraction(area, 1 << _ROOT_BITS), [x, y, z], [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def _cross(a: list[_Number], b: list[_Number]) -> list[_Number]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _length(a: Sequence[Fraction | int]) -> Fraction:
    """Length of a rational vector, rounded to a double's accuracy but not to its range."""
    largest = max(abs(v) for v in a)
    if largest == 0:
        return Fraction(0)
    return largest * Fraction(sqrt(sum(float(v / largest) ** 2 for v in a)))
