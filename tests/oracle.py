"""Slow, exact and independent: half-space intersections of few planes in rational arithmetic.

Nothing here is shared with the library. A plane is four integers (a, b, c, d) without common divisor and
stands for a x + b y + c z <= d: the exact plane of the doubles it was made from. Points have `Fraction`s.
The vertices of a kernel are the ends of what all half-spaces leave of the line of every pair of planes, so n
planes cost n^3 steps: a hundred planes take a second.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, pairwise
from math import gcd, lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

Plane = tuple[int, int, int, int]
Point = tuple[Fraction, Fraction, Fraction]


# ---------------------------------------------------------------- planes


def point(values: Iterable[Any]) -> Point:
    """The exact value of three doubles (or integers, or fractions)."""
    x, y, z = (Fraction(v) if isinstance(v, int | Fraction) else Fraction(float(v)) for v in values)
    return x, y, z


def plane(normal: Iterable[Any], offset: Any) -> Plane | None:
    """Half-space normal . x <= offset; None when the normal is zero."""
    values = [*point(normal), *point((offset, 0, 0))[:1]]
    scale = lcm(*(v.denominator for v in values))
    a, b, c, d = (int(v * scale) for v in values)
    if not (a or b or c):
        return None
    divisor = gcd(a, b, c, d)
    return a // divisor, b // divisor, c // divisor, d // divisor


def plane_through(p: Point, q: Point, r: Point) -> Plane | None:
    """Half-space behind the triangle p, q, r (counter-clockwise from outside); None when it has no area."""
    normal = _cross(_minus(q, p), _minus(r, p))
    return plane(normal, _dot(normal, p))


def corner_planes(vertices: NDArray[np.float64], corners: NDArray[np.int64]) -> list[Plane | None]:
    """One plane per row of three vertex ids; None for rows without area."""
    exact = {int(i): point(vertices[i]) for i in np.unique(corners)}
    return [plane_through(*(exact[int(i)] for i in row)) for row in corners]


def box_planes(lower: Sequence[Any], upper: Sequence[Any]) -> list[Plane]:
    planes = []
    for axis in range(3):
        unit = [int(axis == k) for k in range(3)]
        planes.append(plane(unit, upper[axis]))
        planes.append(plane([-u for u in unit], -Fraction(lower[axis])))
    return [p for p in planes if p is not None]


def tightest(planes: Iterable[Plane | None]) -> list[Plane]:
    """Without None, duplicates, and planes parallel to a tighter one."""
    best: dict[tuple[int, int, int], tuple[Fraction, Plane]] = {}
    for p in planes:
        if p is None:
            continue
        divisor = gcd(*p[:3])
        key = (p[0] // divisor, p[1] // divisor, p[2] // divisor)
        offset = Fraction(p[3], divisor)
        if key not in best or offset < best[key][0]:
            best[key] = (offset, p)
    return [p for _, p in best.values()]


def side(p: Plane, x: Sequence[Fraction]) -> int:
    """-1 behind the plane (seen by it), 0 on it, 1 in front."""
    value = p[0] * x[0] + p[1] * x[1] + p[2] * x[2] - p[3]
    return (value > 0) - (value < 0)


def is_inside(planes: Iterable[Plane | None], x: Iterable[Any]) -> bool:
    exact = point(x)
    return all(side(p, exact) <= 0 for p in planes if p is not None)


# ---------------------------------------------------------------- the kernel


@dataclass(frozen=True)
class ExactKernel:
    """Bounded kernel: its extreme points and what follows from them. `measure` is 0 unless it is solid."""

    dimension: int
    vertices: tuple[Point, ...]
    volume: Fraction
    centroid: Point | None
    """Of the volume, the flat polygon, the segment or the point; None when empty."""


def kernel(planes: Iterable[Plane | None]) -> ExactKernel:
    """Intersection of the half-spaces, which must be bounded or empty (add `box_planes` if it is not)."""
    planes = tightest(planes)
    found, has_ray = _vertices(planes)
    if has_ray or (not found and not _is_empty_without_vertex(planes)):
        raise ValueError("the intersection is unbounded")
    if not found:
        return ExactKernel(-1, (), Fraction(0), None)
    vertices = tuple(sorted(found))
    dimension = _dimension(vertices)
    volume = Fraction(0)
    if dimension == 3:
        volume, centroid = _volume_and_centroid(vertices, planes)
    elif dimension == 2:
        centroid = _flat_centroid(vertices)
    else:
        centroid = _mean(vertices)
    return ExactKernel(dimension, vertices, volume, centroid)


def mesh_kernel(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], extra: Iterable[Plane | None] = ()
) -> ExactKernel:
    """Kernel of a triangle mesh, and of further planes."""
    return kernel([*corner_planes(vertices, faces), *extra])


def is_bounded(planes: Iterable[Plane | None]) -> bool:
    """Whether no direction u has n . u <= 0 for all planes: no intersection of such planes is unbounded."""
    cone = [(a, b, c, 0) for a, b, c, _ in (p for p in planes if p is not None)]
    directions, _ = _vertices(tightest([*cone, *box_planes((-1, -1, -1), (1, 1, 1))]))
    return directions == {(Fraction(0),) * 3}


def _vertices(planes: Sequence[Plane]) -> tuple[set[Point], bool]:
    """All vertices, and whether an edge goes on for ever."""
    found: set[Point] = set()
    has_ray = False
    for p, q in combinations(planes, 2):
        ends = _line_ends(p, q, planes)
        if ends is not None:
            found.update(ends)
            has_ray |= len(ends) < 2
    return found, has_ray


def _line_ends(p: Plane, q: Plane, planes: Sequence[Plane]) -> list[Point] | None:
    """What the half-spaces leave of the line in which two planes meet: its finite ends."""
    u = _cross(p[:3], q[:3])
    uu = _dot(u, u)
    if uu == 0:
        return None
    # foot point (d_p (n_q x u) + d_q (u x n_p)) / (u . u), as integers over uu
    first, second = _cross(q[:3], u), _cross(u, p[:3])
    foot = tuple(p[3] * first[k] + q[3] * second[k] for k in range(3))
    low: tuple[int, int] | None = None  # t as numerator, positive denominator
    high: tuple[int, int] | None = None
    for a, b, c, d in planes:
        rate = a * u[0] + b * u[1] + c * u[2]
        room = d * uu - (a * foot[0] + b * foot[1] + c * foot[2])  # rate * t * uu <= room
        if rate == 0:
            if room < 0:
                return None
        elif rate > 0:
            if high is None or room * high[1] < high[0] * rate:
                high = (room, rate)
        elif low is None or -room * low[1] > low[0] * -rate:
            low = (-room, -rate)
        if low is not None and high is not None and low[0] * high[1] > high[0] * low[1]:
            return None
    ends = []
    for t in (low, high):
        if t is not None:
            x, y, z = (Fraction(foot[k] * t[1] + u[k] * t[0], uu * t[1]) for k in range(3))
            ends.append((x, y, z))
    return ends


def _is_empty_without_vertex(planes: Sequence[Plane]) -> bool:
    """Empty, given that there is no vertex: a non-empty intersection without vertex holds a line."""
    normals: list[Point] = [(Fraction(0),) * 3, *(point(p[:3]) for p in planes)]
    return _dimension(normals) == 3 or helly_witness(planes) is not None


def _dimension(points: Sequence[Point]) -> int:
    rows = [list(_minus(p, points[0])) for p in points[1:]]
    rank = 0
    for column in range(3):
        pivot = next((r for r in rows[rank:] if r[column]), None)
        if pivot is None:
            continue
        rows.remove(pivot)
        for i in range(rank, len(rows)):
            factor = rows[i][column] / pivot[column]
            rows[i] = [x - factor * y for x, y in zip(rows[i], pivot, strict=True)]
        rows.insert(rank, pivot)
        rank += 1
    return rank


def ordered_face(points: Sequence[Point], normal: Sequence[Any]) -> list[Point]:
    """Corners of a convex polygon in order round it: a planar hull in the projection along an axis."""
    axis = max(range(3), key=lambda k: abs(normal[k]))
    u, v = [k for k in range(3) if k != axis]

    def half(ordered: Sequence[Point]) -> list[Point]:
        chain: list[Point] = []
        for r in ordered:
            while len(chain) > 1:
                p, q = chain[-2], chain[-1]
                if (q[u] - p[u]) * (r[v] - p[v]) - (q[v] - p[v]) * (r[u] - p[u]) > 0:
                    break
                chain.pop()
            chain.append(r)
        return chain[:-1]

    ordered = sorted(points, key=lambda p: (p[u], p[v]))
    return half(ordered) + half(ordered[::-1])


def _volume_and_centroid(vertices: Sequence[Point], planes: Sequence[Plane]) -> tuple[Fraction, Point]:
    """Sum over tetrahedra from the first vertex to a fan of every face."""
    origin = vertices[0]
    volume6, moment = Fraction(0), [Fraction(0)] * 3
    for p in planes:
        corners = [x for x in vertices if side(p, x) == 0]
        if len(corners) < 3 or _dimension(corners) < 2:
            continue
        loop = ordered_face(corners, p[:3])
        for a, b in pairwise(loop[1:]):
            part = abs(_dot(_minus(loop[0], origin), _cross(_minus(a, origin), _minus(b, origin))))
            volume6 += part
            for k in range(3):
                moment[k] += part * (origin[k] + loop[0][k] + a[k] + b[k]) / 4
    return volume6 / 6, (moment[0] / volume6, moment[1] / volume6, moment[2] / volume6)


def _flat_centroid(vertices: Sequence[Point]) -> Point:
    normal = next(
        n
        for a, b in combinations(vertices[1:], 2)
        if any(n := _cross(_minus(a, vertices[0]), _minus(b, vertices[0])))
    )
    axis = max(range(3), key=lambda k: abs(normal[k]))
    loop = ordered_face(vertices, normal)
    area, moment = Fraction(0), [Fraction(0)] * 3
    for a, b in pairwise(loop[1:]):
        part = abs(_cross(_minus(a, loop[0]), _minus(b, loop[0]))[axis])
        area += part
        for k in range(3):
            moment[k] += part * (loop[0][k] + a[k] + b[k]) / 3
    return moment[0] / area, moment[1] / area, moment[2] / area


# ---------------------------------------------------------------- emptiness


def helly_witness(planes: Sequence[Plane | None]) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Ids of at most four planes without a common point, and integers l > 0: sum l n = 0, sum l d < 0."""
    kept = [(i, p) for i, p in enumerate(planes) if p is not None]
    for size in (2, 3, 4):
        for group in combinations(kept, size):
            weights = _balance([p for _, p in group])
            if weights is not None and sum(w * p[3] for w, (_, p) in zip(weights, group, strict=True)) < 0:
                return tuple(i for i, _ in group), weights
    return None


def is_empty_witness(planes: Sequence[Plane], multipliers: Sequence[int]) -> bool:
    """Whether the multipliers prove that the planes have no common point."""
    if len(planes) != len(multipliers) or not planes or min(multipliers) < 0:
        return False
    sums = [sum(w * p[k] for w, p in zip(multipliers, planes, strict=True)) for k in range(4)]
    return sums[:3] == [0, 0, 0] and sums[3] < 0


def _balance(planes: Sequence[Plane]) -> tuple[int, ...] | None:
    """Positive integers with sum l n = 0, if the normals have exactly one such combination of all."""
    normals = [p[:3] for p in planes]
    if len(normals) == 2:
        a, b = normals
        if any(_cross(a, b)) or _dot(a, b) >= 0:
            return None
        weights = [sum(map(abs, b)), sum(map(abs, a))]
    elif len(normals) == 3:
        a, b, c = normals
        crosses = [_cross(b, c), _cross(c, a), _cross(a, b)]
        axis = next((k for k in range(3) if crosses[0][k]), None)
        if axis is None:
            return None
        weights = [cross[axis] for cross in crosses]
    else:
        a, b, c, d = normals
        weights = [_dot(b, _cross(d, c)), _dot(a, _cross(c, d)), _dot(a, _cross(d, b)), _dot(a, _cross(b, c))]
    if all(w < 0 for w in weights):
        weights = [-w for w in weights]
    if min(weights) <= 0 or any(
        sum(w * n[k] for w, n in zip(weights, normals, strict=True)) for k in range(3)
    ):
        return None
    divisor = gcd(*weights)
    return tuple(w // divisor for w in weights)


# ---------------------------------------------------------------- larger solid kernels: one cut at a time


def clipped(
    planes: Iterable[Plane | None], lower: Sequence[Any], upper: Sequence[Any]
) -> list[tuple[Plane, list[Point]]]:
    """Faces (plane, ordered corners) of the box cut by every plane; empty list when nothing solid is left.

    A second way to the same answer, for thousands of planes (the tightest first are the fastest); it does not
    tell flat from empty.
    """
    x0, y0, z0 = point(lower)
    x1, y1, z1 = point(upper)
    corners = [(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)]
    faces = [
        (p, ordered_face([c for c in corners if side(p, c) == 0], p[:3])) for p in box_planes(lower, upper)
    ]
    corners = sorted({c for _, loop in faces for c in loop})
    whole = [_homogeneous(c) for c in corners]
    for p in tightest(planes):
        values = [p[0] * x + p[1] * y + p[2] * z - p[3] * w for x, y, z, w in whole]
        if max(values) <= 0:
            continue
        sides = {c: (value > 0) - (value < 0) for c, value in zip(corners, values, strict=True)}
        if all(s >= 0 for s in sides.values()):
            return []
        cut: set[Point] = set()
        kept = []
        for q, loop in faces:
            rest: list[Point] = []
            for a, b in zip(loop, [*loop[1:], loop[0]], strict=True):
                if sides[a] <= 0:
                    rest.append(a)
                    if sides[a] == 0:
                        cut.add(a)
                if sides[a] * sides[b] < 0:
                    rest.append(_meeting(p, a, b))
                    cut.add(rest[-1])
            if len(rest) > 2 and _dimension(rest) == 2:
                kept.append((q, rest))
        if len(cut) > 2 and _dimension(sorted(cut)) == 2:
            kept.append((p, ordered_face(sorted(cut), p[:3])))
        faces = kept
        corners = sorted({c for _, loop in faces for c in loop})
        whole = [_homogeneous(c) for c in corners]
    return faces


def _homogeneous(p: Point) -> Plane:
    """Integers (x, y, z, w) with p = (x, y, z) / w and w > 0: products without common divisors to look for."""
    w = lcm(*(v.denominator for v in p))
    return int(p[0] * w), int(p[1] * w), int(p[2] * w), w


def solid_volume(faces: Sequence[tuple[Plane, list[Point]]]) -> Fraction:
    """Volume of the polytope with these faces."""
    if not faces:
        return Fraction(0)
    origin = faces[0][1][0]
    return sum(
        (
            abs(_dot(_minus(loop[0], origin), _cross(_minus(a, origin), _minus(b, origin)))) / 6
            for _, loop in faces
            for a, b in pairwise(loop[1:])
        ),
        Fraction(0),
    )


def _meeting(p: Plane, a: Point, b: Point) -> Point:
    da, db = _dot(p[:3], a) - p[3], _dot(p[:3], b) - p[3]
    t = da / (da - db)
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


# ---------------------------------------------------------------- other truths


def enclosed_volume(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Fraction:
    """Signed volume of a closed triangle mesh."""
    exact = [point(v) for v in vertices]
    return sum((_dot(exact[a], _cross(exact[b], exact[c])) for a, b, c in faces.tolist()), Fraction(0)) / 6


def violation(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of the area whose plane has the point in front of it, one facet after the other, in floats."""
    normals, offsets, areas = float_planes(vertices, faces)
    total = np.zeros(len(points))
    for normal, offset, area in zip(normals, offsets, areas, strict=True):
        total += area * (points @ normal > offset)
    return total / areas.sum()


def float_planes(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals, offsets and areas of the triangles that have an area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    keep = length > 0
    normals = normals[keep] / length[keep, None]
    return normals, np.einsum("ij,ij->i", normals, a[keep]), length[keep] / 2


def dense_kernel(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], xyz: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Every facet against every point: the discrete kernel of Werghi 2008."""
    normals, offsets, _ = float_planes(vertices, faces)
    seen = np.ones(len(xyz), dtype=bool)
    for normal, offset in zip(normals, offsets, strict=True):
        seen &= xyz @ normal <= offset
    return seen


def lattice(lower: Sequence[float], upper: Sequence[float], n: int) -> NDArray[np.float64]:
    """The n^3 cell centres of a box."""
    axes = [lo + (np.arange(n) + 0.5) * (hi - lo) / n for lo, hi in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def sample_points(corners: Sequence[Point], rng: np.random.Generator, n: int) -> Iterator[Point]:
    """Random rational convex combinations of the corners; none when there are none."""
    for _ in range(n if corners else 0):
        weights = [int(w) for w in rng.integers(0, 100, len(corners))]
        total = sum(weights) or 1
        weights[0] += sum(weights) == 0
        pairs = list(zip(weights, corners, strict=True))
        x, y, z = (sum((w * c[k] for w, c in pairs), Fraction(0)) / total for k in range(3))
        yield x, y, z


# ---------------------------------------------------------------- vectors of integers or fractions


def _minus(a: Sequence[Any], b: Sequence[Any]) -> tuple[Any, Any, Any]:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[Any], b: Sequence[Any]) -> tuple[Any, Any, Any]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _mean(points: Sequence[Point]) -> Point:
    n = len(points)
    x, y, z = (sum((p[k] for p in points), Fraction(0)) / n for k in range(3))
    return x, y, z
