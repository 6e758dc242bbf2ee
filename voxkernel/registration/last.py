"""The last refinement of a pair: at full resolution within the overlap, and to the last digits for copies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.surface_samples import spread_samples
from voxkernel.mesh.triangles import unit_normals, without_strays
from voxkernel.registration.icp import Refine, icp
from voxkernel.registration.polish import Polished, polished
from voxkernel.registration.prepare import PreparedSurface, Skin, rim_of
from voxkernel.registration.search import inverse
from voxkernel.registration.side import Side

__all__ = ["last_refined"]

_SAMPLES = 2000
_NEIGHBOURS = 8  # vertices near a sample whose triangles it may meet
_FEWEST = 10
_STEPS = 12
_RESTS = 3e-5
_LEAST = 1 / 300
_POINTS_REACH = 1 / 60
_NEARLY_EXACT = 2e-3
_EXACT = 1e-9
_FEW = 500


def last_refined(
    pair: tuple[PreparedSurface, PreparedSurface], sides: tuple[Side, Side], found: Polished, reach: float,
    method: Refine,
) -> tuple[NDArray[np.float64], bool]:  # fmt: skip
    """Refine a motion once more; give it and whether it rests."""
    scale = max(p.diagonal for p in pair)
    if any(len(p.faces) > len(p.skin.faces) for p in pair):
        whole = _within_overlap(pair, sides, found.transform, reach, scale)
        if whole is not None:
            wide = max(2.0 * found.reach, _LEAST)
            more = polished(*whole, found.transform, reach=wide, least=0.5 * _LEAST, steps=_STEPS)
            found = more if np.isfinite(more.step) else found
    motion, rests = found.transform, found.rests(_RESTS)
    if method == "point_to_point":
        one, two = (p.fine.points / scale for p in pair)
        end = icp(one, two, motion, max(found.reach, _POINTS_REACH), steps=100, change=1e-9)
        if end.n_pairs >= 3:
            motion, rests = end.transform, True
    exact = _of_copies(pair, scale, motion) if found.reach < 2.0 * _LEAST else None
    return (motion, rests) if exact is None else (exact, True)


def _of_copies(
    pair: tuple[PreparedSurface, PreparedSurface], scale: float, motion: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Lay the vertices of copies of one surface on each other to the last digits; None where they are none."""
    one, two = (p.fine.points[: p.fine.n_vertices] / scale for p in pair)
    few = min(len(one), len(two))
    shown = one[:: max(1, len(one) // _FEW)]
    if few < 3:
        return None
    near = icp(shown, two, motion, _NEARLY_EXACT, steps=0, change=0.0).n_pairs
    if near < 0.5 * few / len(one) * len(shown):
        return None
    end = icp(one, two, motion, _NEARLY_EXACT, steps=10, change=1e-15)
    return end.transform if end.n_pairs >= 0.5 * few and end.rmse < _EXACT else None


def _within_overlap(
    pair: tuple[PreparedSurface, PreparedSurface], sides: tuple[Side, Side], motion: NDArray[np.float64],
    reach: float, scale: float,
) -> tuple[Side, Side] | None:  # fmt: skip
    """Sample all facets of both surfaces inside the box around what they have in common.

    Of the triangles only those are kept that touch a vertex near a sample of the other surface: where they end, a rim
    is seen, and pairs that would need others do not count.
    """
    from scipy.spatial import KDTree

    inside: list[tuple[NDArray[np.float64], NDArray[np.int64]]] = []
    for own, other, move in ((0, 1, motion), (1, 0, inverse(motion))):
        points = sides[own].points
        near = sides[other].nearest(points @ move[:3, :3].T + move[:3, 3]).distances < reach
        if near.sum() < _FEWEST:
            return None
        low, high = (points[near].min(axis=0) - reach) * scale, (points[near].max(axis=0) + reach) * scale
        vertices, faces = pair[own].vertices, pair[own].faces
        within = np.logical_and.reduce([(x >= a) & (x <= b) for x, a, b in zip(vertices.T, low, high, strict=True)])
        inside.append(without_strays(vertices, faces if within.all() else faces[within[faces[:, 0]]]))
        if len(inside[own][1]) < _FEWEST:
            return None
    shown = [spread_samples(*part, _SAMPLES) for part in inside]
    made: list[Side] = []
    for own, other, move in ((0, 1, inverse(motion)), (1, 0, motion)):
        vertices, faces = inside[own]
        there = shown[other][0] @ move[:3, :3].T + scale * move[:3, 3]
        near = KDTree(vertices, balanced_tree=False, compact_nodes=False).query(there, k=_NEIGHBOURS)[1]
        wanted = np.zeros(len(vertices) + 1, np.bool_)  # the last one stands for those that are not there
        wanted[near] = True
        points, owners, areas = shown[own]
        some_vertices, some = without_strays(vertices, faces[wanted[faces].any(axis=1)])
        skin = Skin(some_vertices, some, unit_normals(some_vertices[some]), rim_of(some, len(some_vertices)))
        own_normals = unit_normals(vertices[faces[owners]])
        made.append(Side(skin, scale, _SAMPLES, (points, own_normals, areas)))
    return made[0], made[1]
