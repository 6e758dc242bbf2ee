"""The solid angle under which a point sees a surface, from its facets and from its boundary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import boundary_field, cone_angle, cone_angles, triangle_angles
from voxkernel._frozen import Frozen
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.edges import half_edges
from voxkernel.mesh.triangles import doubled_normals

__all__ = ["FULL_ANGLE", "Boundary", "agrees_with_boundary", "facet_sides", "solid_angles"]

FULL_ANGLE = 4.0 * np.pi


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Boundary(Frozen):
    """The boundary of a surface as directed edges, an edge for each time it is traversed one way too often."""

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    apex: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Boundary:
        """Collect the edges whose two directions do not balance; inner edges cancel."""
        edges = half_edges(mesh.faces, len(mesh.vertices))
        low, high = edges.ends(mesh.faces).T
        excess = np.add.reduceat(np.where(edges.forward, 1, -1), edges.first)
        excess[low == high] = 0
        times = np.abs(excess)
        forward = np.repeat(excess > 0, times)
        low, high = np.repeat(low, times), np.repeat(high, times)
        starts = mesh.vertices[np.where(forward, low, high)]
        ends = mesh.vertices[np.where(forward, high, low)]
        return cls(starts, ends, _outer_apex(mesh))

    def __len__(self) -> int:
        """Return the number of edges."""
        return len(self.starts)

    def derivatives(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gradient and Hessian of the solid angle at x: they depend on the boundary only."""
        gradient, hessian = np.empty(3), np.empty((3, 3))
        boundary_field(self.starts, self.ends, x, gradient, hessian)
        return gradient, hessian

    def angle(self, x: NDArray[np.float64]) -> float:
        """Solid angle at x between 0 and 4 pi, right up to multiples of 4 pi."""
        return _wrapped(cone_angle(self.starts, self.ends, self.apex, x))

    def angles(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """`angle` of many points."""
        values = np.empty(len(points))
        cone_angles(self.starts, self.ends, self.apex, points, values)
        return _wrapped(values)

    def distance(self, x: NDArray[np.float64]) -> float:
        """Distance of a point from the boundary curve."""
        along, to = self.ends - self.starts, x - self.starts
        length = np.maximum((along * along).sum(axis=1), 1e-300)
        place = np.clip((to * along).sum(axis=1) / length, 0.0, 1.0)
        return float(np.linalg.norm(to - place[:, None] * along, axis=1).min())

    def field(self, x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Solid angle and gradient."""
        return self.angle(x), self.derivatives(x)[0]


def _wrapped(angle: Any) -> Any:
    """Into [0, 4 pi), but rounding below 0 stays near 0."""
    return np.mod(angle + 1e-9, FULL_ANGLE) - 1e-9


def _outer_apex(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Choose a point in front of a facet, so outside the kernel, on the side the surface faces most."""
    corners = mesh.vertices[mesh.faces]
    doubled = doubled_normals(corners)
    facing = doubled.sum(axis=0)
    towards = doubled @ (facing if facing.any() else doubled[0])
    best = int(np.argmax(towards))
    length = float(np.linalg.norm(doubled[best]))
    size = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    normal = doubled[best] / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return corners[best].mean(axis=0) + size * normal


def agrees_with_boundary(
    mesh: TriangleMesh, boundary: Boundary, center: NDArray[np.float64], *, tolerance: float = 1e-9
) -> bool:
    """Whether the triangles add up to what the boundary says: they do not at a centre too near to them."""
    total = solid_angles(mesh, center, np.ones(len(mesh.faces), np.int8))[1]
    off = (total - boundary.angle(center)) / FULL_ANGLE
    return abs(off - round(off)) * FULL_ANGLE < tolerance


def facet_sides(mesh: TriangleMesh, halfspaces: HalfSpaces, violated: NDArray[np.int64]) -> NDArray[np.int8]:
    """Say of each triangle on which side of it a centre lies: 1 inner, -1 outer, 0 no area, 2 for floats to find.

    `violated` are the half-spaces the centre is strictly outside of. Facets with several planes (polygons
    that are not planar) are left to floating point.
    """
    of_facet = np.zeros(mesh.n_input_facets, np.int8)
    of_facet[halfspaces.facet_ids] = 1
    of_facet[halfspaces.facet_ids[violated]] = -1
    of_facet[mesh.nonplanar_facets] = 2
    return of_facet[mesh.facet_ids]


def solid_angles(
    mesh: TriangleMesh, center: NDArray[np.float64], side: NDArray[np.int8]
) -> tuple[NDArray[np.float64], float, float]:
    """Signed solid angle of each triangle, their sum, and the sum of their sizes; steradian."""
    angles = np.empty(len(mesh.faces))
    total, size = triangle_angles(mesh.vertices, mesh.faces, center, side, angles)
    return angles, total, size
