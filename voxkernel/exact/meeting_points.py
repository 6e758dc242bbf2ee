"""Points in which planes meet, exactly."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import HalfSpaces

__all__ = ["HomogeneousPoint", "RationalPoint", "homogeneous_meeting_points", "meeting_points"]

RationalPoint = tuple[Fraction, Fraction, Fraction]
HomogeneousPoint = tuple[int, int, int, int]  # x, y, z and what they are divided by, which is positive


def homogeneous_meeting_points(planes: HalfSpaces, rows: NDArray[np.signedinteger]) -> list[HomogeneousPoint]:
    """Give the common point of three planes each, (k, 3) rows, in lattice coordinates, by Cramer's rule."""
    used = np.unique(rows)
    exact = dict(zip(used.tolist(), planes.integer_planes(used), strict=True))
    points: list[HomogeneousPoint] = []
    for three in rows.tolist():
        (a, b, c, s), (d, e, f, t), (g, h, i, u) = (exact[r] for r in three)
        # Cross products of two normals each; the point is their sum, weighted by the third offset.
        ux, uy, uz = e * i - f * h, f * g - d * i, d * h - e * g
        vx, vy, vz = h * c - i * b, i * a - g * c, g * b - h * a
        wx, wy, wz = b * f - c * e, c * d - a * f, a * e - b * d
        below = a * ux + b * uy + c * uz
        x, y, z = s * ux + t * vx + u * wx, s * uy + t * vy + u * wy, s * uz + t * vz + u * wz
        points.append((x, y, z, below) if below > 0 else (-x, -y, -z, -below))
    return points


def meeting_points(planes: HalfSpaces, rows: NDArray[np.signedinteger]) -> list[RationalPoint]:
    """Give the points as fractions."""
    return [(Fraction(x, w), Fraction(y, w), Fraction(z, w)) for x, y, z, w in homogeneous_meeting_points(planes, rows)]
