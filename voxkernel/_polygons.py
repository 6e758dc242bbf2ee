"""Polygons in space: one plane for each planar one, and triangles for all, in input order."""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_integers
from voxkernel.errors import MeshError

__all__ = [
    "CutPolygons",
    "flatten_polygons",
    "polygon_planes",
    "scale_exponent",
    "scaled_triangle_areas",
    "triangle_areas",
    "unscaled",
    "used_vertices",
    "without_strays",
]


class CutPolygons(NamedTuple):
    """What `polygon_planes` hands to the mesh; see `TriangleMesh` for the meaning of each array."""

    triangles: NDArray[np.int64]
    facet_ids: NDArray[np.int64]
    plane_corners: NDArray[np.int64]
    plane_facets: NDArray[np.int64]
    plane_areas: NDArray[np.float64]
    nonplanar: NDArray[np.int64]


def flatten_polygons(polygons: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One flat id array and the polygon sizes, from an (m, k) array or a sequence of sequences."""
    if isinstance(polygons, np.ndarray) and polygons.dtype != object:
        rows = as_integers("polygons", polygons, shape="(m, k)", ndim=2, error=MeshError)
        return rows.reshape(-1), np.full(len(rows), rows.shape[1], dtype=np.int64)
    if not isinstance(polygons, Sequence | np.ndarray):
        raise TypeError(
            "`polygons` must be a sequence of index sequences or an (m, k) array; "
            f"got {type(polygons).__name__}"
        )
    try:
        sizes = np.fromiter(map(len, polygons), dtype=np.int64, count=len(polygons))
        joined = list(chain.from_iterable(polygons))
    except TypeError:
        raise TypeError("`polygons` must be a sequence of index sequences; got a flat sequence") from None
    return as_integers("polygons", joined, shape="(n,)", ndim=1, error=MeshError), sizes


def scale_exponent(vertices: NDArray[np.float64]) -> int:
    """The e with max |coordinate| in [2**(e-1), 2**e): products of coordinates / 2**e cannot overflow."""
    return int(np.frexp(max(float(vertices.max()), -float(vertices.min())))[1])


def used_vertices(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The vertices that a face refers to, in order: no other one may change an answer."""
    used = np.zeros(len(vertices), np.bool_)
    used[faces.ravel()] = True
    return vertices if used.all() else vertices[used]


def without_strays(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Leave out the vertices that no face refers to; the arrays themselves where there are none."""
    used = np.zeros(len(vertices), np.bool_)
    used[faces.ravel()] = True
    if used.all():
        return vertices, faces
    return vertices[used], (np.cumsum(used) - 1)[faces]


def unscaled(values: Any, exponent: int) -> Any:
    """``values * 2**exponent``; infinite where that is too large for a float."""
    with np.errstate(over="ignore", under="ignore"):
        return np.ldexp(values, exponent)


def triangle_areas(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """(m,) areas; differences first, so a mesh far from the origin loses nothing."""
    exponent = scale_exponent(vertices)
    return unscaled(scaled_triangle_areas(vertices, triangles, exponent), 2 * exponent)


def scaled_triangle_areas(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], exponent: int
) -> NDArray[np.float64]:
    """(m,) areas in units of ``4**exponent``."""
    x, y, z = (np.ldexp(column, -exponent) for column in vertices.T)
    a, b, c = (np.ascontiguousarray(column) for column in triangles.T)
    xa, ya, za = x[a], y[a], z[a]
    ux, uy, uz = x[b] - xa, y[b] - ya, z[b] - za
    vx, vy, vz = x[c] - xa, y[c] - ya, z[c] - za
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)


def polygon_planes(
    points: NDArray[np.float64], flat: NDArray[np.int64], sizes: NDArray[np.int64], rtol: float
) -> CutPolygons:
    """Group polygons by size, so that everything but ear clipping is whole-array work."""
    exponent = scale_exponent(points)
    points = np.ldexp(points, -exponent)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    first_triangle = np.concatenate([[0], np.cumsum(sizes - 2)])
    triangles = np.empty((int(first_triangle[-1]), 3), dtype=np.int64)
    planar = np.ones(len(sizes), dtype=bool)
    corners = np.empty((len(sizes), 3), dtype=np.int64)
    areas = np.empty(len(sizes), dtype=np.float64)
    for size in np.unique(sizes):
        ids = np.flatnonzero(sizes == size)
        loops = flat[starts[ids, None] + np.arange(size)]
        local = points[loops] - points[loops[:, :1]]
        newell = 0.5 * np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1)
        if size > 3:
            planar[ids], corners[ids] = _planes(loops, local, newell, rtol)
        else:
            corners[ids] = loops
        areas[ids] = unscaled(np.linalg.norm(newell, axis=1), 2 * exponent)
        rows = first_triangle[ids, None] + np.arange(size - 2)
        triangles[rows] = _triangulate(loops, local, newell)
    facet_ids = np.repeat(np.arange(len(sizes), dtype=np.int64), sizes - 2)
    if planar.all():
        plane_facets = np.arange(len(sizes), dtype=np.int64)
        return CutPolygons(triangles, facet_ids, corners, plane_facets, areas, np.flatnonzero(~planar))
    n_planes = np.where(planar, 1, sizes - 2)
    plane_facets = np.repeat(np.arange(len(sizes), dtype=np.int64), n_planes)
    whole = planar[plane_facets]
    plane_corners = np.empty((len(plane_facets), 3), dtype=np.int64)
    plane_areas = np.empty(len(plane_facets), dtype=np.float64)
    plane_corners[whole], plane_areas[whole] = corners[planar], areas[planar]
    cut = triangles[~planar[facet_ids]]
    plane_corners[~whole], plane_areas[~whole] = cut, unscaled(triangle_areas(points, cut), 2 * exponent)
    nonplanar = np.flatnonzero(~planar)
    return CutPolygons(triangles, facet_ids, plane_corners, plane_facets, plane_areas, nonplanar)


def _planes(
    loops: NDArray[np.int64], local: NDArray[np.float64], newell: NDArray[np.float64], rtol: float
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Planar or not, and three well-spread corners: the diameter, and the corner farthest from its line."""
    m, size = loops.shape
    rows = np.arange(m)
    best = np.full(m, -1.0)
    i, j = np.zeros(m, dtype=np.int64), np.ones(m, dtype=np.int64)
    for shift in range(1, size // 2 + 1):
        gap = local - np.roll(local, -shift, axis=1)
        square = np.einsum("mki,mki->mk", gap, gap)
        at = square.argmax(axis=1)
        better = square[rows, at] > best
        best[better] = square[rows, at][better]
        i[better], j[better] = at[better], (at[better] + shift) % size
    base = local[rows, i]
    arm = local[rows, j] - base
    across = np.cross(arm[:, None], local - base[:, None])
    k = np.einsum("mki,mki->mk", across, across).argmax(axis=1)
    normal = across[rows, k]
    flipped = np.einsum("mi,mi->m", normal, newell) < 0.0
    corners = np.stack([loops[rows, i], loops[rows, j], loops[rows, k]], axis=1)
    corners[flipped] = corners[flipped][:, [1, 0, 2]]
    length = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("mi,mki->mk", normal, local - base[:, None])).max(axis=1)
    planar = height <= rtol * np.sqrt(best) * length
    # A flat loop whose areas cancel (a bow tie) has no side of its own: its triangles decide.
    sideless = np.linalg.norm(newell, axis=1) <= 1e-12 * length
    return planar & ~(sideless & (length > 0.0)), corners


def _triangulate(
    loops: NDArray[np.int64], local: NDArray[np.float64], newell: NDArray[np.float64]
) -> NDArray[np.int64]:
    """(m, k-2, 3): a fan where all its triangles face the polygon's way, ears elsewhere."""
    size = loops.shape[1]
    fan = np.stack([np.zeros(size - 2, dtype=np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
    triangles = loops[:, fan]
    if size == 3:
        return triangles
    floor = 1e-14 * np.einsum("mi,mi->m", newell, newell)
    left = np.arange(len(loops))
    for apex in range(2):
        corners = np.roll(local[left], -apex, axis=1)
        spokes = np.cross(corners[:, 1:-1] - corners[:, :1], corners[:, 2:] - corners[:, :1])
        facing = np.einsum("mki,mi->mk", spokes, newell[left])
        good = (facing > floor[left, None]).all(axis=1)
        triangles[left[good]] = np.roll(loops[left[good]], -apex, axis=1)[:, fan]
        left = left[~good]
    if size == 4:  # both diagonals were tried: it crosses itself or is a line
        return triangles
    for row in left:
        triangles[row] = loops[row][_ears(local[row], newell[row], fan)]
    return triangles


def _ears(
    local: NDArray[np.float64], newell: NDArray[np.float64], fan: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Local corner ids of one polygon's triangles; the fan again where the polygon has no inside."""
    axis = int(np.abs(newell).argmax())
    if newell[axis] == 0.0:
        return fan
    flat = local[:, [(axis + 1) % 3, (axis + 2) % 3]]
    if newell[axis] < 0.0:
        flat = flat[:, ::-1]
    flat = np.ascontiguousarray(flat)
    from mapbox_earcut import triangulate_float64

    ears = triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32)).astype(np.int64).reshape(-1, 3)
    u, v = flat[ears[:, 1]] - flat[ears[:, 0]], flat[ears[:, 2]] - flat[ears[:, 0]]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    if (area < 0.0).all():
        ears, area = ears[:, [0, 2, 1]], -area
    if len(ears) == len(fan) and (area > 0.0).all():
        return ears
    # earcut leaves out corners on a straight edge, which would open the seam to the neighbour.
    clipped = _clip_ears(flat)
    return fan if clipped is None else clipped


def _clip_ears(flat: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Ears of a counter-clockwise plane polygon that uses every corner, flat ones too; None if it crosses."""
    ring = list(range(len(flat)))
    ears: list[tuple[int, int, int]] = []
    while len(ring) > 3:
        for position, tip in enumerate(ring):
            a, b = ring[position - 1], ring[(position + 1) % len(ring)]
            others = np.array([corner for corner in ring if corner not in (a, tip, b)])
            if _turn(flat[a], flat[tip], flat[b]) > 0.0 and not _any_inside(flat, (a, tip, b), others):
                ears.append((a, tip, b))
                del ring[position]
                break
        else:
            return None
    ears.append((ring[0], ring[1], ring[2]))
    return np.array(ears, dtype=np.int64)


def _turn(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> Any:
    """Twice the signed area of a, b, c; the last axis holds x and y."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _any_inside(flat: NDArray[np.float64], ear: tuple[int, int, int], others: NDArray[np.int64]) -> bool:
    """Is another corner in the closed triangle, other than exactly on one of its corners?"""
    a, b, c = flat[ear[0]], flat[ear[1]], flat[ear[2]]
    p = flat[others]
    inside = (_turn(a, b, p) >= 0.0) & (_turn(b, c, p) >= 0.0) & (_turn(c, a, p) >= 0.0)
    at_corner = (p == a).all(axis=1) | (p == b).all(axis=1) | (p == c).all(axis=1)
    return bool((inside & ~at_corner).any())
