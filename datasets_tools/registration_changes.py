"""What is done to a surface before it is registered: clutter, crops, other sizes, mirror images, other facets."""

from __future__ import annotations

from typing import Any

Surface = tuple[Any, Any]


def extent(surface: Surface) -> float:
    """Diagonal of the bounding box of the vertices in use."""
    import numpy as np

    return float(np.linalg.norm(np.ptp(surface[0][np.unique(surface[1])], axis=0)))


def joined(*surfaces: Surface) -> Surface:
    """Put surfaces into one without joining their vertices."""
    import numpy as np

    counts = np.cumsum([0, *(len(v) for v, _ in surfaces)])
    return (
        np.concatenate([v for v, _ in surfaces]),
        np.concatenate([f + n for (_, f), n in zip(surfaces, counts, strict=False)]),
    )


def frame(surface: Surface) -> Any:
    """Centre of the facets and their principal axes as rows, the shortest first."""
    import numpy as np

    middles = surface[0][surface[1]].mean(axis=1)
    return middles.mean(axis=0), np.linalg.eigh(np.cov(middles.T))[1].T


def facing(surface: Surface) -> Any:
    """Mean of the normals of the facets, by area, of length 1; the shortest axis where the surface is closed."""
    import numpy as np

    corners = surface[0][surface[1]]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = doubled.sum(axis=0)
    length = np.linalg.norm(total)
    return total / length if length > 0.05 * np.linalg.norm(doubled, axis=1).sum() else frame(surface)[1][0]


def sheet(center: Any, across: Any, along: Any, cells: int) -> Surface:
    """A rectangle of square cells with edges `across` and `along`, facing their cross product."""
    import numpy as np

    steps = np.linspace(-0.5, 0.5, cells + 1)
    u, v = (a.ravel() for a in np.meshgrid(steps, steps, indexing="ij"))
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    a, b, c, d = corner, corner + cells + 1, corner + cells + 2, corner + 1
    return center + u[:, None] * across + v[:, None] * along, np.concatenate(
        [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    )


def before_a_plane(surface: Surface) -> Surface:
    """Put a plane behind a surface, twice as wide as it, facing the same way."""
    import numpy as np

    size, out = extent(surface), facing(surface)
    across = np.cross(out, frame(surface)[1][2])
    across *= 1.4 * size / np.linalg.norm(across)
    behind = ((surface[0] - surface[0].mean(axis=0)) @ out).min() - 0.05 * size
    center = surface[0].mean(axis=0) + behind * out
    return joined(surface, sheet(center, across, np.cross(out, across), 40))


def with_shoulders(surface: Surface) -> Surface:
    """Put a bent sheet below a surface, wider than it, that faces the same way."""
    import numpy as np

    size, out = extent(surface), facing(surface)
    center, axes = frame(surface)
    up = axes[2] - (axes[2] @ out) * out
    up /= np.linalg.norm(up)
    side = np.cross(up, out)
    below = ((surface[0] - center) @ up).min()
    vertices, faces = sheet(np.zeros(3), np.array([1.2 * size, 0, 0]), np.array([0, 0.5 * size, 0]), 30)
    bulge = np.cos(vertices[:, 0] / (1.2 * size) * 2.5) * 0.3 * size + 0.1 * size * np.sin(vertices[:, 1] / size * 4)
    lower = center + (below - 0.27 * size) * up - 0.25 * size * out
    placed = lower + vertices[:, :1] * side + vertices[:, 1:2] * up + bulge[:, None] * out
    return joined(surface, (placed, faces))


def both_cropped(one: Surface, two: Surface, share: float, seed: int) -> tuple[Surface, Surface]:
    """Cut a share of the area off both, on opposite sides: 1 - 2 `share` of the whole is left in common."""
    import numpy as np

    center, axes = frame(one)
    angle = np.random.default_rng([17, seed]).uniform(0.0, 2.0 * np.pi)
    way = np.cos(angle) * axes[2] + np.sin(angle) * axes[1]
    return cut(one, center, way, share), cut(two, center, -way, share)


def cut(surface: Surface, center: Any, way: Any, share: float) -> Surface:
    """Cut a share of the area off where `way` points."""
    import numpy as np

    vertices, faces = surface
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    order = np.argsort((corners.mean(axis=1) - center) @ way)
    kept = faces[np.sort(order[np.cumsum(areas[order]) <= (1.0 - share) * areas.sum()])]
    used, renumbered = np.unique(kept, return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)


def mirrored(surface: Surface) -> Surface:
    """The mirror image, facets still facing outward."""
    return surface[0] * [1.0, 1.0, -1.0], surface[1][:, ::-1]


def turned_over(surface: Surface) -> Surface:
    """The same surface, its facets facing the other way."""
    return surface[0], surface[1][:, ::-1].copy()


def divided(surface: Surface, facets: int) -> Surface:
    """Cut every facet into four until there are at least so many; no vertex leaves its triangle."""
    import numpy as np

    vertices, faces = surface
    while len(faces) < facets:
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        keys = edges[..., 0] * np.int64(len(vertices)) + edges[..., 1]
        ends, number = np.unique(keys, return_inverse=True)
        middle = 0.5 * (vertices[ends // len(vertices)] + vertices[ends % len(vertices)])
        ab, bc, ca = (len(vertices) + number.reshape(keys.shape)).T
        a, b, c = faces.T
        faces = np.concatenate([np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        vertices = np.concatenate([vertices, middle])
    return vertices, faces
