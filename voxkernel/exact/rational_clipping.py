"""Convex polytopes of dimension 1 and 2 clipped by half-spaces in rational arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

__all__ = ["RationalPolytope", "clip_interval", "clip_polygon"]

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


def _side(normal: Sequence[int], bound: Fraction, point: Point) -> Fraction:
    return sum((n * p for n, p in zip(normal, point, strict=True) if n), Fraction(0)) - bound


def _between(a: Point, b: Point, side_a: Fraction, side_b: Fraction) -> Point:
    share = side_a / (side_a - side_b)
    return tuple(u + share * (v - u) for u, v in zip(a, b, strict=True))
