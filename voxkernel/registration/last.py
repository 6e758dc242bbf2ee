"""The last refinement of a pair: at full resolution within the overlap, and to the last digits for copies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.triangles import doubled_normals
from voxkernel.registration.icp import Refine, icp
from voxkernel.registration.polish import Polished, polished
from voxkernel.registration.prepare import PreparedSurface, Skin, rim_of
from voxkernel.registration.search import inverse
from voxkernel.registration.side import Side

__all__ = ["last_refined"]

_SAMPLES = 4000
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
    motion, rests = found.transform, found.step < _RESTS
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
    """Make both surfaces from all their facets inside the box around what they have in common."""
    made: list[Side] = []
    for own, other, move in ((0, 1, motion), (1, 0, inverse(motion))):
        points = sides[own].points
        near = sides[other].nearest(points @ move[:3, :3].T + move[:3, 3]).distances < reach
        if near.sum() < 10:
            return None
        low, high = points[near].min(axis=0) - reach, points[near].max(axis=0) + reach
        vertices, faces = pair[own].vertices, pair[own].faces
        middles = vertices[faces[:, 0]] / scale
        inside = ((middles >= low) & (middles <= high)).all(axis=1)
        if inside.sum() < 10:
            return None
        kept = faces if inside.all() else faces[inside]
        normals = doubled_normals(vertices[kept])
        length = np.linalg.norm(normals, axis=1)
        skin = Skin(vertices, kept, normals / np.where(length > 0, length, 1.0)[:, None], rim_of(kept, len(vertices)))
        made.append(Side(skin, scale, _SAMPLES))
    return made[0], made[1]
