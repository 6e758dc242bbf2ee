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
from voxkernel.registration.rounding import on_grid

__all__ = ["Nearest", "Side"]

_FAR = 1e6  # times the size of the pair
_ON_EDGE = 1e-9  # of a triangle's own coordinates


class Nearest(NamedTuple):
    """Where points are nearest to a surface; infinitely far where single precision finds no triangle at all."""

    distances: NDArray[np.float64]
    spots: NDArray[np.float64]
    normals: NDArray[np.float64]
    on_rim: NDArray[np.bool_]


class Triangles(NamedTuple):
    """Corners, the vectors whose products with p - a are the shares of b and c, and whether there is an area."""

    corners: NDArray[np.float64]
    along_b: NDArray[np.float64]
    along_c: NDArray[np.float64]
    solid: NDArray[np.bool_]

    def at(self, ids: NDArray[np.int64]) -> Triangles:
        """Some of them."""
        return Triangles(self.corners[ids], self.along_b[ids], self.along_c[ids], self.solid[ids])


def _weights(areas: NDArray[np.float64], scale: float, samples: int) -> NDArray[np.float64]:
    """Give areas in units of the square of the scale.

    Those of a needle are far below it, so they are rounded among each other, and their sum as far as it has digits.
    Without any area all samples count alike.
    """
    total = float(areas.sum())
    if not total > 0.0:
        return np.full(len(areas), 1.0 / samples)
    mantissa, exponent = np.frexp(total / scale / scale)
    return on_grid(areas / (total / samples)) / samples * float(np.ldexp(on_grid(mantissa), exponent))


class Side:
    """Samples of a surface and a search tree of its triangles, scaled to the size of the pair.

    The samples may also be given: points, normals and the areas they stand for.
    """

    def __init__(
        self, skin: Skin, scale: float, samples: int,
        given: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None = None,
    ) -> None:  # fmt: skip
        self.vertices = on_grid(skin.vertices / scale)
        self.faces = skin.faces
        self.facet_normals = on_grid(skin.normals)
        if given is None:
            points, owners, areas = spread_samples(skin.vertices, skin.faces, samples)
            normals = self.facet_normals[owners]
        else:
            points, normals, areas = given[0], on_grid(given[1]), given[2]
        self.points, self.normals = on_grid(points / scale), normals
        self.areas = _weights(areas, scale, samples)
        self.area = float(self.areas.sum())
        self._rim = skin.rim

    @cached_property
    def scene(self) -> Any:
        """Open3D's search tree."""
        return ray_scene(self.vertices, self.faces)

    @cached_property
    def triangles(self) -> Triangles:
        """Corners and what barycentric shares are computed from."""
        corners = self.vertices[self.faces]
        normal = doubled_normals(corners)
        square = np.einsum("ij,ij->i", normal, normal)
        normal /= np.where(square > 0, square, 1.0)[:, None]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        return Triangles(corners, np.cross(c - a, normal), np.cross(normal, b - a), square > 0)

    def every(self, step: int) -> Side:
        """The same triangles with every `step`-th sample."""
        if step <= 1:
            return self
        few = copy(self)
        few.scene, few.triangles = self.scene, self.triangles
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
            best, shares = _closest(inside, self.triangles.at(ids))
            spots[near], normals[near] = best, self.facet_normals[ids]
            distances[near] = np.linalg.norm(inside - best, axis=1)
            on_rim[near] = _on_rim(shares, self._rim.edges[ids], self._rim.vertices[self.faces[ids]])
        return Nearest(distances, spots, normals, on_rim)


def _on_rim(
    shares: NDArray[np.float64], edges: NDArray[np.bool_], corners: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether a point with these barycentric shares lies on an edge or corner of the rim."""
    zero = shares <= _ON_EDGE
    at_corner = zero.sum(axis=1) >= 2
    on_edge = (zero & edges).any(axis=1)
    return np.where(at_corner, (corners & ~zero).any(axis=1), on_edge)


def _closest(points: NDArray[np.float64], near: Triangles) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Closest point of triangle i to point i, and its barycentric shares."""
    corners = near.corners
    offset = points - corners[:, 0]
    v = np.einsum("ij,ij->i", offset, near.along_b)
    w = np.einsum("ij,ij->i", offset, near.along_c)
    shares = np.column_stack([1.0 - v - w, v, w])
    outside = np.flatnonzero(~(near.solid & (shares >= 0).all(axis=1)))
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
