"""Shapes by formula that the search for guards was never tuned on: tubes, a comb, a cup, a gyroid, letters, links."""

import numpy as np
import shapes
from numpy.typing import NDArray

import voxkernel

__all__ = ["UNSEEN_SHAPES"]


def _grid(n: int, m: int, *, around: bool) -> NDArray[np.int64]:
    """Triangles of n rows of m corners; columns close, rows where asked."""
    i, j = np.meshgrid(np.arange(n if around else n - 1), np.arange(m), indexing="ij")
    a, b = (i * m + j).ravel(), (i * m + (j + 1) % m).ravel()
    c, d = ((i + 1) % n * m + (j + 1) % m).ravel(), ((i + 1) % n * m + j).ravel()
    return np.concatenate([np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)])


def tube(path: NDArray[np.float64], radius: float, *, around: bool, sides: int = 24) -> voxkernel.TriangleMesh:
    """A tube about a path; closed, or with flat ends."""
    n = len(path)
    along = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    if not around:
        along[0], along[-1] = path[1] - path[0], path[-1] - path[-2]
    along /= np.linalg.norm(along, axis=1)[:, None]
    side = np.empty_like(path)
    side[0] = np.cross(along[0], [0.3, 0.1, 0.9])
    for k in range(n):  # carried along, so that the tube is not twisted
        side[k] = side[k - 1] if k else side[0]
        side[k] -= (side[k] @ along[k]) * along[k]
        side[k] /= np.linalg.norm(side[k])
    up = np.cross(along, side)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rings = path[:, None] + radius * (np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * up[:, None])
    vertices, faces = rings.reshape(-1, 3), _grid(n, sides, around=False)
    if around:  # the last ring meets the first one at the corner that is nearest
        first = (n - 1) * sides + np.arange(sides)
        shift = int(np.argmin(np.linalg.norm(rings[0] - rings[-1, 0], axis=1)))
        second = (np.arange(sides) + shift) % sides
        a, b, c, d = first, np.roll(first, -1), np.roll(second, -1), second
        faces = np.concatenate([faces, np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)])
    else:
        vertices = np.concatenate([vertices, path[[0, -1]]])
        first, last = np.arange(sides), (n - 1) * sides + np.arange(sides)
        ends = [np.stack([np.full(sides, n * sides), first, np.roll(first, -1)], axis=1),
                np.stack([np.full(sides, n * sides + 1), np.roll(last, -1), last], axis=1)]  # fmt: skip
        faces = np.concatenate([faces, *ends])
    return _outward(vertices, faces)


def _outward(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> voxkernel.TriangleMesh:
    mesh = voxkernel.as_mesh((vertices, faces))
    return mesh if mesh.volume > 0 else voxkernel.as_mesh((vertices, faces[:, ::-1].copy()))


def helix() -> voxkernel.TriangleMesh:
    """Two and a half turns of a spring."""
    t = np.linspace(0.0, 5.0 * np.pi, 160)
    return tube(np.column_stack([np.cos(t), np.sin(t), 0.12 * t]), 0.14, around=False)


def trefoil() -> voxkernel.TriangleMesh:
    """A knotted tube."""
    t = 2.0 * np.pi * np.arange(160) / 160
    path = np.column_stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)])
    return tube(path, 0.35, around=True)


def comb() -> voxkernel.TriangleMesh:
    """Six teeth, too long to be seen into from a neighbour."""
    outline: list[tuple[float, float]] = [(0, 0), (11, 0)]
    for tooth in range(5, -1, -1):
        outline += [(2 * tooth + 1, 1), (2 * tooth + 1, 5), (2 * tooth, 5), (2 * tooth, 1)]
    del outline[2], outline[-1]
    return voxkernel.as_mesh(shapes.prism(outline))


def cup(sectors: int = 64) -> voxkernel.TriangleMesh:
    """A cup with a wall of a tenth of its width, turned about an axis."""
    outer = [(1.0 + 0.15 * np.sin(3 * z), z) for z in np.linspace(0.0, 2.0, 24)]
    inner = [(r - 0.1, max(z, 0.12)) for r, z in reversed(outer)]
    profile = np.array(outer + inner)
    angle = 2.0 * np.pi * np.arange(sectors) / sectors
    r, z = profile[:, 0, None], np.repeat(profile[:, 1, None], sectors, axis=1)
    rings = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=2)
    n = len(profile)
    vertices = np.concatenate([rings.reshape(-1, 3), [[0, 0, 0.0], [0, 0, 0.12]]])
    first, last = np.arange(sectors), (n - 1) * sectors + np.arange(sectors)
    ends = [np.stack([np.full(sectors, n * sectors), first, np.roll(first, -1)], axis=1),
            np.stack([np.full(sectors, n * sectors + 1), np.roll(last, -1), last], axis=1)]  # fmt: skip
    return _outward(vertices, np.concatenate([_grid(n, sectors, around=False), *ends]))


def gyroid() -> voxkernel.TriangleMesh:
    """One period of a gyroid's wall in a ball, by marching cubes."""
    from skimage.measure import marching_cubes

    line = np.linspace(-3.6, 3.6, 56)
    x, y, z = np.meshgrid(line, line, line, indexing="ij")
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    solid = np.minimum(0.7 - np.abs(field), 3.3 - np.sqrt(x * x + y * y + z * z))
    vertices, faces, _, _ = marching_cubes(solid, 0.0, gradient_direction="ascent")
    return _outward(vertices.astype(np.float64), faces.astype(np.int64))


def letter(name: str) -> voxkernel.TriangleMesh:
    """A letter of sheet metal."""
    outlines = {
        "E": [(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (3, 3), (3, 4), (1, 4), (1, 6), (4, 6), (4, 7), (0, 7)],
        "S": [(0, 0), (4, 0), (4, 4), (1, 4), (1, 6), (4, 6), (4, 7), (0, 7), (0, 3), (3, 3), (3, 1), (0, 1)],
        "W": [(0, 7), (1.5, 0), (2.5, 0), (3.5, 4), (4.5, 0), (5.5, 0), (7, 7), (6, 7), (5, 2), (4, 6), (3, 6), (2, 2),
              (1, 7)],
    }  # fmt: skip
    return voxkernel.as_mesh(shapes.prism(outlines[name]))


def linked_tori() -> voxkernel.TriangleMesh:
    """Two bodies."""
    first = shapes.torus(1.0, 0.25, 48, 24)
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
    vertices, faces = shapes.torus(1.0, 0.25, 48, 24)
    return voxkernel.as_mesh(shapes.joined(first, (vertices @ turn.T + [1.0, 0, 0], faces)))


UNSEEN_SHAPES = {
    "helix": helix,
    "trefoil": trefoil,
    "comb": comb,
    "cup": cup,
    "gyroid": gyroid,
    "letter E": lambda: letter("E"),
    "letter S": lambda: letter("S"),
    "letter W": lambda: letter("W"),
    "linked tori": linked_tori,
}
