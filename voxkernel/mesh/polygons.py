"""Polygons in space: one plane for each planar one, and triangles for all, in input order."""

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_integers
from voxkernel.errors import MeshError
from voxkernel.mesh.ears import cut_ears
from voxkernel.mesh.triangles import doubled_normals, scale_exponent, triangle_areas, unscaled

__all__ = ["CutPolygons", "areas_of_planes", "flatten_polygons", "polygon_planes"]

_FEW_CORNERS = 256  # `_loops/cell_planes.py` leaves larger polygons to this file
_MAX_PASSES = 32
_MOST_CORNERS = 1 << 17  # of a block


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


def polygon_planes(
    points: NDArray[np.float64], flat: NDArray[np.int64], sizes: NDArray[np.int64], rtol: float
) -> CutPolygons:
    """Group polygons by size, so that everything but ear clipping is work on whole blocks."""
    exponent = scale_exponent(points)
    points = np.ldexp(points, -exponent)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    first_triangle = np.concatenate([[0], np.cumsum(sizes - 2)])
    triangles = np.empty((int(first_triangle[-1]), 3), dtype=np.int64)
    planar = np.ones(len(sizes), dtype=bool)
    corners = np.empty((len(sizes), 3), dtype=np.int64)
    areas = np.empty(len(sizes), dtype=np.float64)
    for ids in _blocks_of_one_size(sizes):
        size = int(sizes[ids[0]])
        loops = flat[starts[ids, None] + np.arange(size)]
        local = points[loops] - points[loops[:, :1]]
        newell = 0.5 * np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1)
        if size > 3:
            planar[ids], corners[ids] = _planes(loops, local, newell, rtol)
        else:
            corners[ids] = loops
        areas[ids] = unscaled(np.linalg.norm(newell, axis=1), 2 * exponent)
        rows = first_triangle[ids, None] + np.arange(size - 2)
        triangles[rows] = _triangulate(loops, local, newell, ids)
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


def _blocks_of_one_size(sizes: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Polygons with equally many corners, in blocks of bounded memory."""
    for size in np.unique(sizes):
        ids = np.flatnonzero(sizes == size)
        step = max(1, _MOST_CORNERS // int(size))
        for start in range(0, len(ids), step):
            yield ids[start : start + step]


def _planes(
    loops: NDArray[np.int64], local: NDArray[np.float64], newell: NDArray[np.float64], rtol: float
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Planar or not, and three well-spread corners: the diameter, and the corner farthest from its line."""
    m = len(loops)
    rows = np.arange(m)
    i, j, best = _diameters(local)
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


def _diameters(
    local: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Two corners of each loop as far from each other as any, and the square of their distance.

    Of loops with many corners, two that are farthest from each other: to go to the farthest corner from the
    farthest corner until that is no farther takes a few passes, all pairs take too long.
    """
    m, size = local.shape[:2]
    rows = np.arange(m)
    i, j = np.zeros(m, dtype=np.int64), np.ones(m, dtype=np.int64)
    best = np.full(m, -1.0)
    if size <= _FEW_CORNERS:
        for shift in range(1, size // 2 + 1):
            gap = local - np.roll(local, -shift, axis=1)
            square = np.einsum("mki,mki->mk", gap, gap)
            at = square.argmax(axis=1)
            better = square[rows, at] > best
            best[better] = square[rows, at][better]
            i[better], j[better] = at[better], (at[better] + shift) % size
        return i, j, best
    source = _farthest(local, local.mean(axis=1))[0]
    for _ in range(_MAX_PASSES):
        at, square = _farthest(local, local[rows, source])
        better = square > best
        if not better.any():
            break
        best[better], i[better], j[better] = square[better], source[better], at[better]
        source = np.where(better, at, source)
    return i, j, best


def _farthest(
    local: NDArray[np.float64], point: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The corner of each loop farthest from a point of its own, and the square of the distance."""
    gap = local - point[:, None]
    square = np.einsum("mki,mki->mk", gap, gap)
    at = square.argmax(axis=1)
    return at, square[np.arange(len(local)), at]


def _triangulate(
    loops: NDArray[np.int64], local: NDArray[np.float64], newell: NDArray[np.float64], ids: NDArray[np.int64]
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
        triangles[row] = loops[row][_ears(loops[row], local[row], newell[row], fan, int(ids[row]))]
    return triangles


def _ears(
    loop: NDArray[np.int64],
    local: NDArray[np.float64],
    newell: NDArray[np.float64],
    fan: NDArray[np.int64],
    polygon: int,
) -> NDArray[np.int64]:
    """Local corner ids of one polygon's triangles; the fan again where it has no inside or crosses itself.

    A loop that comes back to a vertex may be a polygon that touches itself, as one with a cut to a hole; where it
    is not, it is several loops in one, and which was meant is not known.
    """
    axis = int(np.abs(newell).argmax())
    if newell[axis] == 0.0:
        return fan
    flat = local[:, [(axis + 1) % 3, (axis + 2) % 3]]
    if newell[axis] < 0.0:
        flat = flat[:, ::-1]
    ears = cut_ears(flat, loop)
    if ears is not None:
        return ears
    ids, counts = np.unique(loop, return_counts=True)
    if len(ids) < len(loop):
        again = int(ids[counts.argmax()])
        raise MeshError(
            f"`polygons` must be one loop each; got vertex {again} {int(counts.max())} times in polygon {polygon}, "
            "which crosses itself"
        )
    return fan


def areas_of_planes(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], facet_ids: NDArray[np.int64],
    plane_corners: NDArray[np.int64], plane_facets: NDArray[np.int64], nonplanar: NDArray[np.int64],
) -> NDArray[np.float64]:  # fmt: skip
    """(p,) areas; that of a planar polygon is the length of the sum of the area vectors of its triangles."""
    areas = triangle_areas(vertices, plane_corners)
    if len(plane_facets) == len(faces):  # each triangle has a plane of its own
        return areas
    starts = np.flatnonzero(np.diff(facet_ids, prepend=-1))
    whole = 0.5 * np.linalg.norm(np.add.reduceat(doubled_normals(vertices[faces]), starts), axis=1)
    is_planar = ~np.isin(plane_facets, nonplanar)
    areas[is_planar] = whole[np.searchsorted(facet_ids[starts], plane_facets[is_planar])]
    return areas
