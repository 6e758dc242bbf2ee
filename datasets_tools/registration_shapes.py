"""Shapes for registration, by kind, and their division into two halves that share none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

# Their motions onto themselves are several, so that no single answer is the true one.
SYMMETRIC = (
    "cube", "sphere", "torus", "octagonal", "plus", "cross", "star", "vase", "spiral", "soccer", "two_spheres", "ball",
    "quadknot", "minus_sphere", "cubespikes", "hemisphere", "featuretype", "flex", "muffin", "acorn", "fandisk",
    "bot_eye",
)  # fmt: skip


def half_of(name: str) -> int:
    """The half a shape belongs to, by its name alone; the expressions of one face go together."""
    return crc32(name.split("_")[0].encode() if name.startswith("ict") else name.encode()) % 2


def shapes(data: Path | None, facets: int = 5000) -> Iterator[tuple[str, str, Callable[[], Any]]]:
    """Give kind, name and how to get each shape, thinned to at most so many facets."""
    for seed in range(16):
        yield "formula", f"bumpy-{seed}", cache(lambda seed=seed: bumpy(seed))
    for seed in range(8):
        yield "formula, open", f"landscape-{seed}", cache(lambda seed=seed: landscape(seed))
    if data is None:
        return
    folders = (("faces", "face"), ("closed", "closed"), ("open", "open"), ("asteroids", "asteroid"))
    for folder, kind in folders:
        for path in sorted((data / folder).glob("*.ply")):
            plain = not any(word in path.stem for word in SYMMETRIC)
            if plain and (folder != "faces" or "neutral" in path.stem or "real" in path.stem):
                yield kind, path.stem, cache(lambda path=path: thinned(path, facets))


def thinned(path: Path, facets: int) -> Any:
    """Read a mesh and decimate it."""
    import voxkernel

    mesh = voxkernel.as_mesh(path)
    if len(mesh.faces) > facets:
        mesh = voxkernel.repair(mesh, decimate_to=facets).mesh
    return mesh.vertices, mesh.faces


def bumpy(seed: int) -> Any:
    """A closed body whose radius is 1 and a sum of smooth bumps, stretched."""
    import numpy as np

    rng = np.random.default_rng([19, seed])
    vertices, faces = ball(48)
    radius = np.ones(len(vertices))
    for _ in range(rng.integers(5, 14)):
        way = rng.normal(size=3)
        sharp = rng.uniform(3.0, 30.0)
        radius += rng.uniform(-0.25, 0.5) * np.exp(sharp * (vertices @ (way / np.linalg.norm(way)) - 1.0))
    return vertices * radius[:, None] * rng.uniform(0.5, 1.5, size=3), faces


def landscape(seed: int) -> Any:
    """An open height field made of smooth hills, with an irregular rim."""
    import numpy as np
    from registration_changes import sheet

    rng = np.random.default_rng([23, seed])
    vertices, faces = sheet(np.zeros(3), np.array([2.0, 0, 0]), np.array([0, 1.6, 0]), 50)
    height = np.zeros(len(vertices))
    for _ in range(rng.integers(6, 16)):
        away = (vertices[:, :2] - rng.uniform(-1, 1, 2)) / rng.uniform(0.12, 0.5, 2)
        height += rng.uniform(-0.25, 0.5) * np.exp(-0.5 * (away**2).sum(axis=1))
    angle = np.arctan2(vertices[:, 1], vertices[:, 0])
    rim = 0.75 + 0.12 * np.sin(3 * angle + rng.uniform(0, 6)) + 0.08 * np.sin(5 * angle + rng.uniform(0, 6))
    kept = (np.linalg.norm(vertices[:, :2] / [1.0, 0.8], axis=1) < rim)[faces].all(axis=1)
    used, renumbered = np.unique(faces[kept], return_inverse=True)
    return np.column_stack([vertices[:, :2], height])[used], renumbered.reshape(-1, 3)


def ball(rings: int) -> Any:
    """A sphere of points along a spiral, radius 1."""
    import numpy as np
    from scipy.spatial import ConvexHull

    count = rings * rings
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    points = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(angle), np.sqrt(1.0 - z * z) * np.sin(angle), z])
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = points[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces
