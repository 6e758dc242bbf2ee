"""A surface that is looked at: its facets in a tree, samples of its area, and who sees what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import SightTree, first_hits, nearest_points, pairs_see, points_see, winding_numbers
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.errors import MeshError
from voxkernel.halfspaces import HalfSpaces, ball_domain
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.edges import edge_parts, half_edges
from voxkernel.mesh.triangles import scale_exponent, triple_products, unit_normals, used_vertices
from voxkernel.mesh.zero_area import is_degenerate

__all__ = ["Sight", "Spots", "look_at", "turns_around"]

Side = Literal["inside", "outside"]
_MOST = 1 << 19  # products held at a time
_SMALLEST = 2.0**-300  # the exact predicates want coordinates of 0, or of this to its inverse


class Spots(NamedTuple):
    """Points of facets, in the frame of a `Sight`."""

    places: NDArray[np.float64]
    faces: NDArray[np.int64]

    def __len__(self) -> int:
        """Give the number of points; a tuple would give 2."""
        return len(self.places)

    def some(self, ids: NDArray[Any]) -> Spots:
        """Keep some of them."""
        return Spots(self.places[ids], self.faces[ids])


@dataclass(frozen=True, eq=False, repr=False)
class Sight(Frozen):
    """Facets with an area, in a frame that differs from the world by a power of two, so that no digit is lost.

    The side that can be seen is the inner one of `faces`; of a surface that is looked at from outside they are turned.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    face_ids: NDArray[np.int64]  # rows of the faces of the mesh
    exponent: int
    side: Side
    is_closed: bool
    areas: NDArray[np.float64]
    normals: NDArray[np.float64]
    bodies: NDArray[np.int64]  # of each face
    n_bodies: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    planes: tuple[NDArray[np.float64], NDArray[np.float64]] | None  # where guards of open surfaces may be
    tree: SightTree
    threads: int

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box."""
        return float(np.linalg.norm(self.high - self.low))

    def to_local(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the world in this frame."""
        return np.ascontiguousarray(np.ldexp(points, -self.exponent))

    def to_world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of this frame in the world, without rounding."""
        return np.ldexp(points, self.exponent)

    def samples(self, count: int, rng: np.random.Generator, faces: NDArray[np.int64] | None = None) -> Spots:
        """Place one random point in each of `count` strata of equal area, of some faces or all."""
        ids = np.arange(len(self.faces)) if faces is None else faces
        ends = np.cumsum(self.areas[ids])
        at = (np.arange(count) + rng.random(count)) * (ends[-1] / count)
        chosen = ids[np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)]
        u, v = rng.random((2, count))
        beyond = u + v > 1.0
        u[beyond], v[beyond] = 1.0 - u[beyond], 1.0 - v[beyond]
        a, b, c = np.moveaxis(self.vertices[self.faces[chosen]], 1, 0)
        return Spots(a + u[:, None] * (b - a) + v[:, None] * (c - a), chosen)

    def sets_seen(self, points: NDArray[np.float64], spots: Spots) -> NDArray[np.uint64]:
        """Which spots each point sees, as rows of bits."""
        words = np.zeros((len(points), -(-len(spots) // 64)), np.uint64)
        parts = np.array_split(np.arange(len(points)), max(1, min(self.threads, len(points))))

        def work(ids: NDArray[np.int64], stop: Any) -> None:
            if len(ids):
                rows = words[ids[0] : ids[-1] + 1].reshape(-1)
                points_see(self.tree, np.ascontiguousarray(points[ids]), spots.places, spots.faces, rows, stop)

        run_parts(work, parts, self.threads)
        return words

    def pairs_seen(self, points: NDArray[np.float64], spots: Spots) -> NDArray[np.bool_]:
        """Whether each point sees the spot of the same row."""
        seen = np.zeros(len(points), np.bool_)
        parts = np.array_split(np.arange(len(points)), max(1, min(self.threads, len(points))))

        def work(ids: NDArray[np.int64], stop: Any) -> None:
            if len(ids):
                some = spots.some(ids)
                pairs_see(
                    self.tree, np.ascontiguousarray(points[ids]), np.ascontiguousarray(some.places),
                    np.ascontiguousarray(some.faces), seen[ids[0] : ids[-1] + 1], stop,
                )  # fmt: skip

        run_parts(work, parts, self.threads)
        return seen

    def first_seen(self, points: NDArray[np.float64], spots: Spots) -> NDArray[np.int64]:
        """Give the first point that sees each spot, -1 where none does."""
        found = np.full(len(spots), -1, np.int64)
        for i, point in enumerate(points):
            left = np.flatnonzero(found < 0)
            if not len(left):
                break
            seen = self.pairs_seen(np.broadcast_to(point, (len(left), 3)), spots.some(left))
            found[left[seen]] = i
        return found

    def chords(self, spots: Spots, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """How many lengths of its direction a ray from each spot is free; infinite where nothing is in the way."""
        free = np.empty(len(spots))
        first_hits(
            self.tree, np.ascontiguousarray(spots.places), np.ascontiguousarray(directions),
            np.ascontiguousarray(spots.faces), free,
        )  # fmt: skip
        return free

    def nearest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Nearest point of the surface, and its distance."""
        places, sizes = np.empty((len(points), 3)), np.empty(len(points))
        parts = np.array_split(np.arange(len(points)), max(1, min(self.threads, len(points))))

        def work(ids: NDArray[np.int64], stop: Any) -> None:
            if len(ids):
                rows = slice(int(ids[0]), int(ids[-1]) + 1)
                nearest_points(self.tree, np.ascontiguousarray(points[ids]), places[rows], sizes[rows], stop)

        run_parts(work, parts, self.threads)
        return places, sizes

    def allowed(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points are where guards may be: inside, outside, or in the domain of an open surface."""
        if self.planes is not None:
            normals, offsets = self.planes
            inside = np.ones(len(points), np.bool_)
            step = max(1, _MOST // max(1, len(points)))
            for first in range(0, len(offsets), step):
                rows = slice(first, first + step)
                inside &= np.all(points @ normals[rows].T <= offsets[rows], axis=1)
            return inside
        windings = np.empty(len(points), np.int64)
        winding_numbers(self.tree, np.ascontiguousarray(points), windings)
        # The turned faces of a surface that is looked at from outside go around backwards.
        return windings > 0 if self.side == "inside" else windings == 0


def look_at(mesh: TriangleMesh, halfspaces: HalfSpaces, side: Side, threads: int) -> Sight:
    """Prepare a surface; MeshError where it has no inner side."""
    is_closed = halfspaces.bounds_volume
    faces = mesh.faces[~is_degenerate(mesh.vertices, mesh.faces)]
    kept = np.flatnonzero(~is_degenerate(mesh.vertices, mesh.faces))
    edges = half_edges(faces, len(mesh.vertices))
    n_parts, parts = edge_parts(edges, len(faces))
    forward = np.add.reduceat(edges.forward.astype(np.int64), edges.first)
    if ((edges.n_faces == 2) & (forward != 1)).any():
        raise MeshError(
            f"`surface` must have an inner side; got {int(((edges.n_faces == 2) & (forward != 1)).sum())} edges "
            f"where it changes (repair(mesh, orient=True) turns facets)"
        )
    exponent = scale_exponent(used_vertices(mesh.vertices, faces))
    vertices = np.ldexp(mesh.vertices, -exponent)
    used = np.abs(used_vertices(vertices, faces))
    if ((used > 0.0) & (used < _SMALLEST)).any():
        raise MeshError(f"`surface` must have coordinates within 2**300 of the largest; got {used[used > 0].min():g}")
    corners = vertices[faces]
    lowest, highest = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    volumes = triple_products(*np.moveaxis(corners - 0.5 * (lowest + highest), 1, 0))
    signed = np.asarray(np.bincount(parts, volumes, n_parts), np.float64)
    if is_closed and signed.sum() <= 0.0:
        raise MeshError(
            f"`surface` must have its facets counter-clockwise seen from outside; got an enclosed volume of "
            f"{np.ldexp(signed.sum() / 6.0, 3 * exponent):.3g} (repair(mesh, orient=True) turns facets)"
        )
    bodies = np.zeros(len(faces), np.int64)
    if is_closed and side == "inside":  # elsewhere one guard may see several of them
        bodies = _bodies(corners, parts.astype(np.int64), signed)
    planes = None
    if not is_closed:
        ball = ball_domain(mesh)
        planes = ball.normals, np.ldexp(ball.offsets, -exponent)
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turn = 1.0 if side == "inside" else -1.0
    if side == "outside":
        faces = np.ascontiguousarray(faces[:, [0, 2, 1]])
    return Sight(
        np.ascontiguousarray(vertices), np.ascontiguousarray(faces), kept, exponent, side, is_closed,
        0.5 * np.linalg.norm(doubled, axis=1), turn * unit_normals(corners), bodies, int(bodies.max()) + 1,
        lowest, highest, planes, SightTree(np.ascontiguousarray(vertices), np.ascontiguousarray(faces)), threads,
    )  # fmt: skip


def turns_around(corners: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solid angles of triangles over 4 pi; those of a closed surface add up to how often it goes around the place.

    A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30, 1983.
    """
    a, b, c = np.moveaxis(corners - place, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return np.arctan2(triple_products(a, b, c), la * lb * lc + ab * lc + bc * la + ca * lb) / (2.0 * np.pi)


def _bodies(
    corners: NDArray[np.float64], parts: NDArray[np.int64], volumes: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Number the bodies of faces: a cavity belongs to the smallest part around it."""
    owner = np.arange(len(volumes))
    for cavity in np.flatnonzero(volumes < 0.0):
        place = corners[np.flatnonzero(parts == cavity)[0], 0]
        around = np.bincount(parts, turns_around(corners, place), len(volumes)) > 0.5
        around[cavity] = False
        holders = np.flatnonzero(around & (volumes > 0.0))
        if len(holders):
            owner[cavity] = holders[np.argmin(volumes[holders])]
    return np.unique(owner, return_inverse=True)[1][parts]
