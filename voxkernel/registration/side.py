"""One surface of a pair: samples of it, and where points are nearest to its triangles."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._open3d import open3d, ray_scene
from voxkernel.mesh.surface_samples import spread_samples
from voxkernel.mesh.triangles import doubled_normals
from voxkernel.registration.prepare import Skin

__all__ = ["Nearest", "Side"]

_FAR = 1e6  # times the size of the pair
_ON_EDGE = 1e-9  # of a triangle's own coordinates


class Nearest(NamedTuple):
    """Where points are nearest to a surface; infinitely far where single precision finds no triangle at all."""

    distances: NDArray[np.float64]
    spots: NDArray[np.float64]
    normals: NDArray[np.float64]
    on_rim: NDArray[np.bool_]


class Side:
    """Samples of a surface and a search tree of its triangles, scaled to the size of the pair."""

    def __init__(self, skin: Skin, scale: float, samples: int) -> None:
        self.vertices = skin.vertices / scale
        self.faces = skin.faces
        self.facet_normals = skin.normals
        points, owners, areas = spread_samples(skin.vertices, skin.faces, samples)
        self.points, self.normals = points / scale, skin.normals[owners]
        self.areas = areas / scale**2
        self.area = float(self.areas.sum())
        self._rim = skin.rim

    @cached_property
    def scene(self) -> Any:
        """Open3D's search tree."""
        return ray_scene(self.vertices, self.faces)

    def every(self, step: int) -> Side:
        """The same triangles with every `step`-th sample."""
        if step <= 1:
            return self
        few = copy(self)
        few.scene = self.scene
        few.points, few.normals = self.points[::step], self.normals[::step]
        few.areas = self.areas[::step] * (self.area / float(self.areas[::step].sum()))
        return few

    def nearest(self, points: NDArray[np.float64]) -> Nearest:
        """Find the nearest triangle in single precision and the nearest point of it in double."""
        count = len(points)
        distances, spots = np.full(count, np.inf), points.copy()
        normals, on_rim = np.zeros((count, 3)), np.zeros(count, bool)
        near = np.flatnonzero((np.abs(points) < _FAR).all(axis=1))
        if len(near):
            inside = points[near]
            found = self.scene.compute_closest_points(open3d().core.Tensor(inside.astype(np.float32)))
            ids = found["primitive_ids"].numpy().astype(np.int64)
            faces = self.faces[ids]
            best, shares = _closest(inside, self.vertices[faces])
            spots[near], normals[near] = best, self.facet_normals[ids]
            distances[near] = np.linalg.norm(inside - best, axis=1)
            on_rim[near] = _on_rim(shares, self._rim.edges[ids], self._rim.vertices[faces])
        return Nearest(distances, spots, normals, on_rim)


def _on_rim(
    shares: NDArray[np.float64], edges: NDArray[np.bool_], corners: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether a point with these barycentric shares lies on an edge or corner of the rim."""
    zero = shares <= _ON_EDGE
    at_corner = zero.sum(axis=1) >= 2
    on_edge = (zero & edges).any(axis=1)
    return np.where(at_corner, (corners & ~zero).any(axis=1), on_edge)


def _closest(
    points: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Closest point of triangle i to point i, and its barycentric shares."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = doubled_normals(corners)
    square = np.einsum("ij,ij->i", normal, normal)
    offset = points - a
    safe = np.where(square > 0, square, 1.0)
    v = np.einsum("ij,ij->i", np.cross(offset, c - a), normal) / safe
    w = np.einsum("ij,ij->i", np.cross(b - a, offset), normal) / safe
    shares = np.column_stack([1.0 - v - w, v, w])
    outside = np.flatnonzero(~((square > 0) & (shares >= 0).all(axis=1)))
    if len(outside):
        p, own = points[outside], corners[outside]
        least, rim_shares = np.full(len(outside), np.inf), np.zeros((len(outside), 3))
        for first in range(3):
            second = (first + 1) % 3
            start, edge = own[:, first], own[:, second] - own[:, first]
            length = np.einsum("ij,ij->i", edge, edge)
            at = np.einsum("ij,ij->i", p - start, edge) / np.where(length > 0, length, 1.0)
            at = np.clip(at, 0.0, 1.0)
            spot = start + at[:, None] * edge
            gap = np.einsum("ij,ij->i", p - spot, p - spot)
            nearer = gap < least
            least[nearer] = gap[nearer]
            rim_shares[nearer] = 0.0
            rim_shares[nearer, first], rim_shares[nearer, second] = 1.0 - at[nearer], at[nearer]
        shares[outside] = rim_shares
    return np.einsum("ij,ijk->ik", shares, corners), shares
