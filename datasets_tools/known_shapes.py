"""Convex, star-shaped and open surfaces by formula, with what is known about their kernels by construction.

The kernel moves with any invertible affine map, since half-spaces do: surfaces whose truth is a volume are placed
by random affine maps, those whose truth is an area share by random similarities, and those whose kernel is flat
only by maps that are exact on doubles (quarter turns, powers of two, short dyadic shifts).
"""

from __future__ import annotations

import functools
import operator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shape_formulas as sf
from shape_formulas import Surface


@dataclass(frozen=True, slots=True)
class Shape:
    """A surface and what is known about it.

    Attributes
    ----------
    surface : (vertices, faces)
        As arrays.
    dimension : int or None
        Of the kernel, -1 when empty; None when not known.
    kernel_volume : float or None
        None when not known or infinite.
    defect : float or None
        Smallest share of the area that a point cannot face; 0 where the kernel is not empty.
    parameters : dict
        Numbers the shape was made from.
    """

    surface: Surface
    dimension: int | None
    kernel_volume: float | None = None
    defect: float | None = None
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def is_star_shaped(self) -> bool | None:
        """Whether the kernel is not empty."""
        return None if self.dimension is None else self.dimension >= 0


def dyadic(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a multiple of 1/64."""
    return int(rng.integers(round(low * 64), round(high * 64) + 1)) / 64.0


def affine(shape: Shape, rng: np.random.Generator) -> Shape:
    """Place at random by an affine map; volumes grow by its determinant, area shares are not kept."""
    linear = sf.rotation(rng) @ np.diag(rng.uniform(0.6, 1.6, 3)) @ sf.rotation(rng)
    volume = None if shape.kernel_volume is None else shape.kernel_volume * float(np.linalg.det(linear))
    surface = sf.mapped(shape.surface, linear, rng.uniform(-2.0, 2.0, 3))
    defect = 0.0 if shape.dimension is not None and shape.dimension >= 0 else None
    return Shape(surface, shape.dimension, volume, defect, shape.parameters)


def similar(shape: Shape, rng: np.random.Generator) -> Shape:
    """Place at random by a similarity; area shares are kept."""
    scale = float(np.exp(rng.uniform(-0.7, 0.7)))
    volume = None if shape.kernel_volume is None else shape.kernel_volume * scale**3
    surface = sf.mapped(shape.surface, scale * sf.rotation(rng), rng.uniform(-2.0, 2.0, 3))
    return Shape(surface, shape.dimension, volume, shape.defect, shape.parameters)


def exactly(shape: Shape, rng: np.random.Generator) -> Shape:
    """Place by a quarter turn, a power of two and a small dyadic shift: no coordinate is rounded."""
    scale = 2.0 ** int(rng.integers(-1, 2))
    shift = np.array([dyadic(rng, -2, 2) for _ in range(3)])
    volume = None if shape.kernel_volume is None else shape.kernel_volume * scale**3
    surface = sf.mapped(shape.surface, scale * sf.quarter_turn(rng), shift)
    return Shape(surface, shape.dimension, volume, shape.defect, shape.parameters)


def convex(surface: Surface, rng: np.random.Generator, **parameters: Any) -> Shape:
    """The kernel of a convex solid is the solid."""
    return affine(Shape(surface, 3, sf.enclosed_volume(surface), 0.0, parameters), rng)


# ---------------------------------------------------------------- convex


def _box(rng: np.random.Generator, facets: int) -> Shape:
    half = [dyadic(rng, 0.5, 2) for _ in range(3)]
    return convex(sf.refined(sf.box(half), facets), rng, half=half)


def _ellipsoid(rng: np.random.Generator, facets: int) -> Shape:
    return convex(sf.sphere_for(facets), rng)


def _circle(n: int) -> list[tuple[float, float]]:
    return [(float(np.cos(t)), float(np.sin(t))) for t in 2.0 * np.pi * np.arange(n) / n]


def _convex_prism(rng: np.random.Generator, facets: int) -> Shape:
    n = int(rng.integers(3, 12))
    return convex(sf.refined(sf.prism(_circle(n), 1.5), facets), rng, corners=n)


def _convex_bipyramid(rng: np.random.Generator, facets: int) -> Shape:
    n = int(rng.integers(3, 12))
    return convex(sf.refined(sf.bipyramid(_circle(n), 1.25), facets), rng, corners=n)


# ---------------------------------------------------------------- star-shaped, kernels by formula


def _star_polygon(rng: np.random.Generator) -> tuple[list[tuple[float, float]], float, dict[str, Any]]:
    """Star with k tips at radius 1 about the origin, and the area of its kernel.

    The edge from the tip (1, 0) to the inner corner at angle pi / k and radius r has the distance d from the
    origin and its normal at an angle t; by symmetry the kernel is the polygon around the circle of radius d that
    touches it at the angles +-t + 2 pi j / k, 0 <= t <= pi / k, and a tangential polygon whose normals turn by s_i
    at its corners has the area d^2 sum tan(s_i / 2): here s = 2 t and 2 pi / k - 2 t.
    """
    k, r = int(rng.integers(5, 10)), float(rng.uniform(0.35, 0.7))
    inner = r * np.array([np.cos(np.pi / k), np.sin(np.pi / k)])
    edge = inner - (1.0, 0.0)
    d = float(edge[1] / np.hypot(*edge))  # the normal is (edge_y, -edge_x) / |edge|, and the tip is (1, 0)
    t = float(np.arctan2(-edge[0], edge[1])) % (2.0 * np.pi / k)
    t = min(t, 2.0 * np.pi / k - t)
    area = d**2 * k * (np.tan(t) + np.tan(np.pi / k - t))
    angle = np.pi * np.arange(2 * k) / k
    radius = np.where(np.arange(2 * k) % 2, r, 1.0)
    return list(zip(radius * np.cos(angle), radius * np.sin(angle), strict=True)), area, {"tips": k, "inner": r}


def _star_prism(rng: np.random.Generator, facets: int) -> Shape:
    polygon, area, parameters = _star_polygon(rng)
    return affine(Shape(sf.refined(sf.prism(polygon, 0.75), facets), 3, area * 0.75, 0.0, parameters), rng)


def _star_bipyramid(rng: np.random.Generator, facets: int) -> Shape:
    """The plane through an edge n . (x, y) = d and the tip (0, 0, h) is n . (x, y) / d + z / h = 1, so the kernel is
    the bipyramid of the same height over the polygon's kernel: 2 / 3 of area times height.
    """
    polygon, area, parameters = _star_polygon(rng)
    return affine(Shape(sf.refined(sf.bipyramid(polygon, 1.25), facets), 3, area * 2.5 / 3.0, 0.0, parameters), rng)


def _stellated_cube(rng: np.random.Generator, facets: int) -> Shape:
    """The cube [-1, 1]^3 with a pyramid of height t > 1 on each side.

    Its planes are |x| + t |y| = 1 + t and the same with the axes permuted. With the names of the two axes
    exchanged these are the planes of the cube with pyramids of height 1 / t, which is convex and so the kernel:
    8 + 6 (4 / 3) / t.
    """
    t = float(rng.uniform(1.2, 4.0))
    vertices, faces = sf.box((1, 1, 1))
    corners = [faces[np.abs(vertices[faces][:, :, k] - s).max(axis=1) == 0] for k in range(3) for s in (-1.0, 1.0)]
    rings = [[tri for tri in _fan(pair, 8 + i)] for i, pair in enumerate(corners)]
    tips = np.array([(1.0 + t) * s * np.eye(3)[k] for k in range(3) for s in (-1.0, 1.0)])
    surface = np.concatenate([vertices, tips]), np.array(functools.reduce(operator.iadd, rings, []), dtype=np.int64)
    return affine(Shape(sf.refined(surface, facets), 3, 8.0 + 8.0 / t, 0.0, {"height": t}), rng)


def _fan(pair: Any, tip: int) -> list[tuple[int, int, int]]:
    """Join the border of two triangles to a tip."""
    edges = [(int(f[i]), int(f[(i + 1) % 3])) for f in pair for i in range(3)]
    return [(a, b, tip) for a, b in edges if (b, a) not in edges]


def _notched_box(rng: np.random.Generator, facets: int) -> Shape:
    """The box [0, a] x [0, b] x [0, c] without the corner beyond (p, q, r), whose sides ask for x <= p, y <= q,
    z <= r: the kernel is the box [0, p] x [0, q] x [0, r].
    """
    outer = np.array([dyadic(rng, 1.5, 3) for _ in range(3)])
    p, q, r = (dyadic(rng, 0.5, 1.25) for _ in range(3))
    surface = sf.blocks(*zip((0, 0, 0), (p, q, r), outer, strict=True), lambda x, y, z: (x < p) | (y < q) | (z < r))
    return affine(Shape(sf.refined(surface, facets), 3, p * q * r, 0.0, {"notch": [p, q, r]}), rng)


def _cross(rng: np.random.Generator, facets: int) -> Shape:
    """Three bars of half width 1 through each other: each asks for the other two axes to be within 1."""
    a, b, c = (dyadic(rng, 1.5, 3) for _ in range(3))

    def solid(x: Any, y: Any, z: Any) -> Any:
        return sum((np.abs(v) < 1).astype(int) for v in (x, y, z)) >= 2

    surface = sf.blocks((-a, -1, 1, a), (-b, -1, 1, b), (-c, -1, 1, c), solid)
    return affine(Shape(sf.refined(surface, facets), 3, 8.0, 0.0, {"arms": [a, b, c]}), rng)


def bumpy_sphere(rng: np.random.Generator, facets: int) -> Shape:
    """Radial surface about the origin, which is inside every plane; the kernel's volume is not known."""
    directions, faces = sf.sphere_for(facets)
    axes = rng.standard_normal((6, 3)) * 2.5
    wave = np.cos(directions @ axes.T + rng.uniform(0, 2 * np.pi, 6)).mean(axis=1)
    depth = float(rng.uniform(0.2, 0.6))
    return similar(Shape((directions * np.exp(depth * wave)[:, None], faces), 3, None, 0.0, {"depth": depth}), rng)


def _urchin(rng: np.random.Generator, facets: int) -> Shape:
    """Ball with spikes, radial about the origin; the kernel's volume is not known."""
    directions, faces = sf.sphere_for(facets)
    n, length = int(rng.integers(4, 14)), float(rng.uniform(0.3, 1.2))
    axes = rng.standard_normal((n, 3))
    towards = directions @ (axes / np.linalg.norm(axes, axis=1, keepdims=True)).T
    radius = 1.0 + length * np.exp(30.0 * (towards - 1.0)).max(axis=1)
    return similar(Shape((directions * radius[:, None], faces), 3, None, 0.0, {"spikes": n, "length": length}), rng)


# ---------------------------------------------------------------- open surfaces: graphs, seen from far below


def _height_field(rng: np.random.Generator, facets: int) -> Shape:
    f, phase = rng.uniform(1.0, 6.0, (4, 2)), rng.uniform(0.0, 2.0 * np.pi, 4)
    height = 0.05 + 0.1 * float(rng.random())

    def z(x: Any, y: Any) -> Any:
        return height * sum(np.cos(f[k, 0] * x + f[k, 1] * y + phase[k]) for k in range(4))

    surface = sf.graph(z, max(2, round((facets / 2) ** 0.5)))
    return similar(Shape(surface, 3, None, 0.0, {"height": height}), rng)


def _face_like(rng: np.random.Generator, facets: int) -> Shape:
    """A dome with a nose, eye sockets and a mouth; a graph, so there is no overhang."""
    nose, socket, chin = (float(v) for v in rng.uniform((0.12, 0.05, 0.02), (0.3, 0.14, 0.1)))
    apart, tall = float(rng.uniform(0.28, 0.4)), float(rng.uniform(1.1, 1.4))

    def bump(x: Any, y: Any, at: tuple[float, float], size: tuple[float, float]) -> Any:
        return np.exp(-(((x - at[0]) / size[0]) ** 2) - ((y - at[1]) / size[1]) ** 2)

    def z(x: Any, y: Any) -> Any:
        dome = 0.7 * np.sqrt(2.2 - x**2 - (y / tall) ** 2)
        eyes = bump(x, y, (apart, 0.3), (0.17, 0.1)) + bump(x, y, (-apart, 0.3), (0.17, 0.1))
        mouth = bump(x, y, (0.0, -0.45), (0.2, 0.05)) + bump(x, y, (0.0, -0.56), (0.17, 0.05))
        return dome + nose * bump(x, y, (0.0, -0.08), (0.15, 0.2)) - socket * eyes + 0.05 * mouth + chin * bump(
            x, y, (0.0, -0.85), (0.2, 0.15))  # fmt: skip

    surface = sf.graph(z, max(2, round((facets / 2) ** 0.5)), (0.8, 1.0))
    return similar(Shape(surface, 3, None, 0.0, {"nose": nose, "socket": socket, "chin": chin}), rng)


def _open_box(rng: np.random.Generator, facets: int) -> Shape:
    """Box without the side +z: its kernel has no upper end."""
    half = [dyadic(rng, 0.5, 2) for _ in range(3)]
    vertices, faces = sf.box(half)
    kept = ~(vertices[faces][:, :, 2] == half[2]).all(axis=1)
    return similar(Shape(sf.refined((vertices, faces[kept]), facets), 3, None, 0.0, {"half": half}), rng)


CONVEX = {"box": _box, "ellipsoid": _ellipsoid, "prism": _convex_prism, "bipyramid": _convex_bipyramid}
STAR = {
    "star-prism": _star_prism, "star-bipyramid": _star_bipyramid, "stellated-cube": _stellated_cube,
    "notched-box": _notched_box, "cross": _cross, "bumpy-sphere": bumpy_sphere, "urchin": _urchin,
}  # fmt: skip
OPEN = {"height-field": _height_field, "face-like": _face_like, "open-box": _open_box}
