"""The last refinement of a pair: at full resolution within the overlap, and to the last digits for copies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.triangles import doubled_normals
from voxkernel.registration.icp import Refine, icp
from voxkernel.registration.polish import Polished, pairs_of, polished
from voxkernel.registration.prepare import PreparedSurface, Skin, rim_of
from voxkernel.registration.search import ScoredCloud, inverse
from voxkernel.registration.side import Side

__all__ = ["last_refined"]

_SAMPLES = 4000
_STEPS = 12
_RESTS = 2e-5
_LEAST = 1 / 300
_POINTS_REACH = 1 / 60
_NEARLY_EXACT = 2e-3
_EXACT = 1e-9


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
    near = pairs_of(*sides, motion, 10 * _LEAST)
    close = len(near.moved) > 0 and float(np.median(np.linalg.norm(near.moved - near.partners, axis=1))) < _NEARLY_EXACT
    if close or method == "point_to_point":
        clouds = ScoredCloud(pair[0].fine, scale), ScoredCloud(pair[1].fine, scale)
        if method == "point_to_point":
            one, two = (c.cloud for c in clouds)
            end = icp(one, two, motion, max(found.reach, _POINTS_REACH), method, steps=100, change=1e-9)
            if end.n_pairs >= 3:
                motion, rests = end.transform, True
        exact = _of_copies(*clouds, motion)
        if exact is not None:
            return exact, True
    return motion, bool(rests)


def _of_copies(source: ScoredCloud, target: ScoredCloud, motion: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Lay the vertices of copies of one surface on each other to the last digits; None where they are none."""
    few = min(source.n_vertices, target.n_vertices)
    if few < 3 or len(source.pairs(target, motion, _NEARLY_EXACT)[0]) < 0.5 * few:
        return None
    one, two = (c.cloud.select_by_index(range(c.n_vertices)) for c in (source, target))
    end = icp(one, two, motion, _NEARLY_EXACT, "point_to_point", steps=10, change=1e-15)
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
