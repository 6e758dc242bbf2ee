"""Points that may become guards: deep ones, a lattice, and points in sight of what is still unseen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.guarding.sight import Sight, Spots

__all__ = ["around", "in_sight_of", "start_points"]


def start_points(
    sight: Sight, faces: NDArray[np.int64], count: int, distance: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Half of them midpoints of chords that start at the given faces, half a jittered lattice; on the shell outside."""
    if sight.side == "outside":
        spots = sight.samples(count, rng, faces)
        return on_shell(sight, spots.places - distance * sight.normals[spots.faces], distance)
    spots = sight.samples(count // 2, rng, faces)
    directions = _inward(sight, spots, 0.5, rng)
    free = np.minimum(sight.chords(spots, directions), sight.diagonal)
    deep = spots.places + (0.5 * free)[:, None] * directions
    corners = sight.vertices[sight.faces[faces]]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    step = float(np.prod(np.maximum(high - low, 1e-3 * sight.diagonal)) / max(1, count)) ** (1.0 / 3.0)
    axes = [np.arange(a + 0.5 * step, b + 0.5 * step, step) for a, b in zip(low, high, strict=True)]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    lattice = lattice + (rng.random(lattice.shape) - 0.5) * step
    points = np.concatenate([deep, lattice])
    return points[sight.allowed(points)]


def in_sight_of(
    sight: Sight, spots: Spots, each: int, distance: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Points on chords that start at spots."""
    several = spots.some(np.repeat(np.arange(len(spots)), each))
    directions = _inward(sight, several, 0.7, rng)
    if sight.side == "outside":
        return on_shell(sight, several.places + distance * directions, distance)
    free = np.minimum(sight.chords(several, directions), sight.diagonal)
    points = several.places + (free * rng.uniform(0.1, 0.9, len(several)))[:, None] * directions
    return points[sight.allowed(points)]


def around(
    sight: Sight, point: NDArray[np.float64], reach: float, count: int, distance: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Points near another one."""
    steps = reach * rng.standard_normal((count, 3)) * rng.random((count, 1))
    points = point + steps
    if sight.side == "outside":
        return on_shell(sight, points, distance)
    return points[sight.allowed(points)]


def on_shell(sight: Sight, points: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """Move points until the surface is at the given distance; those that do not get there are left out."""
    for _ in range(8):
        nearest, size = sight.nearest(points)
        away = points - nearest
        away[size == 0.0] = 1.0
        away /= np.linalg.norm(away, axis=1)[:, None]
        points = nearest + distance * away
    size = sight.nearest(points)[1]
    points = points[np.abs(size - distance) <= 1e-3 * distance]
    return points[sight.allowed(points)]


def _inward(sight: Sight, spots: Spots, spread: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Unit directions that leave the spots on the side that can be seen."""
    normals = sight.normals[spots.faces]
    directions = -normals + spread * rng.standard_normal(normals.shape)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    flat = np.einsum("ij,ij->i", directions, normals) > -0.1
    directions[flat] = -normals[flat]
    return directions
