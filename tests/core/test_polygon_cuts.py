"""The cut of polygons, bit for bit that of a twin in NumPy which works on all polygons of one size at once."""

import numpy as np
import pytest

from voxkernel import TriangleMesh
from voxkernel._core import cut_polygons
from voxkernel.errors import MeshError
from voxkernel.mesh.polygons import _ears, polygon_planes
from voxkernel.mesh.triangles import scale_exponent, triangle_areas, unscaled


def dot(u, v):
    """The order of the sum is part of the rule: it breaks ties."""
    return u[..., 0] * v[..., 0] + u[..., 2] * v[..., 2] + u[..., 1] * v[..., 1]


def length(u):
    return np.sqrt(u[..., 0] ** 2 + u[..., 1] ** 2 + u[..., 2] ** 2)


def farthest(local, point):
    gap = local - point[:, None]
    square = dot(gap, gap)
    at = square.argmax(axis=1)
    return at, square[np.arange(len(local)), at]


def diameters(local):
    m, size = local.shape[:2]
    rows = np.arange(m)
    i, j, best = np.zeros(m, np.int64), np.ones(m, np.int64), np.full(m, -1.0)
    if size <= 256:
        for shift in range(1, size // 2 + 1):
            gap = local - np.roll(local, -shift, axis=1)
            square = dot(gap, gap)
            at = square.argmax(axis=1)
            better = square[rows, at] > best
            best[better] = square[rows, at][better]
            i[better], j[better] = at[better], (at[better] + shift) % size
        return i, j, best
    source = farthest(local, np.cumsum(local, axis=1)[:, -1] / size)[0]
    for _ in range(32):
        at, square = farthest(local, local[rows, source])
        better = square > best
        if not better.any():
            break
        best[better], i[better], j[better] = square[better], source[better], at[better]
        source = np.where(better, at, source)
    return i, j, best


def planes(loops, local, newell, rtol):
    rows = np.arange(len(loops))
    i, j, best = diameters(local)
    base = local[rows, i]
    across = np.cross((local[rows, j] - base)[:, None], local - base[:, None])
    k = dot(across, across).argmax(axis=1)
    normal = across[rows, k]
    flipped = dot(normal, newell) < 0.0
    corners = np.stack([loops[rows, i], loops[rows, j], loops[rows, k]], axis=1)
    corners[flipped] = corners[flipped][:, [1, 0, 2]]
    height = np.abs(dot(normal[:, None], local - base[:, None])).max(axis=1)
    planar = height <= rtol * np.sqrt(best) * length(normal)
    sideless = length(newell) <= 1e-12 * length(normal)
    return planar & ~(sideless & (length(normal) > 0.0)), corners


def triangulated(loops, local, newell, ids):
    size = loops.shape[1]
    fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
    found = loops[:, fan]
    left = np.arange(len(loops))
    for apex in range(2):
        corners = np.roll(local[left], -apex, axis=1)
        spokes = np.cross(corners[:, 1:-1] - corners[:, :1], corners[:, 2:] - corners[:, :1])
        good = (dot(spokes, newell[left, None]) > 1e-14 * dot(newell, newell)[left, None]).all(axis=1)
        found[left[good]] = np.roll(loops[left[good]], -apex, axis=1)[:, fan]
        left = left[~good]
    for row in left if size > 4 else ():
        found[row] = loops[row][_ears(loops[row], local[row], newell[row], int(ids[row]))]
    return found


def twin(points, flat, sizes, rtol):
    exponent = scale_exponent(points)
    points = np.ldexp(points, -exponent)
    starts, first = np.cumsum(sizes) - sizes, np.cumsum(sizes - 2) - sizes + 2
    triangles, corners = np.empty((int((sizes - 2).sum()), 3), np.int64), np.empty((len(sizes), 3), np.int64)
    planar, areas = np.ones(len(sizes), bool), np.empty(len(sizes))
    for size in np.unique(sizes):
        ids = np.flatnonzero(sizes == size)
        loops = flat[starts[ids, None] + np.arange(size)]
        local = points[loops] - points[loops[:, :1]]
        newell = 0.5 * np.cumsum(np.cross(local, np.roll(local, -1, axis=1)), axis=1)[:, -1]
        corners[ids] = loops[:, :3]
        if size > 3:
            planar[ids], corners[ids] = planes(loops, local, newell, rtol)
        areas[ids] = unscaled(length(newell), 2 * exponent)
        cut = loops[:, None] if size == 3 else triangulated(loops, local, newell, ids)
        triangles[first[ids, None] + np.arange(size - 2)] = cut
    facet_ids = np.repeat(np.arange(len(sizes)), sizes - 2)
    plane_facets = np.repeat(np.arange(len(sizes)), np.where(planar, 1, sizes - 2))
    whole = planar[plane_facets]
    plane_corners, plane_areas = np.empty((len(whole), 3), np.int64), np.empty(len(whole))
    plane_corners[whole], plane_areas[whole] = corners[planar], areas[planar]
    if not planar.all():
        plane_corners[~whole] = triangles[~planar[facet_ids]]
        plane_areas[~whole] = unscaled(triangle_areas(points, plane_corners[~whole]), 2 * exponent)
    return triangles, facet_ids, plane_corners, plane_facets, plane_areas, np.flatnonzero(~planar)


def ring(rng, size, kind):
    """Corners of one polygon: convex, a star, a regular one with ties, or a square with straight corners and a dent."""
    angle = 2 * np.pi * (np.arange(size) / size if kind == "regular" else np.sort(rng.random(size)))
    radius = 0.1 + rng.random(size) if kind == "star" else np.ones(size)
    flat = np.c_[radius * np.cos(angle), radius * np.sin(angle)]
    if kind == "straight":
        flat = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]], float)[:size]
        flat[rng.integers(len(flat))] = [1, 1]
    flat = flat[:: rng.choice([-1, 1])]
    height = rng.choice([0.0, 1.0]) * 10.0 ** rng.integers(-14, 1) * rng.normal(size=len(flat))
    corners = np.c_[flat, height]
    if rng.random() < 0.2:
        return corners[[0]] * np.linspace(0, 1, len(flat))[:, None]  # a line
    if rng.random() < 0.5:
        return corners
    return corners @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T + rng.normal(size=3)


def made(rng, kind):
    """Points and polygons: corners of their own, or any corners of a few points, some of them twice in a row."""
    if kind in ("convex", "star", "regular", "straight", "again"):
        sizes = rng.choice([3, 4, 4, 5, 6, 8, 20, 300] if kind == "star" else [3, 4, 4, 5, 6, 8], 30)
        rings = [ring(rng, size, kind) for size in sizes]
        loops = np.split(np.arange(sum(map(len, rings))), np.cumsum([len(one) for one in rings])[:-1])
        if kind == "again":
            loops = [np.repeat(loop, 1 + (rng.random(len(loop)) < 0.1)) for loop in loops]
        return np.concatenate(rings), np.concatenate(loops), np.array([len(loop) for loop in loops])
    points = rng.integers(-2, 3, (200, 3)).astype(float)
    if kind == "scales":
        points *= 10.0 ** rng.integers(-320, 300, (200, 1))
    if kind == "flat":
        points[:, 2] = 0
    loops = [rng.choice(200, rng.choice([3, 4, 5, 7]), replace=False) for _ in range(30)]
    return points, np.concatenate(loops), np.array([len(loop) for loop in loops])


def outcome(cut, *arguments):
    try:
        return cut(*arguments)
    except MeshError as error:
        return str(error)


KINDS = ["convex", "star", "regular", "straight", "whole", "flat", "scales", "again"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rtol", [1e-9, 0.0, 1e-3])
def test_as_the_twin(kind, rtol):
    n_compared = n_ears = 0
    for seed in range(20):
        points, flat, sizes = made(np.random.default_rng([seed, KINDS.index(kind)]), kind)
        expected, found = outcome(twin, points, flat, sizes, rtol), outcome(polygon_planes, points, flat, sizes, rtol)
        if isinstance(expected, str):
            assert found == expected
            continue
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        n_compared += 1
        n_ears += len(cut_polygons(points, flat, sizes, scale_exponent(points), rtol)[-1])
    assert n_compared > 4
    assert n_ears > 0 or kind in ("convex", "regular")


@pytest.mark.parametrize("exponent", [-1070, -600, 0, 900, 1020])
def test_no_scale_is_too_small_or_too_large(exponent):
    """A prism of whole numbers times a power of two: the same cut, areas that are infinite or lost as floats are."""
    square, bent = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], [[0, 0, 2], [2, 0, 2], [2, 2, 3], [0, 2, 2]]
    points = np.array(square + bent, float)
    polygons = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4]]
    plain = TriangleMesh.from_polygons(points, polygons)
    mesh = TriangleMesh.from_polygons(np.ldexp(points, exponent), polygons)
    assert mesh.nonplanar_facets.tolist() == [1]
    for name in ("faces", "plane_corners", "plane_facets"):
        np.testing.assert_array_equal(getattr(mesh, name), getattr(plain, name))
    np.testing.assert_array_equal(mesh.plane_areas, unscaled(plain.plane_areas, 2 * exponent))
