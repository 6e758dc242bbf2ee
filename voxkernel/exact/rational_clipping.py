"""Convex polytopes of dimension 1 to 3 clipped by half-spaces in rational arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

__all__ = ["RationalPolytope", "clip_interval", "clip_polygon", "clip_polyhedron"]

Point = tuple[Fraction, ...]
Row = tuple[Sequence[int], Fraction]  # normal . z <= bound


@dataclass(frozen=True, slots=True)
class RationalPolytope:
    """Vertices, and faces as (row, vertex ids); row -1 is the artificial start."""

    vertices: list[Point]
    faces: list[tuple[int, list[int]]]


def clip_interval(rows: Sequence[Row], reach: Fraction) -> RationalPolytope:
    """Intersect half-lines; `reach` bounds the start on both sides."""
    low, high, low_row, high_row = -reach, reach, -1, -1
    for i, ((a,), b) in enumerate(rows):
        if a > 0 and b / a < high:
            high, high_row = b / a, i
        elif a < 0 and b / a > low:
            low, low_row = b / a, i
    return RationalPolytope([(low,), (high,)], [(low_row, [0]), (high_row, [1])])


def clip_polygon(rows: Sequence[Row], reach: Fraction) -> RationalPolytope:
    """Intersect half-planes with a square of half edge `reach`; faces are the edges."""
    corners: list[Point] = [(-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)]
    edges = [-1] * 4  # row of the edge from corner i to corner i + 1
    for r, (normal, bound) in enumerate(rows):
        side = [_side(normal, bound, p) for p in corners]
        if not any(s > 0 for s in side):
            continue
        kept: list[Point] = []
        kept_edges: list[int] = []
        n = len(corners)
        for i in range(n):
            j = (i + 1) % n
            if side[i] <= 0:
                kept.append(corners[i])
                leaves = side[i] == 0 and side[j] > 0
                kept_edges.append(r if leaves else edges[i])
                if side[i] < 0 < side[j]:
                    kept.append(_between(corners[i], corners[j], side[i], side[j]))
                    kept_edges.append(r)
            elif side[j] < 0:
                kept.append(_between(corners[i], corners[j], side[i], side[j]))
                kept_edges.append(edges[i])
        corners, edges = kept, kept_edges
    return RationalPolytope(corners, [(edges[i], [i, (i + 1) % len(corners)]) for i in range(len(corners))])


def clip_polyhedron(rows: Sequence[Row], reach: Fraction) -> RationalPolytope:
    """Intersect half-spaces with a cube of half edge `reach`; the result must have a volume."""
    start = [tuple(reach if (i >> k) & 1 else -reach for k in range(3)) for i in range(8)]
    vertices: list[Point] = list(start)
    faces: list[tuple[int, list[int]]] = [
        (-1, f) for f in ([0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6])
    ]
    alive = list(range(8))
    for r, (normal, bound) in enumerate(rows):
        side = {i: _side(normal, bound, vertices[i]) for i in alive}
        if not any(s > 0 for s in side.values()):
            continue
        cuts: dict[tuple[int, int], int] = {}
        fresh: list[tuple[int, list[int]]] = []
        follow: dict[int, int] = {}  # around the new face: from a vertex to the one after it
        for row, ring in faces:
            kept: list[int] = []
            for i, j in zip(ring, ring[1:] + ring[:1], strict=True):
                if side[i] <= 0:
                    kept.append(i)
                if side[i] * side[j] < 0:
                    key = (min(i, j), max(i, j))
                    if key not in cuts:
                        cuts[key] = len(vertices)
                        vertices.append(_between(vertices[i], vertices[j], side[i], side[j]))
                        side[cuts[key]] = Fraction(0)
                    kept.append(cuts[key])
            if len(kept) >= 3 and any(side[i] < 0 for i in kept):
                fresh.append((row, kept))
                for i, j in zip(kept, kept[1:] + kept[:1], strict=True):
                    if side[i] == 0 and side[j] == 0:
                        follow[j] = i
        ring = []
        if follow:
            current = first = next(iter(follow))
            while True:
                ring.append(current)
                current = follow[current]
                if current == first:
                    break
        if len(ring) >= 3:
            fresh.append((r, ring))
        faces = fresh
        alive = sorted({i for _, f in faces for i in f})
    order = {v: k for k, v in enumerate(alive)}
    return RationalPolytope([vertices[i] for i in alive], [(row, [order[i] for i in f]) for row, f in faces])


def _side(normal: Sequence[int], bound: Fraction, point: Point) -> Fraction:
    return sum((n * p for n, p in zip(normal, point, strict=True) if n), Fraction(0)) - bound


def _between(a: Point, b: Point, side_a: Fraction, side_b: Fraction) -> Point:
    share = side_a / (side_a - side_b)
    return tuple(u + share * (v - u) for u, v in zip(a, b, strict=True))
