"""Solids and surfaces by formula, with their kernels where these can be written down.

A mesh is a pair `(vertices, faces)`: float64 (n, 3) and int64 (m, 3), corners counter-clockwise from outside.
A polygonal mesh is `(vertices, polygons)` with a list of index tuples. Where a kernel is stated, coordinates
are small integers or dyadic fractions, so that it is the kernel of the doubles and not of a rounded shape.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations, product
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from numpy.typing import NDArray

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]
PolygonMesh = tuple[NDArray[np.float64], list[tuple[int, ...]]]
Polygon = Sequence[tuple[float, float]]
Field = Callable[..., NDArray[np.float64]]


@dataclass(frozen=True)
class KnownKernel:
    """What is known by hand about a kernel. `volume` is that of the kernel; infinite when it is unbounded."""

    dimension: int
    volume: float
    centroid: tuple[float, float, float] | None = None
    bounded: bool = True


def mesh(vertices: Any, faces: Any) -> Mesh:
    return (
        np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3),
        np.ascontiguousarray(faces, dtype=np.int64).reshape(-1, 3),
    )


# ---------------------------------------------------------------- polygons, prisms, cubes


def _side(p: Any, q: Any, r: Any) -> int:
    """Sign of the turn p, q, r in the plane, exact on doubles."""
    (px, py), (qx, qy), (rx, ry) = (tuple(map(Fraction, map(float, point))) for point in (p, q, r))
    value = (qx - px) * (ry - py) - (qy - py) * (rx - px)
    return (value > 0) - (value < 0)


def triangulated(polygon: Polygon) -> list[tuple[int, int, int]]:
    """Ear clipping of a simple counter-clockwise polygon; every sign is exact."""
    left = list(range(len(polygon)))
    triangles = []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            p, q, r = polygon[a], polygon[b], polygon[c]
            if _side(p, q, r) <= 0:
                continue
            inside = (
                _side(p, q, polygon[i]) >= 0 and _side(q, r, polygon[i]) >= 0 and _side(r, p, polygon[i]) >= 0
                for i in left
                if i not in (a, b, c) and polygon[i] not in (p, q, r)
            )
            if not any(inside):
                triangles.append((a, b, c))
                left.pop(k)
                break
        else:
            raise ValueError("polygon is not simple or not counter-clockwise")
    if _side(*(polygon[i] for i in left)) <= 0:
        raise ValueError("polygon is not simple or not counter-clockwise")
    return [*triangles, (left[0], left[1], left[2])]


def prism_polygons(polygon: Polygon, bottom: float = 0.0, top: float = 1.0) -> PolygonMesh:
    """Prism over a simple counter-clockwise polygon: one polygon per side, bottom and top."""
    n = len(polygon)
    vertices = np.array([(x, y, z) for z in (bottom, top) for x, y in polygon], dtype=np.float64)
    sides = [(i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n)]
    return vertices, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides]


def prism(polygon: Polygon, bottom: float = 0.0, top: float = 1.0) -> Mesh:
    """Prism over a simple counter-clockwise polygon, in triangles."""
    n = len(polygon)
    vertices, polygons = prism_polygons(polygon, bottom, top)
    caps = triangulated(polygon)
    faces = [(c, b, a) for a, b, c in caps] + [(a + n, b + n, c + n) for a, b, c in caps]
    for a, b, c, d in polygons[2:]:
        faces += [(a, b, c), (a, c, d)]
    return mesh(vertices, faces)


def fan(vertices: NDArray[np.float64], polygons: Iterable[Sequence[int]]) -> Mesh:
    """Triangles of *convex* polygons, fanned from the first corner of each."""
    return mesh(vertices, [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)])


def box(lower: Sequence[float] = (0, 0, 0), upper: Sequence[float] = (1, 1, 1)) -> Mesh:
    """Axis-parallel box; faces 2k and 2k + 1 are the two triangles of one side: -z, +z, -y, +x, +y, -x."""
    (x0, y0, z0), (x1, y1, z1) = lower, upper
    return fan(*prism_polygons([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1))


def cube() -> Mesh:
    return box()


# CUBE: convex, so the kernel is the cube.
CUBE = KnownKernel(3, 1.0, (0.5, 0.5, 0.5))


def tetrahedron() -> Mesh:
    return mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


# TETRAHEDRON: convex; a corner of the unit cube, volume 1/6, centroid the mean of the corners.
TETRAHEDRON = KnownKernel(3, 1 / 6, (0.25, 0.25, 0.25))


def octahedron() -> Mesh:
    vertices = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = []
    for x, y, z in product((0, 1), (2, 3), (4, 5)):
        faces.append((x, y, z) if (x + y + z) % 2 == 0 else (x, z, y))
    return mesh(vertices, faces)


# OCTAHEDRON: convex; eight corners of volume 1/6.
OCTAHEDRON = KnownKernel(3, 4 / 3, (0.0, 0.0, 0.0))


def l_prism() -> Mesh:
    return prism([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])


# L_PRISM: the sides at the inner corner (1, 1) ask for x <= 1 and y <= 1: the unit cube at the origin.
L_PRISM = KnownKernel(3, 1.0, (0.5, 0.5, 0.5))


def star_prism() -> Mesh:
    """Prism of height 1 over a star with four points at distance 3 and inner corners (+-1, +-1)."""
    return prism([(3, 0), (1, 1), (0, 3), (-1, 1), (-3, 0), (-1, -1), (0, -3), (1, -1)])


# STAR_PRISM: the edges lie on |x| + 2|y| = 3 and 2|x| + |y| = 3; their octagon has corners (+-1, +-1),
# (+-1.5, 0) and (0, +-1.5), a quarter of it (0, 0), (1.5, 0), (1, 1), (0, 1.5) has area 1.5.
STAR_PRISM = KnownKernel(3, 6.0, (0.0, 0.0, 0.5))


def voxel_surface(cells: Iterable[Sequence[int]]) -> Mesh:
    """Boundary of a union of unit cubes given by their lower corners; may touch itself along edges."""
    solid = {tuple(int(i) for i in cell) for cell in cells}
    unit, quads = cube()[0], prism_polygons([(0, 0), (1, 0), (1, 1), (0, 1)])[1]
    index: dict[tuple[int, ...], int] = {}
    faces = []
    for cell in sorted(solid):
        for quad in quads:
            corners = [tuple(int(cell[k] + unit[i][k]) for k in range(3)) for i in quad]
            middle2 = [sum(corner[k] for corner in corners) / 2 for k in range(3)]
            neighbour = tuple(int(middle2[k] - 1 - cell[k]) for k in range(3))
            if neighbour in solid:
                continue
            a, b, c, d = (index.setdefault(corner, len(index)) for corner in corners)
            faces += [(a, b, c), (a, c, d)]
    return mesh(list(index), faces)


def plus_cross() -> Mesh:
    """Seven unit cubes: one in the middle, one on each of its sides."""
    return voxel_surface([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])


# PLUS_CROSS: the arms along x ask for 0 <= y, z <= 1, and so on: the cube in the middle.
PLUS_CROSS = KnownKernel(3, 1.0, (0.5, 0.5, 0.5))


def s_tetromino(slit: float = 0.0) -> Mesh:
    """Prism over an S of four squares whose two inner shelves are at y = 0 and at y = `slit`, |slit| < 1.

    The right half's floor (2, 0)-(3, 0) asks for y >= 0, the left half's ceiling (1, slit)-(0, slit) for
    y <= slit, the walls at x = 1 and x = 2 for 1 <= x <= 2. Nothing is added or rounded: the kernel is as
    thick as the double `slit`.
    """
    return prism([(0, -1), (2, -1), (2, 0), (3, 0), (3, 1), (1, 1), (1, slit), (0, slit)])


def s_tetromino_kernel(slit: float) -> KnownKernel:
    """[1, 2] x [0, slit] x [0, 1]."""
    if slit < 0:
        return KnownKernel(-1, 0.0)
    return KnownKernel(3 if slit > 0 else 2, slit, (1.5, slit / 2, 0.5))


def saw_prism() -> Mesh:
    """Prism over a saw blade with four teeth whose radial edges all lie on the axes."""
    return prism([(1, 0), (0, 2), (0, 1), (-2, 0), (-1, 0), (0, -2), (0, -1), (2, 0)])


# SAW_PRISM: the radial edges ask for y <= 0, x >= 0, y >= 0 and x <= 0; the others have the origin inside.
SAW_PRISM = KnownKernel(1, 0.0, (0.0, 0.0, 0.5))


def notched_cube_polygons(slit: float = 0.0) -> PolygonMesh:
    """The cube [-1, 1]^3 without [slit, 1]^3 and without [-1, 0]^3: six L-shaped sides, six squares.

    With no slit the two inner corners are one vertex, the origin: the surface touches itself there.
    """
    e = slit
    sides = [  # the four with normals +-x; (y, z) counter-clockwise for +x
        [(1, 1, -1), (1, 1, e), (1, e, e), (1, e, 1), (1, -1, 1), (1, -1, -1)],
        [(e, 1, 1), (e, e, 1), (e, e, e), (e, 1, e)],
        [(-1, 1, 1), (-1, 1, -1), (-1, 0, -1), (-1, 0, 0), (-1, -1, 0), (-1, -1, 1)],
        [(0, -1, -1), (0, -1, 0), (0, 0, 0), (0, 0, -1)],
    ]
    corner: dict[tuple[float, ...], int] = {}
    polygons = []
    for turn in range(3):  # cyclic permutations of the axes keep the orientation
        for side in sides:
            points = [tuple(p[(k - turn) % 3] for k in range(3)) for p in side]
            polygons.append(tuple(corner.setdefault(point, len(corner)) for point in points))
    return np.array(list(corner), dtype=np.float64), polygons


def notched_cube(slit: float = 0.0) -> Mesh:
    """`notched_cube_polygons` in triangles."""
    vertices, polygons = notched_cube_polygons(slit)
    faces = []
    for polygon in polygons:
        points = vertices[list(polygon)]
        normal = np.sum([np.cross(points[i - 1], points[i]) for i in range(len(points))], axis=0)
        axis = int(np.argmax(np.abs(normal)))
        u, v = ((axis + 1) % 3, (axis + 2) % 3) if normal[axis] > 0 else ((axis + 2) % 3, (axis + 1) % 3)
        flat = [(p[u], p[v]) for p in points]
        faces += [tuple(polygon[i] for i in triangle) for triangle in triangulated(flat)]
    return mesh(vertices, faces)


def notched_cube_kernel(slit: float) -> KnownKernel:
    """The one notch asks for x, y, z <= slit, the other for x, y, z >= 0: the cube [0, slit]^3."""
    if slit < 0:
        return KnownKernel(-1, 0.0)
    return KnownKernel(3 if slit > 0 else 0, slit**3, (slit / 2,) * 3)


def two_boxes() -> Mesh:
    """Two disjoint unit cubes."""
    return joined(cube(), box((3, 0, 0), (4, 1, 1)))


# TWO_BOXES: x <= 1 and x >= 3.
TWO_BOXES = KnownKernel(-1, 0.0)


def crossing_boxes() -> Mesh:
    """Two boxes through each other, not united."""
    return joined(box((0, 0, 0), (3, 1, 1)), box((1, -1, 0), (3, 2, 1)))


# CROSSING_BOXES: each asks for itself, so the kernel is what they share, [1, 3] x [0, 1] x [0, 1].
CROSSING_BOXES = KnownKernel(3, 2.0, (2.0, 0.5, 0.5))


def joined(*parts: Mesh) -> Mesh:
    """Several meshes as one; no vertex is merged."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    return mesh(
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)]),
    )


def truncated_octahedron() -> PolygonMesh:
    """Polyhedral cell: the permutations of (0, +-1, +-2); six squares, eight hexagons, exactly planar."""
    points = sorted({point for a, b in product((1, -1), (2, -2)) for point in permutations((0, a, b))})
    normals = [n for n in product((-1, 0, 1), repeat=3) if sum(map(abs, n)) in (1, 3)]
    polygons = []
    for normal in normals:
        level = 2 if sum(map(abs, normal)) == 1 else 3
        ids = [i for i, p in enumerate(points) if sum(map(int.__mul__, normal, p)) == level]
        middle = np.mean([points[i] for i in ids], axis=0)
        u = np.array(points[ids[0]]) - middle
        frame = np.stack([np.cross(normal, u), u])
        ids.sort(key=lambda i, m=middle, f=frame: np.arctan2(*(f @ (np.array(points[i]) - m))))
        polygons.append(tuple(ids))
    return np.array(points, dtype=np.float64), polygons


# TRUNCATED_OCTAHEDRON: convex, edge a = sqrt(2), volume 8 sqrt(2) a^3 = 32.
TRUNCATED_OCTAHEDRON = KnownKernel(3, 32.0, (0.0, 0.0, 0.0))


# ---------------------------------------------------------------- round shapes


def icosphere(subdivisions: int = 2) -> Mesh:
    """Unit sphere from an icosahedron; convex, and the origin is strictly inside all planes."""
    g = (1 + 5**0.5) / 2
    corners = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2)]
    faces += [(10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5)]
    faces += [(2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    surface = mesh(corners, faces)
    for _ in range(subdivisions):
        surface = subdivided(*surface)
        surface = (surface[0] / np.linalg.norm(surface[0], axis=1, keepdims=True), surface[1])
    return surface[0] / np.linalg.norm(surface[0], axis=1, keepdims=True), surface[1]


def two_fans(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of n corners 1 ... n in a ring, with vertex 0 above and vertex n + 1 below: together closed."""
    ring = np.arange(1, n + 1)
    above = np.column_stack([np.zeros(n, np.int64), ring, np.roll(ring, -1)])
    return above, np.column_stack([np.full(n, n + 1), np.roll(ring, -1), ring])


def parallels(theta: NDArray[np.float64], n_sectors: int) -> NDArray[np.float64]:
    """Points of the unit sphere at angles from the z axis, a ring of `n_sectors` for each."""
    phi = 2 * np.pi * np.arange(n_sectors) / n_sectors
    return np.stack(
        [np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi)),
         np.outer(np.cos(theta), np.ones(n_sectors))], axis=-1,
    ).reshape(-1, 3)  # fmt: skip


def uv_sphere(n_rings: int = 8, n_sectors: int = 12) -> Mesh:
    """Unit sphere with poles on the z axis. Its quads are planar only up to rounding."""
    theta = np.pi * np.arange(1, n_rings) / n_rings
    ring = parallels(theta, n_sectors)
    vertices = np.concatenate([[(0, 0, 1)], ring, [(0, 0, -1)]])
    last = len(vertices) - 1
    faces = []
    for j in range(n_sectors):
        k = (j + 1) % n_sectors
        faces.append((0, 1 + j, 1 + k))
        faces.append((last, last - n_sectors + k, last - n_sectors + j))
        for i in range(n_rings - 2):
            a, b = 1 + i * n_sectors + j, 1 + i * n_sectors + k
            faces += [(a, a + n_sectors, b + n_sectors), (a, b + n_sectors, b)]
    return mesh(vertices, faces)


def ellipsoid(half_axes: Sequence[float] = (3, 2, 1), subdivisions: int = 2) -> Mesh:
    vertices, faces = icosphere(subdivisions)
    return vertices * np.asarray(half_axes, dtype=np.float64), faces


def spiky(subdivisions: int = 2, radius: Field | None = None) -> Mesh:
    """Radial surface r(direction) * direction on an icosphere; star-shaped from the origin if r > 0."""
    directions, faces = icosphere(subdivisions)
    if radius is None:
        x, y, z = directions.T
        r = 1 + 0.6 * np.sin(5 * x) * np.cos(4 * y) * np.sin(3 * z + 1)
    else:
        r = radius(directions)
    return directions * r[:, None], faces


def torus(major: float = 2.0, minor: float = 0.5, n_major: int = 24, n_minor: int = 12) -> Mesh:
    u, v = np.meshgrid(np.arange(n_major), np.arange(n_minor), indexing="ij")
    a, b = 2 * np.pi * u / n_major, 2 * np.pi * v / n_minor
    out = major + minor * np.cos(b)
    vertices = np.stack([out * np.cos(a), out * np.sin(a), minor * np.sin(b)], axis=-1).reshape(-1, 3)
    faces = []
    for i, j in product(range(n_major), range(n_minor)):
        p, q = i * n_minor + j, (i + 1) % n_major * n_minor + j
        r, s = (i + 1) % n_major * n_minor + (j + 1) % n_minor, i * n_minor + (j + 1) % n_minor
        faces += [(p, q, r), (p, r, s)]
    return mesh(vertices, faces)


# TORUS: opposite inner facets face each other: x >= c and x <= -c for a c > 0.
TORUS = KnownKernel(-1, 0.0)


# ---------------------------------------------------------------- open, non-manifold, badly oriented


def height_field(height: Field | None = None, n: int = 8) -> Mesh:
    """Graph z = height(x, y) over [-1, 1]^2, normals up; every point far enough below sees all of it."""
    axis = np.linspace(-1, 1, n + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    z = 0.25 * (np.cos(3 * x) + np.sin(2 * y) * x) if height is None else height(x, y)
    faces = []
    for i, j in product(range(n), repeat=2):
        a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
        faces += [(a, b, b + 1), (a, b + 1, a + 1)]
    return mesh(np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1).reshape(-1, 3), faces)


# HEIGHT_FIELD: z <= every facet's plane; downward rays stay inside.
HEIGHT_FIELD = KnownKernel(3, np.inf, bounded=False)


def open_hemisphere(n_rings: int = 8, n_sectors: int = 16) -> Mesh:
    """Upper half of the uv sphere (an even number of rings), no base."""
    vertices, faces = uv_sphere(n_rings, n_sectors)
    n = 1 + n_rings // 2 * n_sectors
    return vertices[:n], faces[(faces < n).all(axis=1)]


# OPEN_HEMISPHERE: all normals point up or level, so downward rays stay inside.
OPEN_HEMISPHERE = KnownKernel(3, np.inf, bounded=False)


def open_box() -> Mesh:
    """Unit cube without its lid z = 1."""
    vertices, faces = cube()
    return vertices, np.ascontiguousarray(np.delete(faces, (2, 3), axis=0))


# OPEN_BOX: [0, 1] x [0, 1] x [0, inf).
OPEN_BOX = KnownKernel(3, np.inf, bounded=False)


def cubes_sharing_an_edge() -> Mesh:
    """[0, 1]^3 and [1, 2]^2 x [0, 1]: four faces meet in the edge x = y = 1."""
    return voxel_surface([(0, 0, 0), (1, 1, 0)])


# CUBES_SHARING_AN_EDGE: x <= 1, x >= 1, y <= 1, y >= 1 and 0 <= z <= 1.
CUBES_SHARING_AN_EDGE = KnownKernel(1, 0.0, (1.0, 1.0, 0.5))


def three_faces_on_an_edge() -> Mesh:
    """Three triangles around the edge (0, 0, 0)-(0, 0, 1)."""
    return mesh([(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, -1, 0)], [(0, 1, 2), (0, 1, 3), (0, 1, 4)])


# THREE_FACES_ON_AN_EDGE: y <= 0, x >= 0 and y >= x: the z axis, a whole line.
THREE_FACES_ON_AN_EDGE = KnownKernel(1, 0.0, bounded=False)


def cube_with_flipped_face() -> Mesh:
    """Unit cube, one of the two triangles of the side z = 1 turned over."""
    vertices, faces = cube()
    faces = faces.copy()
    faces[2] = faces[2, ::-1]
    return vertices, faces


# CUBE_WITH_FLIPPED_FACE: z <= 1 and z >= 1: the side itself.
CUBE_WITH_FLIPPED_FACE = KnownKernel(2, 0.0, (0.5, 0.5, 1.0))


def inside_out_cube() -> Mesh:
    vertices, faces = cube()
    return vertices, np.ascontiguousarray(faces[:, ::-1])


# INSIDE_OUT_CUBE: x <= 0 and x >= 1.
INSIDE_OUT_CUBE = KnownKernel(-1, 0.0)


def moebius_band(n: int = 12, width: float = 0.5) -> Mesh:
    """Closed strip with half a turn: one boundary loop, no consistent orientation."""
    angle = 2 * np.pi * np.arange(n) / n
    across = np.stack(
        [np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)], axis=-1
    )
    middle = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=-1)
    faces = []
    for i in range(n):
        a, b = i, i + n
        c, d = (i + 1, i + 1 + n) if i + 1 < n else (n, 0)
        faces += [(a, c, b), (b, c, d)]
    return mesh(np.concatenate([middle - width / 2 * across, middle + width / 2 * across]), faces)


KNOWN: dict[str, tuple[Callable[[], Mesh], KnownKernel]] = {
    "cube": (cube, CUBE),
    "tetrahedron": (tetrahedron, TETRAHEDRON),
    "octahedron": (octahedron, OCTAHEDRON),
    "l_prism": (l_prism, L_PRISM),
    "star_prism": (star_prism, STAR_PRISM),
    "plus_cross": (plus_cross, PLUS_CROSS),
    "s_tetromino": (s_tetromino, s_tetromino_kernel(0.0)),
    "s_tetromino_open": (lambda: s_tetromino(0.25), s_tetromino_kernel(0.25)),
    "s_tetromino_shut": (lambda: s_tetromino(-0.25), s_tetromino_kernel(-0.25)),
    "saw_prism": (saw_prism, SAW_PRISM),
    "notched_cube": (notched_cube, notched_cube_kernel(0.0)),
    "notched_cube_open": (lambda: notched_cube(0.25), notched_cube_kernel(0.25)),
    "notched_cube_shut": (lambda: notched_cube(-0.25), notched_cube_kernel(-0.25)),
    "two_boxes": (two_boxes, TWO_BOXES),
    "crossing_boxes": (crossing_boxes, CROSSING_BOXES),
    "truncated_octahedron": (lambda: fan(*truncated_octahedron()), TRUNCATED_OCTAHEDRON),
    "torus": (lambda: torus(n_major=8, n_minor=6), TORUS),
    "height_field": (lambda: height_field(n=3), HEIGHT_FIELD),
    "open_hemisphere": (lambda: open_hemisphere(4, 6), OPEN_HEMISPHERE),
    "open_box": (open_box, OPEN_BOX),
    "cubes_sharing_an_edge": (cubes_sharing_an_edge, CUBES_SHARING_AN_EDGE),
    "three_faces_on_an_edge": (three_faces_on_an_edge, THREE_FACES_ON_AN_EDGE),
    "cube_with_flipped_face": (cube_with_flipped_face, CUBE_WITH_FLIPPED_FACE),
    "inside_out_cube": (inside_out_cube, INSIDE_OUT_CUBE),
}


# ---------------------------------------------------------------- the same surface, written differently


def subdivided(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Mesh:
    """Each triangle into four at the middles of its edges. Exact when coordinates are small integers."""
    points = list(map(tuple, vertices))
    middle: dict[tuple[int, int], int] = {}

    def between(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in middle:
            middle[key] = len(points)
            points.append(tuple((vertices[a] + vertices[b]) / 2))
        return middle[key]

    result = []
    for a, b, c in faces.tolist():
        ab, bc, ca = between(a, b), between(b, c), between(c, a)
        result += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return mesh(points, result)


def with_split_facet(vertices: NDArray[np.float64], faces: NDArray[np.int64], facet: int) -> Mesh:
    """Split one triangle into three at (a + b + 2 c) / 4; exact when coordinates are small integers."""
    a, b, c = faces[facet].tolist()
    new = len(vertices)
    middle = (vertices[a] + vertices[b] + 2 * vertices[c]) / 4
    return mesh(
        np.concatenate([vertices, middle[None]]),
        np.concatenate([np.delete(faces, facet, axis=0), [(a, b, new), (b, c, new), (c, a, new)]]),
    )


def shuffled(vertices: NDArray[np.float64], faces: NDArray[np.int64], rng: np.random.Generator) -> Mesh:
    """The same triangles in another order, from other first corners, with renumbered vertices."""
    order = rng.permutation(len(vertices))
    new_id = np.empty_like(order)
    new_id[order] = np.arange(len(order))
    faces = new_id[faces[rng.permutation(len(faces))]]
    first = rng.integers(0, 3, len(faces))
    return mesh(vertices[order], np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1))


def quarter_turns() -> list[NDArray[np.float64]]:
    """The 24 rotations of a cube: signed permutation matrices of determinant 1; exact on every double."""
    turns = []
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0:
                turns.append(turn)
    return turns


def random_rotation(rng: np.random.Generator) -> NDArray[np.float64]:
    """Rotation matrix, uniform; its entries are doubles, so a moved mesh is rounded."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def moved(
    vertices: NDArray[np.float64], rotation: NDArray[np.float64], translation: Sequence[float] = (0, 0, 0)
) -> NDArray[np.float64]:
    """Rotated, then translated."""
    return np.ascontiguousarray(vertices @ rotation.T + np.asarray(translation, dtype=np.float64))


# ---------------------------------------------------------------- random integer meshes (hypothesis)

_small = st.integers(-4, 4)
_point = st.tuples(_small, _small, _small)


def hull_of(points: Sequence[Sequence[int]]) -> Mesh | None:
    """Convex hull of integer points, oriented by exact integer determinants; None when it has no volume."""
    from scipy.spatial import ConvexHull, QhullError

    array = np.array(sorted({tuple(p) for p in points}), dtype=np.int64)
    try:
        simplices = ConvexHull(array).simplices
    except (QhullError, ValueError):
        return None
    used = np.unique(simplices)
    array, simplices = array[used], np.searchsorted(used, simplices)
    n, total = len(array), array.sum(axis=0)
    faces = []
    for a, b, c in simplices:
        normal = np.cross(array[b] - array[a], array[c] - array[a])
        side = int(normal @ (total - n * array[a]))
        if side == 0:  # a triangle without area, or points in one plane
            return None
        faces.append((a, b, c) if side < 0 else (a, c, b))
    edges = {(f[i], f[(i + 1) % 3]) for f in faces for i in range(3)}
    if len(edges) != 3 * len(faces) or any((b, a) not in edges for a, b in edges):
        return None
    return mesh(array, faces)


@st.composite
def convex_meshes(draw: st.DrawFn) -> Mesh:
    """Convex hulls of 4 to 10 small integer points."""
    result = hull_of(draw(st.lists(_point, min_size=4, max_size=10, unique=True)))
    assume(result is not None)
    assert result is not None
    return result


@st.composite
def polycubes(draw: st.DrawFn) -> Mesh:
    """Boundary of up to eight cells of a 3 x 3 x 3 block: closed, any genus, sometimes non-manifold."""
    cell = st.tuples(st.integers(0, 2), st.integers(0, 2), st.integers(0, 2))
    return voxel_surface(draw(st.lists(cell, min_size=1, max_size=8, unique=True)))


@st.composite
def radial_meshes(draw: st.DrawFn) -> Mesh:
    """Integer radii on the 18 lattice directions of a subdivided octahedron: star-shaped from the origin."""
    vertices, faces = subdivided(*octahedron())
    radii = draw(st.lists(st.integers(1, 5), min_size=len(vertices), max_size=len(vertices)))
    return vertices * 2 * np.array(radii, dtype=np.float64)[:, None], faces


def untangled(points: Sequence[tuple[int, int]]) -> list[tuple[int, int]] | None:
    """Make a closed path through the points simple and counter-clockwise by undoing crossings."""
    path = list(points)
    n = len(path)

    def cross(p: Any, q: Any, r: Any, s: Any) -> bool:
        return _side(p, q, r) * _side(p, q, s) <= 0 and _side(r, s, p) * _side(r, s, q) <= 0

    for _ in range(50):
        crossing = next(
            (
                (i, j)
                for i in range(n)
                for j in range(i + 2, n)
                if (j + 1) % n != i and cross(path[i], path[i + 1], path[j], path[(j + 1) % n])
            ),
            None,
        )
        if crossing is None:
            break
        i, j = crossing
        path[i + 1 : j + 1] = path[i + 1 : j + 1][::-1]
    else:
        return None
    if any(_side(path[k - 2], path[k - 1], path[k]) == 0 for k in range(n)):
        return None
    area2 = sum(path[k - 1][0] * path[k][1] - path[k - 1][1] * path[k][0] for k in range(n))
    return path if area2 > 0 else path[::-1]


@st.composite
def polygon_prisms(draw: st.DrawFn) -> Mesh:
    """Prisms over simple integer polygons of 3 to 8 corners; many have an empty kernel."""
    wide = st.integers(-6, 6)
    polygon = untangled(draw(st.lists(st.tuples(wide, wide), min_size=3, max_size=8, unique=True)))
    assume(polygon is not None)
    assert polygon is not None
    return prism(polygon, 0, draw(st.integers(1, 3)))


@st.composite
def central_soups(draw: st.DrawFn) -> Mesh:
    """Triangles in planes through one point, some also turned over, and the cube [-8, 8]^3 about them.

    The corners u, v, -u-v have the point as their mean. Kernels of every dimension but -1 are common.
    """
    pairs = draw(st.lists(st.tuples(_point, _point), min_size=1, max_size=6))
    centre = np.array(draw(st.tuples(*[st.integers(-1, 1)] * 3)))
    parts = [box((-8, -8, -8), (8, 8, 8))]
    for u, v in pairs:
        u, v = np.array(u), np.array(v)
        if not np.cross(u, v).any():
            continue
        corners = [centre + u, centre + v, centre - u - v]
        front, again, back = (0, 1, 2), (1, 2, 0), (0, 2, 1)
        parts.append(mesh(corners, draw(st.sampled_from([[front], [front], [front, back], [front, again]]))))
    return joined(*parts)


@st.composite
def soups(draw: st.DrawFn) -> Mesh:
    """Any integer triangles, degenerate ones and duplicates among them, and the cube [-8, 8]^3 about them."""
    corners = draw(st.lists(_point, min_size=3, max_size=8))
    ids = st.integers(0, len(corners) - 1)
    faces = draw(st.lists(st.tuples(ids, ids, ids), min_size=1, max_size=8))
    return joined(box((-8, -8, -8), (8, 8, 8)), mesh(corners, faces))


def integer_meshes() -> st.SearchStrategy[Mesh]:
    """All of the above."""
    return st.one_of(
        convex_meshes(), polycubes(), radial_meshes(), polygon_prisms(), central_soups(), soups()
    )
