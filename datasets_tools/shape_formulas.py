"""Surfaces by formula, as arrays: what `shape_families` builds its shapes from.

A surface is a pair `(vertices, faces)`: float64 (n, 3) and int64 (m, 3), corners counter-clockwise from outside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Points: TypeAlias = NDArray[np.float64]
Triangles: TypeAlias = NDArray[np.int64]
Surface: TypeAlias = tuple[Points, Triangles]

_MAX_LEVELS = 8


# ---------------------------------------------------------------- measures


def areas(surface: Surface) -> Points:
    """Compute the area of each triangle, (m,)."""
    a, b, c = (surface[0][surface[1][:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0


def enclosed_volume(surface: Surface) -> float:
    """Sum the signed tetrahedra over the triangles."""
    vertices = surface[0] - surface[0].mean(axis=0)
    a, b, c = (vertices[surface[1][:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def distance_inside(surface: Surface) -> float:
    """Smallest signed distance of the origin from the triangles' planes, positive where it is inside all."""
    a, b, c = (surface[0][surface[1][:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return float((np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)).min())


# ---------------------------------------------------------------- surfaces


@cache
def icosphere(levels: int) -> Surface:
    """Unit sphere: an icosahedron, each triangle split into four `levels` times; read-only arrays."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden)]
    corners += [(0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2)]
    faces += [(10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5)]
    faces += [(2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    surface = np.array(corners, dtype=np.float64), np.array(faces, dtype=np.int64)
    for level in range(levels + 1):
        if level:
            surface = subdivided(surface)
        surface = surface[0] / np.linalg.norm(surface[0], axis=1, keepdims=True), surface[1]
    for array in surface:
        array.flags.writeable = False
    return surface


def sphere_for(facets: int) -> Surface:
    """Icosphere with about so many triangles."""
    return icosphere(_levels(20, facets))


def prism(polygon: Sequence[Sequence[float]], height: float) -> Surface:
    """Prism over a simple counter-clockwise polygon, from z = 0 up."""
    from voxkernel import TriangleMesh

    n = len(polygon)
    vertices = np.array([(x, y, z) for z in (0.0, height) for x, y in polygon], dtype=np.float64)
    sides = [[i, (i + 1) % n, (i + 1) % n + n, i + n] for i in range(n)]
    return TriangleMesh.from_polygons(vertices, [list(range(n))[::-1], list(range(n, 2 * n)), *sides]).to_arrays()


def bipyramid(polygon: Sequence[Sequence[float]], height: float) -> Surface:
    """Join a polygon about the origin of the plane z = 0 to the points (0, 0, height) and (0, 0, -height)."""
    n = len(polygon)
    vertices = np.array([*((x, y, 0.0) for x, y in polygon), (0, 0, height), (0, 0, -height)], dtype=np.float64)
    here, there = np.arange(n), (np.arange(n) + 1) % n
    up = np.stack([here, there, np.full(n, n)], axis=1)
    return vertices, np.concatenate([up, np.stack([there, here, np.full(n, n + 1)], axis=1)])


def blocks(xs: Sequence[float], ys: Sequence[float], zs: Sequence[float], solid: Callable[..., NDArray]) -> Surface:
    """Boundary of a union of cells of a rectilinear grid; `solid` says of cell centres whether they are in it.

    The planes are exactly at the grid coordinates given. Solids that meet in an edge or a corner share it.
    """
    axes = [np.unique(np.asarray(axis, dtype=np.float64)) for axis in (xs, ys, zs)]
    centres = np.meshgrid(*((axis[1:] + axis[:-1]) / 2.0 for axis in axes), indexing="ij")
    inside = np.pad(np.broadcast_to(solid(*centres), centres[0].shape), 1)
    quads = []
    for axis in range(3):
        u, v = np.eye(3, dtype=np.int64)[(axis + 1) % 3], np.eye(3, dtype=np.int64)[(axis + 2) % 3]
        below = np.take(inside, np.arange(inside.shape[axis] - 1), axis=axis)
        above = np.take(inside, np.arange(1, inside.shape[axis]), axis=axis)
        for is_up, on in ((True, below & ~above), (False, above & ~below)):
            lower = np.argwhere(on) - 1
            lower[:, axis] += 1
            ring = (0 * u, u, u + v, v) if is_up else (0 * u, v, u + v, u)
            quads.append(lower[:, None, :] + np.array(ring))
    corners = np.concatenate(quads)
    ijk, ids = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    a, b, c, d = ids.reshape(-1, 4).T
    vertices = np.stack([axis[ijk[:, k]] for k, axis in enumerate(axes)], axis=1)
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def box(half: Sequence[float]) -> Surface:
    """Box about the origin with these half edges."""
    x, y, z = half
    return blocks((-x, x), (-y, y), (-z, z), lambda cx, cy, cz: np.ones(cx.shape, dtype=bool))


def bumped_box(half: Sequence[float], reach: float, height: float) -> tuple[Surface, NDArray[np.bool_]]:
    """Box with a square pyramid on its side +z, and which triangles are the pyramid's."""
    x, y, z = half
    outer = [(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)]
    inner = [(-reach, -reach, z), (reach, -reach, z), (reach, reach, z), (-reach, reach, z)]
    below = [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z)]
    vertices = np.array([*outer, *inner, *below, (0.0, 0.0, z + height)], dtype=np.float64)
    faces = [(8, 10, 9), (8, 11, 10)]
    for i in range(4):
        j = (i + 1) % 4
        faces += [(8 + i, 8 + j, j), (8 + i, j, i), (i, j, 4 + j), (i, 4 + j, 4 + i)]
    faces += [(4 + i, 4 + (i + 1) % 4, 12) for i in range(4)]
    return (vertices, np.array(faces, dtype=np.int64)), np.arange(len(faces)) >= len(faces) - 4


def torus(major: float, minor: float, n_major: int, n_minor: int) -> Surface:
    """Torus about the z axis."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n_major), np.arange(n_minor), indexing="ij"))
    a, b = 2.0 * np.pi * i / n_major, 2.0 * np.pi * j / n_minor
    out = major + minor * np.cos(b)
    right, up = (i + 1) % n_major * n_minor, (j + 1) % n_minor
    p, q, r, s = i * n_minor + j, right + j, right + up, i * n_minor + up
    vertices = np.stack([out * np.cos(a), out * np.sin(a), minor * np.sin(b)], axis=1)
    return vertices, np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)])


def graph(height: Callable[[Points, Points], Points], n: int, half: Sequence[float] = (1.0, 1.0)) -> Surface:
    """Open surface z = height(x, y) over a rectangle, 2 n^2 triangles, normals up."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    x, y = half[0] * (2.0 * i / n - 1.0), half[1] * (2.0 * j / n - 1.0)
    keep = (i < n) & (j < n)
    a = (i * (n + 1) + j)[keep]
    b = a + n + 1
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    return np.stack([x, y, height(x, y)], axis=1), faces


def joined(*parts: Surface) -> Surface:
    """Put several surfaces into one; no vertex is merged."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = [f + start for (_, f), start in zip(parts, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


# ---------------------------------------------------------------- the same surface, written or placed differently


def subdivided(surface: Surface) -> Surface:
    """Split each triangle into four at the middles of its edges."""
    vertices, faces = surface
    pairs, middle = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    ab, bc, ca = (len(vertices) + middle.reshape(-1, 3)).T
    a, b, c = faces.T
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return (
        np.concatenate([vertices, (vertices[pairs[:, 0]] + vertices[pairs[:, 1]]) / 2.0]),
        np.concatenate([np.stack(corners, axis=1) for corners in quarters]),
    )


def refined(surface: Surface, facets: int) -> Surface:
    """Subdivide towards a number of triangles; at least the surface itself."""
    for _ in range(_levels(len(surface[1]), facets)):
        surface = subdivided(surface)
    return surface


def _levels(start: int, facets: int) -> int:
    return int(np.clip(np.round(np.log(max(facets, 1) / start) / np.log(4.0)), 0, _MAX_LEVELS))


def shuffled(surface: Surface, rng: np.random.Generator) -> Surface:
    """Give the same triangles in another order, from other first corners, with renumbered vertices."""
    vertices, faces = surface
    order = rng.permutation(len(vertices))
    new_id = np.empty_like(order)
    new_id[order] = np.arange(len(order))
    faces = new_id[faces[rng.permutation(len(faces))]]
    first = rng.integers(0, 3, len(faces))
    return vertices[order], np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)


def split_facets(surface: Surface, rng: np.random.Generator, count: int) -> Surface:
    """Split some triangles into three at (a + b + 2 c) / 4, which is exact for short dyadic coordinates."""
    vertices, faces = surface
    chosen = rng.choice(len(faces), min(count, len(faces)), replace=False)
    a, b, c = faces[chosen].T
    new = len(vertices) + np.arange(len(chosen))
    parts = [np.delete(faces, chosen, axis=0), *(np.stack(t, 1) for t in ((a, b, new), (b, c, new), (c, a, new)))]
    return np.concatenate([vertices, (vertices[a] + vertices[b] + 2.0 * vertices[c]) / 4.0]), np.concatenate(parts)


def rotation(rng: np.random.Generator) -> Points:
    """Draw a rotation matrix, uniform."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def quarter_turn(rng: np.random.Generator) -> Points:
    """Draw one of the 24 turns of a cube: exact on every double."""
    turn = np.zeros((3, 3))
    turn[np.arange(3), rng.permutation(3)] = rng.choice((-1.0, 1.0), 3)
    if np.linalg.det(turn) < 0:
        turn[0] *= -1.0
    return turn


def mapped(surface: Surface, linear: Points, shift: Points) -> Surface:
    """Apply x -> linear x + shift."""
    return np.ascontiguousarray(surface[0] @ linear.T + shift), surface[1]
