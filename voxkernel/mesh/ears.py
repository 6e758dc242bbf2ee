"""Triangles of one plane polygon by earcut, with the corners earcut leaves out put back.

earcut drops a corner that is straight when it meets it, on the border or inside, which would open the seam to the
neighbour. A dropped corner lies on an edge of the triangle that went past it: that triangle is split there. The
corners of a spike get triangles without area.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["cut_ears"]

_ROUNDING = 1e-12  # of the polygon's area: what triangles turned the wrong way by rounding may have together


def cut_ears(flat: NDArray[np.float64], loop: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """(n-2, 3) corner numbers of a counter-clockwise polygon that may touch itself; None if it crosses itself.

    `loop` holds its vertices, some of them perhaps twice. A polygon that does not cross itself turns once as a
    whole. This is asked first, because earcut looks at all pairs of corners, again and again, where it is stuck.
    """
    if len(flat) > 4 and not _turns_once(flat):
        return None
    ears = _cut_ring(flat)
    if ears is not None or len(np.unique(loop)) == len(loop):
        return ears
    parts: list[NDArray[np.int64]] = []
    for ring in _rings(loop.tolist()):  # it was stuck where the polygon touches itself
        corners = np.array(ring, dtype=np.int64)
        local = _cut_ring(flat[corners])
        if local is None:
            return None
        parts.append(corners[local])
    return np.concatenate(parts)


def _rings(loop: list[int]) -> list[list[int]]:
    """Corner numbers of the rings of a walk that comes back to vertices; both visits stay in both rings."""
    rings: list[list[int]] = []
    walk: list[int] = []
    place: dict[int, int] = {}
    for corner, vertex in enumerate(loop):
        first = place.get(vertex)
        if first is not None:
            rings.append([*walk[first:], corner])
            for passed in walk[first + 1 :]:
                place.pop(loop[passed], None)
            del walk[first + 1 :]
        place[vertex] = len(walk)
        walk.append(corner)
    return [ring for ring in [*rings, walk] if len(ring) > 2]


def _cut_ring(flat: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Triangles of a polygon as earcut makes them, none turned the wrong way; None where it is stuck."""
    from mapbox_earcut import triangulate_float64

    flat = np.ascontiguousarray(flat)
    ears = triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32)).astype(np.int64).reshape(-1, 3)
    area = _areas(flat, ears)
    if (area <= 0.0).all():
        ears, area = ears[:, [0, 2, 1]], -area
    if len(ears) < len(flat) - 2:
        ears = _with_straight_corners(flat, ears)
        area = _areas(flat, ears)
    if len(ears) != len(flat) - 2 or -area[area < 0.0].sum() > _ROUNDING * area.sum():
        return None
    return ears


def _areas(flat: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Twice the signed areas."""
    u, v = flat[triangles[:, 1]] - flat[triangles[:, 0]], flat[triangles[:, 2]] - flat[triangles[:, 0]]
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _turns_once(flat: NDArray[np.float64]) -> bool:
    """Whether the turns at the corners add up to one; a turn back by half a circle counts either way."""
    edges = np.roll(flat, -1, axis=0) - flat
    edges = edges[(edges != 0.0).any(axis=1)]
    after = np.roll(edges, -1, axis=0)
    turn = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    ahead = np.einsum("ij,ij->i", edges, after)
    back = (turn == 0.0) & (ahead < 0.0)
    turns = np.arctan2(turn[~back], ahead[~back]).sum() / (2.0 * np.pi)
    return abs(turns - 1.0) < 0.5 * np.count_nonzero(back) + 0.25


def _with_straight_corners(flat: NDArray[np.float64], ears: NDArray[np.int64]) -> NDArray[np.int64]:
    """Fill what was passed over: flat loops of edges without a partner, each along an edge of a triangle."""
    n = len(flat)
    triangles: list[tuple[int, int, int]] = [(a, b, c) for a, b, c in ears.tolist()]
    owner = {edge: row for row, ear in enumerate(triangles) for edge in _edges(ear)}
    follows: dict[int, list[int]] = {}
    for a in range(n):
        if (a, (a + 1) % n) not in owner:
            follows.setdefault(a, []).append((a + 1) % n)
    for a, b in owner:
        if (b, a) not in owner and (a + 1) % n != b:
            follows.setdefault(b, []).append(a)
    for loop in _loops(follows):
        ahead = loop[1:] + loop[:1]
        lengths = np.hypot(*(flat[ahead] - flat[loop]).T).tolist()
        long = max(range(len(loop)), key=lambda k: ((ahead[k], loop[k]) in owner, lengths[k]))
        way = loop[long + 1 :] + loop[: long + 1]  # beside the edge from its first to its last corner
        steps = np.diff(flat[way], axis=0) @ (flat[way[-1]] - flat[way[0]])
        row = owner.pop((way[0], way[-1]), None) if (steps > 0.0).all() else None
        if row is None:
            triangles += [(way[0], p, q) for p, q in pairwise(way[1:])]
            continue
        tip = next(corner for corner in triangles[row] if corner not in (way[0], way[-1]))
        for at, (p, q) in zip([row, *range(len(triangles), len(triangles) + len(way) - 2)], pairwise(way), strict=True):
            triangles[at : at + 1] = [(p, q, tip)]
            for edge in _edges((p, q, tip)):
                owner[edge] = at
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def _edges(ear: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    a, b, c = ear
    return (a, b), (b, c), (c, a)


def _loops(follows: dict[int, list[int]]) -> list[list[int]]:
    """Closed walks over all edges, each cut where it meets itself."""
    loops: list[list[int]] = []
    for start in list(follows):
        while follows.get(start):
            walk, place = [start], {start: 0}
            while True:
                after = follows.get(walk[-1])
                if not after:
                    return loops  # not closed; the count of triangles tells
                corner = after.pop()
                if corner not in place:
                    place[corner] = len(walk)
                    walk.append(corner)
                    continue
                first = place[corner]
                loops.append(walk[first:])
                for passed in walk[first + 1 :]:
                    del place[passed]
                del walk[first + 1 :]
                if corner == start:
                    break
    return loops
