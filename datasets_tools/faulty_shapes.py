"""Surfaces by formula that are not star-shaped, or barely: near-star, non-star, thin and flat kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import shape_formulas as sf
from known_shapes import Shape, affine, bumpy_sphere, dyadic, exactly, similar
from shape_formulas import Surface

_FLAT = 40


# ---------------------------------------------------------------- near-star: a small fault of known weight
#
# Each fault is a set of facets whose half-spaces have no common point, so every point of space violates one of
# them: the defect is at least the lightest way to violate them. For each an open set of points reaches that.


def _share(surface: Surface, *groups: Any) -> float:
    """Lightest of some groups of triangles, as a share of the whole area."""
    weights = sf.areas(surface)
    return float(min(weights[group].sum() for group in groups) / weights.sum())


def _levels_at(surface: Surface, axis: int, level: float, sign: int) -> Any:
    """Triangles in the plane x_axis = level whose normal has this sign."""
    vertices, faces = surface
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    on = (vertices[faces][:, :, axis] == level).all(axis=1)
    return on & (np.sign(np.cross(b - a, c - a)[:, axis]) == sign)


def _groove(rng: np.random.Generator, facets: int) -> Shape:
    """Block with an undercut groove along z in its top y = 0: mouth half width a, floor half width b >= a, depth p.

    Its walls ask for x <= -a + (b - a) y / p and x >= a - (b - a) y / p, which together need y > 0 (for b = a they
    exclude each other), and the top asks for y <= 0. So every point violates a wall or the top. A point below the
    floor, left of the left wall and inside the block violates only the right wall: the defect is a wall's share,
    both walls being equal and the top larger.
    """
    p = float(np.exp(rng.uniform(np.log(0.01), np.log(0.8))))
    a = float(rng.uniform(0.3, 1.0)) * p
    b = a + float(rng.uniform(0.0, 0.8)) * p
    wide, deep, long = 6.0, 4.0, float(rng.uniform(1.0, 4.0))
    polygon = [(-wide, -deep), (wide, -deep), (wide, 0), (a, 0), (b, -p), (-b, -p), (-a, 0), (-wide, 0)]
    surface = sf.prism(polygon, long)
    weights = sf.areas(surface)
    wall = long * float(np.hypot(b - a, p))
    parameters = {"mouth": a, "floor": b, "depth": p}
    return similar(Shape(sf.refined(surface, facets), -1, 0.0, wall / float(weights.sum()), parameters), rng)


def _shelf(rng: np.random.Generator, facets: int) -> Shape:
    """Prism over an S: a floor at y = 0 (2 <= x <= 2 + w) asks for y >= 0, a ceiling at y = -e (0 <= x <= 1) for
    y <= -e. Every point violates one; those with 1 < x < 2 and y < -e only the floor, with y > 0 only the ceiling.
    """
    w = float(np.exp(rng.uniform(np.log(0.01), np.log(2.0))))
    e, high = float(rng.uniform(0.05, 0.5)), float(rng.uniform(0.5, 2.0))

    def solid(x: Any, y: Any, z: Any) -> Any:
        return np.where(x < 1, y < -e, np.where(x < 2, True, y > 0))

    surface = sf.refined(sf.blocks((0, 1, 2, 2 + w), (-1, -e, 0, 1), (0, high), solid), facets)
    defect = _share(surface, _levels_at(surface, 1, 0.0, -1), _levels_at(surface, 1, -e, 1))
    return similar(Shape(surface, -1, 0.0, defect, {"floor": w, "overlap": e}), rng)


def _flipped_bump(rng: np.random.Generator, facets: int) -> Shape:
    """Box with a pyramid on top whose facets are turned over, as one finds in scans.

    A turned facet asks for the outer side of its plane. Two opposite ones hold together only at the height of the
    tip and above, and the rest of the top asks for points below. So every point violates the top or one of each
    pair; deep in a corner of the box exactly two are violated: the defect is half the pyramid's share.
    """
    half = [float(rng.uniform(1.0, 2.0)) for _ in range(3)]
    reach = float(np.exp(rng.uniform(np.log(0.03), np.log(0.4))))
    height = reach * float(rng.uniform(0.5, 2.0))
    surface, bump = sf.bumped_box(half, reach, height)
    weights = sf.areas(surface)
    defect = float(weights[bump].sum() / 2.0 / weights.sum())
    surface[1][bump] = surface[1][bump][:, ::-1]
    return similar(Shape(sf.refined(surface, facets), -1, 0.0, defect, {"reach": reach, "height": height}), rng)


def _bubble(rng: np.random.Generator, facets: int) -> Shape:
    """Radial surface about the origin with a cavity in the shape of a slim tetrahedron, its tip towards the origin.

    The cavity's facets ask for the outer sides of the tetrahedron's planes; beyond all four there is no point
    (positive multiples of the normals sum to 0), so every point violates a facet, and the far one is the smallest
    since the height is at least 1.5 times the radius of the base. At the origin, which is beyond the tip and
    inside all planes of the outer surface, that is the only one.
    """
    outer = bumpy_sphere(rng, facets).surface if rng.random() < 0.5 else sf.mapped(
        sf.sphere_for(facets), np.diag(rng.uniform(0.6, 1.6, 3)), np.zeros(3))  # fmt: skip
    outer = sf.mapped(outer, np.eye(3), -outer[0].mean(axis=0)) if sf.distance_inside(outer) <= 0 else outer
    depth = sf.distance_inside(outer)
    radius = depth * float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
    height = radius * float(rng.uniform(1.5, 2.0))
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    base = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(3, 0.25 * depth + height)], axis=1)
    tetrahedron = np.concatenate([base, [(0.0, 0.0, 0.25 * depth)]])
    inward = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])  # counter-clockwise seen from the cavity
    surface = sf.joined(outer, sf.mapped((tetrahedron, inward), sf.rotation(rng), np.zeros(3)))
    far = np.arange(len(surface[1])) == len(outer[1])
    return similar(Shape(surface, -1, 0.0, _share(surface, far), {"radius": radius / depth}), rng)


# ---------------------------------------------------------------- not star-shaped


def _torus(rng: np.random.Generator, facets: int) -> Shape:
    """With even numbers of rows, each facet about the hole has three mirror images whose normals cancel, and the
    middle of the hole is on the outer side of all four: they have no common point.
    """
    minor = float(rng.uniform(0.15, 0.6))
    n = max(3, round((facets / 16) ** 0.5))
    return affine(Shape(sf.torus(1.0, minor, 4 * n, 2 * n), -1, 0.0, None, {"minor": minor}), rng)


def _two_boxes(rng: np.random.Generator, facets: int) -> Shape:
    """Side by side along x: the sides that face each other exclude each other, and a point inside one box, level
    with the other, violates one of them alone.
    """
    y, z = (float(rng.uniform(0.5, 1.5)) for _ in range(2))
    part, gap = float(rng.uniform(0.2, 0.9)), float(rng.uniform(0.2, 2.0))

    def solid(cx: Any, cy: Any, cz: Any) -> Any:
        return (cx < 0) | ((cx > gap) & (np.abs(cy) < part * y) & (np.abs(cz) < part * z))

    grids = (-2, 0, gap, gap + 2), (-y, -part * y, part * y, y), (-z, -part * z, part * z, z)
    surface = sf.refined(sf.blocks(*grids, solid), facets)
    return similar(Shape(surface, -1, 0.0, _share(surface, _levels_at(surface, 0, gap, -1)), {"gap": gap}), rng)


def _u_shape(rng: np.random.Generator, facets: int) -> Shape:
    """Two arms of different height on a base: their inner walls x <= 1 and x >= 1 + gap exclude each other; below
    the lower end of the walls and on one side of both, one of them is the only one violated.
    """
    gap, high, low, long = float(rng.uniform(0.3, 2)), float(rng.uniform(1, 2)), float(rng.uniform(1, 2)), 1.5
    end = 2.0 + gap

    def solid(x: Any, y: Any, z: Any) -> Any:
        return np.where(x < 1, y < high, np.where(x > 1 + gap, y < low, y < 0))

    surface = sf.refined(sf.blocks((0, 1, 1 + gap, end), (-1, 0, high, low), (0, long), solid), facets)
    walls = _levels_at(surface, 0, 1.0, 1), _levels_at(surface, 0, 1 + gap, -1)
    return similar(Shape(surface, -1, 0.0, _share(surface, *walls), {"gap": gap, "arms": [high, low]}), rng)


def _spiral(rng: np.random.Generator, facets: int) -> Shape:
    """Square spiral of width 1 with gaps of 1; walls on both sides of a gap exclude each other."""
    turns = int(rng.integers(2, 5))
    cells, at, step = {(0, 0)}, np.array([0, 0]), np.array([1, 0])
    for k in range(2, 2 * turns + 3):
        for _ in range(2 * (k // 2)):
            at = at + step
            cells.add((int(at[0]), int(at[1])))
        step = np.array([-step[1], step[0]])
    filled = np.zeros((4 * turns + 9, 4 * turns + 9), dtype=bool)
    x, y = (np.array(sorted(cells)) + 2 * turns + 4).T
    filled[x, y] = True
    grid = np.arange(4 * turns + 10) - 2 * turns - 4

    def solid(cx: Any, cy: Any, cz: Any) -> Any:
        return filled[np.floor(cx).astype(int) + 2 * turns + 4, np.floor(cy).astype(int) + 2 * turns + 4]

    surface = sf.refined(sf.blocks(grid, grid, (0, 2), solid), facets)
    return affine(Shape(surface, -1, 0.0, None, {"turns": turns}), rng)


# ---------------------------------------------------------------- thin and flat kernels: exact coordinates


def _thin_s(rng: np.random.Generator, facets: int, slit: float) -> Shape:
    """Prism over an S with its shelves at y = 0 and y = slit: the kernel is [1, 1 + w] x [0, slit] x [0, h]; for
    slit < 0 it is empty, and the smaller shelf is the smallest violation as for `_shelf`.
    """
    w, h = dyadic(rng, 0.5, 1.5), dyadic(rng, 0.5, 1.5)

    def solid(x: Any, y: Any, z: Any) -> Any:
        return np.where(x < 1, y < slit, np.where(x < 1 + w, True, y > 0))

    surface = sf.refined(sf.blocks((0, 1, 1 + w, 2 + w), (-1, 0, slit, 1), (0, h), solid), facets)
    dimension = -1 if slit < 0 else 2 if slit == 0 else 3
    shelves = _levels_at(surface, 1, 0.0, -1), _levels_at(surface, 1, slit, 1)
    defect = _share(surface, *shelves) if slit < 0 else 0.0
    return exactly(Shape(surface, dimension, w * h * max(slit, 0.0), defect, {"slit": slit, "width": w}), rng)


def _thin_solid(rng: np.random.Generator, facets: int) -> Shape:
    return _thin_s(rng, facets, 2.0 ** -int(rng.integers(5, _FLAT)))


def _flat_kernel(rng: np.random.Generator, facets: int) -> Shape:
    return _thin_s(rng, facets, 0.0)


def _shut(rng: np.random.Generator, facets: int) -> Shape:
    return _thin_s(rng, facets, -(2.0 ** -int(rng.integers(5, _FLAT))))


def _segment(rng: np.random.Generator, facets: int) -> Shape:
    """Prism over a saw blade whose four radial edges lie on the axes and ask for x >= 0, x <= 0, y >= 0, y <= 0."""
    i = [dyadic(rng, 0.5, 1) for _ in range(4)]
    o = [dyadic(rng, 1.25, 3) for _ in range(4)]
    polygon = [(i[0], 0), (0, o[1]), (0, i[1]), (-o[2], 0), (-i[2], 0), (0, -o[3]), (0, -i[3]), (o[0], 0)]
    return exactly(Shape(sf.refined(sf.prism(polygon, 1.0), facets), 1, 0.0, 0.0, {"inner": i, "outer": o}), rng)


def _twice_notched(rng: np.random.Generator, facets: int, slit: float) -> Shape:
    """Box about the origin without the corners beyond (slit, slit, slit) and below (0, 0, 0): [0, slit]^3."""
    x, y, z = (dyadic(rng, 0.5, 2) for _ in range(3))

    def solid(cx: Any, cy: Any, cz: Any) -> Any:
        upper = (cx > slit) & (cy > slit) & (cz > slit)
        return ~(upper | ((cx < 0) & (cy < 0) & (cz < 0)))

    surface = sf.refined(sf.blocks((-x, 0, slit, x), (-y, 0, slit, y), (-z, 0, slit, z), solid), facets)
    return exactly(Shape(surface, 3 if slit else 0, slit**3, 0.0, {"slit": slit, "half": [x, y, z]}), rng)


def _point(rng: np.random.Generator, facets: int) -> Shape:
    return _twice_notched(rng, facets, 0.0)


def _tiny_cube(rng: np.random.Generator, facets: int) -> Shape:
    return _twice_notched(rng, facets, 2.0 ** -int(rng.integers(3, 30)))


NEAR_STAR = {"groove": _groove, "shelf": _shelf, "flipped-bump": _flipped_bump, "bubble": _bubble}
NON_STAR = {"torus": _torus, "two-boxes": _two_boxes, "u-shape": _u_shape, "spiral": _spiral}
THIN = {
    "thin-solid": _thin_solid, "tiny-cube": _tiny_cube, "polygon": _flat_kernel, "segment": _segment,
    "point": _point, "shut": _shut,
}  # fmt: skip
