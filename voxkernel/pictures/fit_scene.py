"""Registered surfaces -> what a picture of their fit shows: views, colours of distances, histogram and legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._open3d import open3d, open3d_mesh, ray_scene
from voxkernel._palette import rgb_of
from voxkernel.mesh.triangles import doubled_normals
from voxkernel.pictures.camera import camera_frame, seen_upright

__all__ = [
    "UNEXPLAINED", "Fit", "Layer", "Panel", "bar_colors", "before_panel", "colored", "fit_of", "moved", "plain_layer",
    "thinned", "view_of",
]  # fmt: skip

UNEXPLAINED = "#b9bec4"
# From near to far: the colours of viridis, which is read without seeing red and green apart.
_BAR = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
_FACETS = 80_000  # drawn at most, of all surfaces together
_BINS = 40
_END = 0.9  # share of the explained area that the bar ends at
_FAR_APART = 1.7  # times what is laid together: surfaces that take more room are moved beside each other
_GAP = 0.06  # between them, of the largest
_FACING = 0.5  # cosine between normals, as scores ask for


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Layer(Frozen):
    """Triangles to draw, world coordinates, and the colour of each vertex, (n, 3) in [0, 255]."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    colors: NDArray[np.uint8]
    name: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Panel(Frozen):
    """Layers under a name, seen from a direction (from the object towards the eye)."""

    name: str
    layers: tuple[Layer, ...]
    view: NDArray[np.float64]
    up: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Fit(Frozen):
    """How far vertices are from the other surface: one array for each surface, NaN where nothing explains them.

    `shares[k]` is the share of the area in bin k of `edges`, the last bin holding what is farther;
    `unexplained` is the rest.
    """

    distances: tuple[NDArray[np.float64], ...]
    edges: NDArray[np.float64]
    shares: NDArray[np.float64]
    unexplained: float
    reach: float

    @property
    def end(self) -> float:
        """Where the bar ends, mesh units."""
        return float(self.edges[-1])


def moved(points: NDArray[np.float64], motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Apply a motion to points."""
    return points @ motion[:3, :3].T + motion[:3, 3]


def thinned(vertices: NDArray[np.float64], faces: NDArray[np.int64], n_surfaces: int) -> Any:
    """Thin a surface that is too fine to be drawn, by joining vertices in cells of a grid."""
    most = _FACETS // max(1, n_surfaces)
    if len(faces) <= most:
        return vertices, faces
    low = vertices.min(axis=0)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0))) or 1.0
    cell = np.sqrt(0.5 * np.linalg.norm(doubled_normals(vertices[faces]), axis=1).sum() / most)
    thin = open3d_mesh((vertices - low) / size, faces).simplify_vertex_clustering(float(cell / size))
    triangles = np.asarray(thin.triangles).astype(np.int64)
    return (np.asarray(thin.vertices) * size + low, triangles) if len(triangles) else (vertices, faces)


def fit_of(surfaces: Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]], reach: float) -> Fit:
    """Measure how far each surface is from all others together, at its vertices."""
    everything = np.concatenate([v for v, _ in surfaces])
    middle, size = everything.mean(axis=0), float(np.linalg.norm(np.ptp(everything, axis=0))) or 1.0
    unit = [((v - middle) / size, f) for v, f in surfaces]
    found: list[NDArray[np.float64]] = []
    areas: list[NDArray[np.float64]] = []
    for own, (vertices, faces) in enumerate(unit):
        normals, area = _at_vertices(vertices, faces)
        others = [s for k, s in enumerate(unit) if k != own]
        distance, facing = _distances(vertices, normals, others)
        distance = distance * size
        found.append(np.where((distance <= reach) & facing, distance, np.nan))
        areas.append(area)
    distances, weights = np.concatenate(found), np.concatenate(areas)
    good = np.isfinite(distances)
    total = float(weights.sum()) or 1.0
    edges = np.linspace(0.0, _bar_end(distances[good], weights[good], reach), _BINS + 1)
    last = 0.5 * (edges[-2] + edges[-1])
    shown = np.where(distances[good] >= edges[-1], last, distances[good])
    shares = np.histogram(shown, edges, weights=weights[good])[0]
    return Fit(tuple(found), edges, shares / total, float(weights[~good].sum()) / total, reach)


def _distances(
    points: NDArray[np.float64], normals: NDArray[np.float64],
    others: list[tuple[NDArray[np.float64], NDArray[np.int64]]],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:  # fmt: skip
    counts = np.cumsum([0, *(len(v) for v, _ in others)])
    vertices = np.concatenate([v for v, _ in others])
    faces = np.concatenate([f + c for (_, f), c in zip(others, counts, strict=False)])
    answer = ray_scene(vertices, faces).compute_closest_points(open3d().core.Tensor(points.astype(np.float32)))
    flat = doubled_normals(vertices[faces])[answer["primitive_ids"].numpy()]
    length = np.linalg.norm(flat, axis=1)
    facing = np.einsum("ij,ij->i", normals, flat) > _FACING * length
    return np.linalg.norm(points - answer["points"].numpy(), axis=1), facing


def _at_vertices(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals at vertices and the area that each stands for."""
    vectors = doubled_normals(vertices[faces])
    normals, area = np.zeros_like(vertices), np.zeros(len(vertices))
    for k in range(3):
        np.add.at(normals, faces[:, k], vectors)
        np.add.at(area, faces[:, k], np.linalg.norm(vectors, axis=1) / 6.0)
    length = np.linalg.norm(normals, axis=1)
    return normals / np.where(length > 0, length, 1.0)[:, None], area


def _bar_end(distances: NDArray[np.float64], weights: NDArray[np.float64], reach: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten what holds nearly all of the explained area."""
    if not len(distances):
        return reach
    order = np.argsort(distances)
    share = np.cumsum(weights[order])
    most = float(distances[order][np.searchsorted(share, _END * share[-1]).clip(max=len(order) - 1)])
    if most <= 1e-9 * reach:
        return reach
    power = 10.0 ** np.floor(np.log10(most))
    return float(min(next(k for k in (1.0, 2.0, 5.0, 10.0) if k * power >= most * (1 - 1e-9)) * power, reach))


def bar_colors(shares: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours of the bar at shares of its length, (n, 3); grey for NaN."""
    stops = np.array([rgb_of(c) for c in _BAR], float)
    at = np.linspace(0.0, 1.0, len(stops))
    clipped = np.clip(np.nan_to_num(shares), 0.0, 1.0)
    colors = np.stack([np.interp(clipped, at, stops[:, k]) for k in range(3)], axis=1)
    colors[np.isnan(shares)] = rgb_of(UNEXPLAINED)
    return colors.round().astype(np.uint8)


def colored(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], distances: NDArray[np.float64], end: float, name: str
) -> Layer:
    """A surface in the colours of its distances."""
    return Layer(vertices, faces, bar_colors(distances / end), name)


def plain_layer(vertices: NDArray[np.float64], faces: NDArray[np.int64], color: str, name: str) -> Layer:
    """A surface in one colour."""
    return Layer(vertices, faces, np.tile(np.array(rgb_of(color), np.uint8), (len(vertices), 1)), name)


def view_of(
    surfaces: Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]], wanted: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Look at the front of open surfaces, along the thinnest direction of closed ones; a little from the side.

    Up is what is `wanted`, else the longest direction.
    """
    vectors = np.concatenate([doubled_normals(v[f]) for v, f in surfaces])
    facing, total = vectors.sum(axis=0), float(np.linalg.norm(vectors, axis=1).sum())
    axes = np.linalg.eigh(np.cov(np.concatenate([v for v, _ in surfaces]).T))[1]
    front = facing / np.linalg.norm(facing) if np.linalg.norm(facing) > 0.2 * total else axes[:, 0]
    up = axes[:, 2] - (axes[:, 2] @ front) * front
    up = axes[:, 1] - (axes[:, 1] @ front) * front if np.linalg.norm(up) < 0.1 else up
    up = up / np.linalg.norm(up)
    up = up if up[np.argmax(np.abs(up))] > 0 else -up
    view = 0.9 * front + 0.35 * np.cross(up, front) + 0.25 * up
    view /= np.linalg.norm(view)
    return (view, up) if wanted is None else seen_upright(view, up, wanted)


def before_panel(
    name: str, layers: Sequence[Layer], extent: float, view: NDArray[np.float64], up: NDArray[np.float64]
) -> Panel:
    """Show surfaces as they are given; where they lie too far apart to be seen, moved beside each other unturned."""
    points = np.concatenate([layer.vertices for layer in layers])
    apart = float(np.linalg.norm(np.ptp(points, axis=0)))
    if len(layers) < 2 or apart <= _FAR_APART * extent:
        return Panel(name, tuple(layers), view, up)
    words = f"{name}, moved beside each other: all take {apart:.3g}, laid together {extent:.3g}"
    return Panel(words, _beside(layers, view, up), view, up)


def _beside(layers: Sequence[Layer], view: NDArray[np.float64], up: NDArray[np.float64]) -> tuple[Layer, ...]:
    """Put layers into the cells of a table that is seen from a direction, row by row from the upper left."""
    frame = camera_frame(view, up)
    seen = [layer.vertices @ frame.T for layer in layers]
    cell = (1.0 + _GAP) * np.max([np.ptp(points, axis=0) for points in seen], axis=0)
    columns = int(np.ceil(np.sqrt(len(layers) * cell[1] / cell[0]))) if cell[0] > 0 else 1
    columns = min(max(columns, 1), len(layers))
    placed: list[Layer] = []
    for k, (layer, points) in enumerate(zip(layers, seen, strict=True)):
        row, column = divmod(k, columns)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        there = points - middle + np.array([column, -row, 0.0]) * cell
        placed.append(Layer(there @ frame, layer.faces, layer.colors, layer.name))
    return tuple(placed)
