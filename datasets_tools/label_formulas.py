"""Solids by formula as voxels in any pose: what `make_labels.py` writes, and what is known of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np

Points = Any  # (..., 3) float64, in units of half the size
Inside = Callable[[Points], Any]


@dataclass(frozen=True)
class Solid:
    """A solid in the ball of radius 1: what is inside, and the truth of the formula; None where it is not known."""

    inside: Inside
    volume: float | None
    is_star_shaped: bool | None
    fragments: int = 1
    holes: int = 0
    parameters: dict[str, float] = field(default_factory=dict)


def ball(_: np.random.Generator) -> Solid:
    """Seen from its centre."""
    return Solid(lambda p: (p**2).sum(-1) <= 0.9**2, 4 / 3 * pi * 0.9**3, True)


def ellipsoid(rng: np.random.Generator) -> Solid:
    """Half axes 0.9, b and c."""
    b, c = rng.uniform(0.45, 0.9, 2)
    axes = np.array([0.9, b, c])
    return Solid(lambda p: ((p / axes) ** 2).sum(-1) <= 1, 4 / 3 * pi * 0.9 * b * c, True, parameters={"b": b, "c": c})


def bean(rng: np.random.Generator) -> Solid:
    """An ellipsoid bent along a parabola; star-shaped where it is bent little."""
    bend = rng.uniform(0.2, 0.8)

    def inside(p: Points) -> Any:
        y = p[..., 1] - bend * (p[..., 0] ** 2 - 0.3)
        return (p[..., 0] / 0.85) ** 2 + (y / 0.35) ** 2 + (p[..., 2] / 0.4) ** 2 <= 1

    # A shear along y moves each column as a whole: the volume is that of the ellipsoid.
    return Solid(inside, 4 / 3 * pi * 0.85 * 0.35 * 0.4, None, parameters={"bend": bend})


def dumbbell(_: np.random.Generator) -> Solid:
    """Two balls of radius 0.35 and a bar of radius 0.12: no point sees both balls whole."""

    def inside(p: Points) -> Any:
        across = p[..., 1] ** 2 + p[..., 2] ** 2
        balls = np.minimum((p[..., 0] - 0.6) ** 2, (p[..., 0] + 0.6) ** 2) + across <= 0.35**2
        return balls | ((np.abs(p[..., 0]) <= 0.6) & (across <= 0.12**2))

    return Solid(inside, None, False)


def c_shape(rng: np.random.Generator) -> Solid:
    """A torus with a gap of some 70 degrees."""
    gap = rng.uniform(0.5, 0.75)

    def inside(p: Points) -> Any:
        angle = np.abs(np.arctan2(p[..., 1], p[..., 0]))
        return ((np.hypot(p[..., 0], p[..., 1]) - 0.66) ** 2 + p[..., 2] ** 2 <= 0.26**2) & (angle >= gap)

    return Solid(inside, 2 * pi * 0.66 * pi * 0.26**2 * (1 - gap / pi), False, parameters={"gap": gap})


def fragments(_: np.random.Generator) -> Solid:
    """Two balls of radius 0.35, 0.5 apart."""

    def inside(p: Points) -> Any:
        along = np.minimum((p[..., 0] - 0.6) ** 2, (p[..., 0] + 0.6) ** 2)
        return along + p[..., 1] ** 2 + p[..., 2] ** 2 <= 0.35**2

    return Solid(inside, 2 * 4 / 3 * pi * 0.35**3, False, fragments=2)


def shell(_: np.random.Generator) -> Solid:
    """A ball of radius 0.9 without one of radius 0.45."""

    def inside(p: Points) -> Any:
        square = (p**2).sum(-1)
        return (square <= 0.9**2) & (square > 0.45**2)

    return Solid(inside, 4 / 3 * pi * (0.9**3 - 0.45**3), False, holes=1)


def torus(rng: np.random.Generator) -> Solid:
    """A closed ring: a tunnel, which is no hole."""
    thick = rng.uniform(0.18, 0.28)

    def inside(p: Points) -> Any:
        return (np.hypot(p[..., 0], p[..., 1]) - 0.66) ** 2 + p[..., 2] ** 2 <= thick**2

    return Solid(inside, 2 * pi * 0.66 * pi * thick**2, False, parameters={"thick": thick})


def starfish(rng: np.random.Generator) -> Solid:
    """A slab whose outline has five arms; seen from its centre."""
    arm = rng.uniform(0.15, 0.3)

    def inside(p: Points) -> Any:
        outline = 0.55 + arm * np.cos(5 * np.arctan2(p[..., 1], p[..., 0]))
        return (np.hypot(p[..., 0], p[..., 1]) <= outline) & (np.abs(p[..., 2]) <= 0.3)

    return Solid(inside, 0.6 * pi * (0.55**2 + arm**2 / 2), True, parameters={"arm": arm})


def l_shape(rng: np.random.Generator) -> Solid:
    """Two bars of square section that meet at a right angle; seen from where they meet."""
    wide = rng.uniform(0.3, 0.5)

    def inside(p: Points) -> Any:
        x, y = p[..., 0] + 0.6, p[..., 1] + 0.6
        corner = (np.minimum(x, y) >= 0) & (np.maximum(x, y) <= 1.2) & (np.minimum(x, y) <= wide)
        return corner & (np.abs(p[..., 2]) <= wide / 2)

    return Solid(inside, (2.4 * wide - wide**2) * wide, True, parameters={"wide": wide})


def spiral(rng: np.random.Generator) -> Solid:
    """A tube around one and a half turns of a helix."""
    thick = rng.uniform(0.16, 0.2)
    turn = np.linspace(-1.5 * pi, 1.5 * pi, 400)
    path = np.stack([0.6 * np.cos(turn), 0.6 * np.sin(turn), turn / pi * 0.4], axis=1)

    def inside(p: Points) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(path).query(p.reshape(-1, 3))[0].reshape(p.shape[:-1]) <= thick

    return Solid(inside, None, False, parameters={"thick": thick})


def sheet(rng: np.random.Generator) -> Solid:
    """A thin square plate."""
    thick = rng.uniform(0.1, 0.2)

    def inside(p: Points) -> Any:
        return (np.abs(p[..., :2]).max(-1) <= 0.6) & (np.abs(p[..., 2]) <= thick / 2)

    return Solid(inside, 1.2**2 * thick, True, parameters={"thick": thick})


FAMILIES: dict[str, Callable[[np.random.Generator], Solid]] = {
    "ball": ball, "ellipsoid": ellipsoid, "bean": bean, "dumbbell": dumbbell, "c": c_shape, "fragments": fragments,
    "shell": shell, "torus": torus, "starfish": starfish, "l": l_shape, "spiral": spiral, "sheet": sheet,
}  # fmt: skip


def voxels(solid: Solid, size: int, rng: np.random.Generator) -> Any:
    """Digitise a solid in a cube of `size` voxels: a voxel is inside if its centre is; turned and moved at random."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift = rng.uniform(-0.5, 0.5, 3)
    centers = np.stack(np.indices((size,) * 3), axis=-1) - (size - 1) / 2 + shift
    return solid.inside(centers / (size / 2) @ turn)
