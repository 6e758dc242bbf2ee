"""Points in which planes meet, as fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import HalfSpaces

__all__ = ["RationalPoint", "meeting_points"]

RationalPoint = tuple[Fraction, Fraction, Fraction]


def meeting_points(planes: HalfSpaces, rows: NDArray[np.signedinteger]) -> list[RationalPoint]:
    """Give the common point of three planes each, (k, 3) rows, in lattice coordinates, by Cramer's rule."""
    used = np.unique(rows)
    exact = dict(zip(used.tolist(), planes.integer_planes(used), strict=True))
    points: list[RationalPoint] = []
    for three in rows.tolist():
        (a, b, c, s), (d, e, f, t), (g, h, i, u) = (exact[r] for r in three)
        # Cross products of two normals each; the point is their sum, weighted by the third offset.
        ux, uy, uz = e * i - f * h, f * g - d * i, d * h - e * g
        vx, vy, vz = h * c - i * b, i * a - g * c, g * b - h * a
        wx, wy, wz = b * f - c * e, c * d - a * f, a * e - b * d
        below = a * ux + b * uy + c * uz
        points.append(
            (
                Fraction(s * ux + t * vx + u * wx, below),
                Fraction(s * uy + t * vy + u * wy, below),
                Fraction(s * uz + t * vz + u * wz, below),
            )
        )
    return points
