"""How well a motion lays one surface on another, measured from triangles to triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._open3d import open3d, ray_scene
from voxkernel.mesh.surface_samples import spread_samples
from voxkernel.mesh.triangles import doubled_normals
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.search import inverse

__all__ = ["ScoredSurface", "surface_score"]

_SAMPLES = 2000
_FAR = 1e6  # times the size of the pair
_FACING = 0.5  # cosine between the normals of a point and of the triangle next to it


class ScoredSurface:
    """Samples of a surface and a search tree of its triangles, scaled to the size of the pair."""

    def __init__(self, surface: PreparedSurface, scale: float) -> None:
        self.corners = (surface.vertices / scale)[surface.faces]
        self.facet_normals = surface.facet_normals
        points, owners, self.areas = spread_samples(surface.vertices, surface.faces, _SAMPLES)
        self.points, self.normals = points / scale, surface.facet_normals[owners]
        self.scene: Any = ray_scene(surface.vertices / scale, surface.faces)

    def nearest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Give the distance from points to the triangles, and the triangle next to each; infinite where none is near.

        A motion of needles can send points so far away that single precision finds no triangle at all.
        """
        distances, ids = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
        near = np.flatnonzero((np.abs(points) < _FAR).all(axis=1))
        if len(near):
            points = points[near]
            found = self.scene.compute_closest_points(open3d().core.Tensor(points.astype(np.float32)))
            ids[near] = found["primitive_ids"].numpy()
            distances[near] = np.linalg.norm(points - _closest(points, self.corners[ids[near]]), axis=1)
        return distances, ids

    def distances_to(
        self, other: ScoredSurface, motion: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Distances of the moved samples from the other surface, and whether the two face the same way there."""
        distances, ids = other.nearest(self.points @ motion[:3, :3].T + motion[:3, 3])
        turned = self.normals @ motion[:3, :3].T
        return distances, np.einsum("ij,ij->i", turned, other.facet_normals[ids]) > _FACING

    def share_near(self, other: ScoredSurface, motion: NDArray[np.float64], reach: float) -> float:
        """Area mean of 1 - (d / reach)^2, 0 beyond reach or where the surfaces do not face the same way."""
        distances, faces_it = self.distances_to(other, motion)
        worth = np.where(faces_it & (distances < reach), 1.0 - (distances / reach) ** 2, 0.0)
        return float(self.areas @ worth / self.areas.sum())

    def fit(self, other: ScoredSurface, motion: NDArray[np.float64], reach: float) -> tuple[float, float]:
        """Share of the area within reach of the other surface, and the RMS distance of that share."""
        distances, _ = self.distances_to(other, motion)
        near = distances <= reach
        if not near.any():
            return 0.0, float("nan")
        inside = self.areas[near]
        return float(inside.sum() / self.areas.sum()), float(np.sqrt(inside @ distances[near] ** 2 / inside.sum()))


def surface_score(source: ScoredSurface, target: ScoredSurface, motion: NDArray[np.float64], reach: float) -> float:
    """Mean of the shares of both surfaces that lie near the other, facing the same way; 1 is a perfect fit."""
    return 0.5 * (source.share_near(target, motion, reach) + target.share_near(source, inverse(motion), reach))


def _closest(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Closest point of triangle i to point i, in double precision: Embree answers in single."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = doubled_normals(corners)
    square = np.einsum("ij,ij->i", normal, normal)
    offset = points - a
    safe = np.where(square > 0, square, 1.0)
    v = np.einsum("ij,ij->i", np.cross(offset, c - a), normal) / safe
    w = np.einsum("ij,ij->i", np.cross(b - a, offset), normal) / safe
    inside = (square > 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
    best = a + v[:, None] * (b - a) + w[:, None] * (c - a)
    least = np.where(inside, np.einsum("ij,ij->i", points - best, points - best), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = np.einsum("ij,ij->i", edge, edge)
        at = np.clip(np.einsum("ij,ij->i", points - start, edge) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        spot = start + at[:, None] * edge
        gap = np.einsum("ij,ij->i", points - spot, points - spot)
        nearer = gap < least
        best[nearer], least[nearer] = spot[nearer], gap[nearer]
    return best
