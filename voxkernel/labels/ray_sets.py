"""The directions of rays about a centre, as StarDist has them, and the triangles between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen

__all__ = ["RaySet", "golden_rays", "outward_faces", "ray_set"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RaySet(Frozen):
    """Rays in voxels along the axes: times a length in world units, a ray ends there."""

    steps: NDArray[np.float64]
    faces: NDArray[np.int64]


def golden_rays(n: int) -> NDArray[np.float64]:
    """Unit vectors on a golden spiral from one pole of the first axis to the other, as `Rays_GoldenSpiral`."""
    angle = (3.0 - np.sqrt(5.0)) * np.pi * np.arange(n)
    height = np.linspace(-1.0, 1.0, n)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([height, radius * np.sin(angle), radius * np.cos(angle)], axis=1)


def circle_rays(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sines and cosines of `n` equal angles: the same numbers in a mirror, and of half a right angle equal ones.

    Rounded one by one they would not be, and rays through corners of pixels would leave the diagonal somewhere.
    """
    quarter, rest = np.divmod(4 * np.arange(n), n)  # right angles, and n-th parts of one
    is_steep = 2 * rest > n
    angle = np.where(is_steep, n - rest, rest) * (np.pi / 2.0 / n)
    short, long = np.sin(angle), np.cos(angle)
    short, long = (np.where(2 * rest == n, np.sqrt(0.5), v) for v in (short, long))
    sine, cosine = np.where(is_steep, long, short), np.where(is_steep, short, long)
    signs = np.array([1.0, 1.0, -1.0, -1.0])
    turned = quarter % 2 == 1
    return (
        signs[quarter] * np.where(turned, cosine, sine) + 0.0,
        signs[(quarter + 1) % 4] * np.where(turned, sine, cosine) + 0.0,
    )


def outward_faces(directions: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles of the convex hull of directions, turned so that the origin is behind each."""
    from scipy.spatial import ConvexHull

    faces = ConvexHull(directions).simplices.astype(np.int64)
    faces = faces[np.lexsort(np.sort(faces, axis=1).T[::-1])]
    is_turned = np.linalg.det(directions[faces]) < 0.0
    faces[is_turned] = faces[is_turned][:, ::-1]
    return np.ascontiguousarray(faces)


@lru_cache(maxsize=64)
def ray_set(n: int, spacing: tuple[float, ...]) -> RaySet:
    """Rays that are evenly spread in the world; for two axes `n` equal angles, the first along the last axis."""
    if len(spacing) == 2:
        flat = np.stack([np.zeros(n), *circle_rays(n)], axis=1)
        return RaySet(steps=flat / np.array([1.0, *spacing]), faces=np.zeros((0, 3), np.int64))
    directions = golden_rays(n)
    return RaySet(steps=directions / np.array(spacing), faces=outward_faces(directions))
