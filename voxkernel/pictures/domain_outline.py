"""Lines that show the domain where it cuts a kernel off."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.exact import KernelPolytope
from voxkernel.halfspaces import Domain

__all__ = ["domain_outline", "is_cut_by_domain"]

_CIRCLE = 96  # segments
_MOST = 3000  # edges of a hull; of finer ones only the sharp are drawn
_PRODUCTS = 1 << 20  # of a corner and a plane, held at a time
_FLAT, _SHARP = 1.0 - 1e-9, float(np.cos(np.radians(12.0)))


def is_cut_by_domain(kernel: Any, points: NDArray[np.float64]) -> bool:
    """Whether the kernel goes on beyond its domain; of voxels, whether one of them reaches its border."""
    domain = getattr(kernel, "domain", None)
    if domain is None or not len(points):
        return False
    if isinstance(kernel, KernelPolytope):
        return kernel.cut_by_domain
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]  # the first to reach a plane, and few
    step, near = max(1, _PRODUCTS // len(corners)), -1.5 * kernel.voxel_size
    return any(
        float((corners @ domain.normals[k : k + step].T - domain.offsets[k : k + step]).max()) > near
        for k in range(0, len(domain.offsets), step)
    )


def domain_outline(domain: Domain) -> NDArray[np.float64]:
    """Give (k, 2, 3) segments: three great circles of a ball, else the edges of the polytope."""
    if domain.kind == "ball":
        center = 0.5 * (domain.vertices.min(axis=0) + domain.vertices.max(axis=0))
        radius = float((domain.offsets - domain.normals @ center).mean())
        turn = np.linspace(0.0, 2.0 * np.pi, _CIRCLE + 1)
        flat = radius * np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
        circles = [center + np.roll(flat, k, axis=1) for k in range(3)]
        return np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in circles])
    from scipy.spatial import ConvexHull

    hull = ConvexHull(domain.vertices)
    normals = hull.equations[:, :3]
    # Of a simplex, neighbour k is across from corner k.
    own = np.repeat(np.arange(len(hull.simplices)), 3)
    other = hull.neighbors.ravel()
    ends = hull.simplices[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    bend = np.einsum("ij,ij->i", normals[own], normals[other])
    drawn = (own < other) & (bend < _FLAT)
    if drawn.sum() > _MOST:
        drawn &= bend < _SHARP
    return domain.vertices[ends[drawn]]
