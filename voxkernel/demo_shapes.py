"""Surfaces made by formula, one for each kind of kernel; `voxkernel demo` draws them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.edges import half_edges

__all__ = ["SHAPES", "DemoShape", "comet", "face", "gem", "s_prism", "star_prism", "torus", "urchin"]


def gem() -> TriangleMesh:
    """Return the truncated octahedron with corners (0, ±1, ±2) permuted: convex, volume 32."""
    signed = {(0, s, 2 * t) for s, t in product((-1, 1), repeat=2)}
    corners = np.array(sorted({tuple(p[i] for i in order) for p in signed for order in permutations(range(3))}))
    directions = [np.array(d) for d in product((-1, 1), repeat=3)]
    directions += [sign * axis for axis in np.eye(3, dtype=np.int64) for sign in (-1, 1)]
    rings = [_ring(corners, normal) for normal in directions]
    return TriangleMesh.from_polygons(corners.astype(np.float64), rings, source="gem")


def star_prism(points: int = 5, inner: float = 0.45, height: float = 0.5) -> TriangleMesh:
    """Return a prism over a star with the given number of points, outer radius 1."""
    angle = np.pi * (0.5 + np.arange(2 * points) / points)
    radius = np.where(np.arange(2 * points) % 2, inner, 1.0)
    return _prism(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), height, "star_prism")


def s_prism(slit: float = 0.0) -> TriangleMesh:
    """Return an S-shaped prism whose kernel is the box [1, 2] x [1 - slit, 1] x [0, 1]; flat for slit 0."""
    low = 1.0 - slit
    outline = [(0, 0), (2, 0), (2, low), (3, low), (3, 2), (1, 2), (1, 1), (0, 1)]
    return _prism(np.array(outline, dtype=np.float64), 1.0, "s_prism")


def urchin(subdivisions: int = 5, length: float = 0.75, sharpness: float = 55.0) -> TriangleMesh:
    """Return a ball with a rounded spike in each corner direction of an icosahedron: star-shaped from its centre."""
    directions, faces = _icosphere(subdivisions)
    axes, _ = _icosphere(0)
    towards = directions @ axes.T
    radius = 1.0 + length * np.exp(sharpness * (towards - 1.0)).sum(axis=1)
    return TriangleMesh.from_triangles(directions * radius[:, None], faces, source="urchin")


def face(hook: float = 0.0, rings: int = 44, sectors: int = 96) -> TriangleMesh:
    """Return an open, tilted, face-like surface; the nose hangs down by `hook` at its tip.

    Without a hook it is a height field: every point far enough behind it sees all of it.
    """
    r = (np.arange(1, rings + 1) / rings)[:, None]
    angle = 2.0 * np.pi * np.arange(sectors)[None, :] / sectors
    x = np.append(0.0, (0.78 * r * np.cos(angle)).ravel())
    y = np.append(0.0, (1.05 * r * np.sin(angle)).ravel())

    def bump(at: tuple[float, float], size: tuple[float, float]) -> NDArray[np.float64]:
        return np.exp(-(((x - at[0]) / size[0]) ** 2) - ((y - at[1]) / size[1]) ** 2)

    nose = bump((0.0, -0.08), (0.15, 0.17)) + 0.55 * bump((0.0, 0.14), (0.1, 0.2))
    z = 0.7 * np.sqrt(np.maximum(0.0, 1.25 - (x / 0.9) ** 2 - (y / 1.2) ** 2)) + 0.24 * nose
    for side in (-1.0, 1.0):
        z -= 0.1 * bump((0.32 * side, 0.24), (0.17, 0.1))
        z += 0.05 * bump((0.4 * side, -0.18), (0.2, 0.2))
    z += 0.055 * (bump((0.0, -0.42), (0.2, 0.045)) + bump((0.0, -0.53), (0.17, 0.05)))
    z += 0.07 * bump((0.0, -0.8), (0.2, 0.13))
    y = y - hook * bump((0.0, -0.1), (0.13, 0.13))
    points = np.column_stack([x, y, z]) @ _rotation((0.25, -0.35, 0.08)).T
    return TriangleMesh.from_triangles(points, _fan_and_strips(rings, sectors), source="face")


def torus(major: float = 1.0, minor: float = 0.38, n_major: int = 96, n_minor: int = 48) -> TriangleMesh:
    """Return a torus: no point sees all of it."""
    u, v = np.meshgrid(np.arange(n_major), np.arange(n_minor), indexing="ij")
    a, b = 2.0 * np.pi * u / n_major, 2.0 * np.pi * v / n_minor
    out = major + minor * np.cos(b)
    points = np.stack([out * np.cos(a), out * np.sin(a), minor * np.sin(b)], axis=-1).reshape(-1, 3)
    here, across = u * n_minor + v, (u + 1) % n_major * n_minor + v
    above, corner = u * n_minor + (v + 1) % n_minor, (u + 1) % n_major * n_minor + (v + 1) % n_minor
    faces = np.concatenate([np.stack([here, across, corner], -1), np.stack([here, corner, above], -1)])
    return TriangleMesh.from_triangles(points, faces.reshape(-1, 3), source="torus")


def comet(rings: int = 60, sectors: int = 64) -> TriangleMesh:
    """Return two lobes and the neck between them, on a bent axis: closed, not star-shaped."""
    t = np.arange(1, rings) / rings
    sweep = np.radians(200.0) * (t - 0.5)
    axis = np.stack([np.sin(sweep), np.cos(sweep), np.zeros_like(t)], axis=-1)
    radius = np.sqrt(np.sin(np.pi * t)) * (0.47 - 0.08 * t - 0.31 * np.exp(-(((t - 0.52) / 0.14) ** 2)))
    angle = 2.0 * np.pi * np.arange(sectors) / sectors
    outward = np.cos(angle)[None, :, None] * axis[:, None, :] - np.sin(angle)[None, :, None] * np.array([0.0, 0, 1])
    tube = (axis[:, None, :] + radius[:, None, None] * outward).reshape(-1, 3)
    ends = np.radians(100.0)
    tips = np.array([[-np.sin(ends), np.cos(ends), 0.0], [np.sin(ends), np.cos(ends), 0.0]])
    faces = _fan_and_strips(rings - 1, sectors)
    last = 1 + (rings - 2) * sectors
    around = np.arange(sectors)
    cap = np.column_stack([np.full(sectors, 1 + (rings - 1) * sectors), last + (around + 1) % sectors, last + around])
    return TriangleMesh.from_triangles(
        np.concatenate([tips[:1], tube, tips[1:]]), np.concatenate([faces, cap]), source="comet"
    )


class DemoShape(NamedTuple):
    """A surface made by formula, and what to look at."""

    name: str
    title: str
    what: str
    make: Callable[[], TriangleMesh]


SHAPES: tuple[DemoShape, ...] = (
    DemoShape("gem", "Gem", "Convex: every inner point sees the whole surface, the kernel is the shape.", gem),
    DemoShape("star", "Star prism", "One guard in the middle pentagon sees every wall.", star_prism),
    DemoShape("urchin", "Urchin", "Twelve spikes leave a small round kernel.", urchin),
    DemoShape("face", "Face", "Open: the kernel is unbounded and ends at the ball it is looked for in.", face),
    DemoShape("hooked", "Hooked nose", "The same face with an overhang.", lambda: face(hook=0.45)),
    DemoShape("slit", "Prism with a slit", "The kernel is a box one hundredth thick.", lambda: s_prism(slit=0.01)),
    DemoShape("flat", "Prism without a slit", "The kernel is a flat square: it has no volume.", s_prism),
    DemoShape("torus", "Torus", "No point is on the inner side of all four red facets.", torus),
    DemoShape("comet", "Comet", "Two lobes on a bent axis: no point sees both.", comet),
)


def _prism(outline: NDArray[np.float64], height: float, source: str) -> TriangleMesh:
    n = len(outline)
    bottom, top = (np.column_stack([outline, np.full(n, z)]) for z in (0.0, height))
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    polygons = [list(range(n))[::-1], list(range(n, 2 * n)), *sides]
    return TriangleMesh.from_polygons(np.concatenate([bottom, top]), polygons, source=source)


def _ring(corners: NDArray[np.int64], normal: NDArray[np.int64]) -> list[int]:
    """Give the corners furthest along a direction, counter-clockwise seen from there."""
    height = corners @ normal
    on = np.flatnonzero(height == height.max())
    flat = corners[on] - corners[on].mean(axis=0)
    across = np.cross(normal, flat[0])
    return on[np.argsort(np.arctan2(flat @ across / np.linalg.norm(normal), flat @ flat[0]))].tolist()


def _icosphere(subdivisions: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    golden = (1.0 + 5.0**0.5) / 2.0
    points = np.array([(0.0, s, t * golden) for s, t in product((-1.0, 1.0), repeat=2)])
    points = np.concatenate([np.roll(points, k, axis=1) for k in range(3)])
    edges = np.linalg.norm(points[:, None] - points[None], axis=-1) < 2.1
    np.fill_diagonal(edges, False)
    faces = np.array(
        [t for t in combinations(range(12), 3) if all(edges[a, b] for a, b in combinations(t, 2))]
    )
    inward = np.linalg.det(points[faces]) < 0.0
    faces[inward] = faces[inward, ::-1]
    points /= np.linalg.norm(points[0])
    for _ in range(subdivisions):
        edges = half_edges(faces, len(points))
        pairs = edges.ends(faces)
        ab, bc, ca = (len(points) + edges.numbers().reshape(-1, 3)).T
        a, b, c = faces.T
        faces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        new = points[pairs].sum(axis=1)
        points = np.concatenate([points, new / np.linalg.norm(new, axis=1, keepdims=True)])
    return points, faces


def _fan_and_strips(rings: int, sectors: int) -> NDArray[np.int64]:
    """Triangulate a pole (vertex 0) and the rings of vertices around it."""
    here = np.arange(sectors)
    there = (here + 1) % sectors
    parts = [np.column_stack([np.zeros(sectors, np.int64), 1 + here, 1 + there])]
    for i in range(rings - 1):
        a, b = 1 + i * sectors + here, 1 + i * sectors + there
        parts += [np.column_stack([a, a + sectors, b + sectors]), np.column_stack([a, b + sectors, b])]
    return np.concatenate(parts)


def _rotation(angles: tuple[float, float, float]) -> NDArray[np.float64]:
    """Turn about x, then y, then z, by radians."""
    turn = np.eye(3)
    for axis, angle in enumerate(angles):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3)
        one[i, i] = one[j, j] = np.cos(angle)
        one[i, j], one[j, i] = -np.sin(angle), np.sin(angle)
        turn = one @ turn
    return turn
