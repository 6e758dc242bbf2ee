"""Polygons in space: one plane for each planar one, and triangles for all, in input order."""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_integers
from voxkernel._core import cut_polygons, fill_triangle_areas
from voxkernel.errors import MeshError
from voxkernel.mesh.ears import cut_ears
from voxkernel.mesh.triangles import doubled_normals, scale_exponent, triangle_areas

__all__ = ["CutPolygons", "areas_of_planes", "flatten_polygons", "polygon_planes"]


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
            f"`polygons` must be a sequence of index sequences or an (m, k) array; got {type(polygons).__name__}"
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
    """The core cuts what has a fan; ears are clipped here, of the polygons with the fewest corners first."""
    exponent = scale_exponent(points)
    flat, sizes = (np.ascontiguousarray(ids, dtype=np.int64) for ids in (flat, sizes))
    found = cut_polygons(points, flat, sizes, exponent, rtol)
    cut, unfanned = CutPolygons(*found[:6]), found[6]
    for polygon, corner, triangle, plane, newell in sorted(unfanned, key=lambda one: (int(sizes[one[0]]), one[0])):
        size = int(sizes[polygon])
        loop = flat[corner : corner + size]
        local = np.ldexp(points[loop], -exponent)
        ears = loop[_ears(loop, local - local[0], np.array(newell), polygon)]
        cut.triangles[triangle : triangle + size - 2] = ears
        if plane >= 0:
            cut.plane_corners[plane : plane + size - 2] = ears
    fill_triangle_areas(points, cut.plane_corners, exponent, cut.plane_areas)
    return cut


def _ears(
    loop: NDArray[np.int64],
    local: NDArray[np.float64],
    newell: NDArray[np.float64],
    polygon: int,
) -> NDArray[np.int64]:
    """Local corner ids of one polygon's triangles; the fan again where it has no inside or crosses itself.

    A loop that comes back to a vertex may be a polygon that touches itself, as one with a cut to a hole; where it
    is not, it is several loops in one, and which was meant is not known.
    """
    fan = np.stack([np.zeros(len(loop) - 2, np.int64), np.arange(1, len(loop) - 1), np.arange(2, len(loop))], axis=1)
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
