"""Guards -> star-shaped pieces, one for each: `star_cover`."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_path, read_only
from voxkernel._frozen import Frozen
from voxkernel._palette import distinct_color
from voxkernel._plain import plain
from voxkernel.exact import KernelPolytope, exact_kernel
from voxkernel.exact.membership import points_inside
from voxkernel.guarding.colored_ply import write_colored_ply
from voxkernel.guarding.result import Guards
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.connected_components import components
from voxkernel.mesh.edges import half_edges

__all__ = ["StarCover", "StarPiece", "star_cover"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StarPiece(Frozen):
    """A star-shaped piece: what a guard provably sees, and walls from its border to the guard.

    Attributes
    ----------
    mesh : TriangleMesh
        Closed: facets of the surface first, then the walls. Where a facet that was cut meets one that was not, a wall
        without thickness stands between them.
    guard : int
        Row of `Guards.points`.
    point : (3,) float64
        The guard, world coordinates; a vertex of the walls.
    faces : (p,) int64
        Row of the surface's `mesh.faces` that each of the first p triangles is, or is a part of.
    area_share : float
        Share of the surface's area in this piece.
    """

    mesh: TriangleMesh
    guard: int
    point: NDArray[np.float64]
    faces: NDArray[np.int64]
    area_share: float

    def __repr__(self) -> str:
        """Name the guard and the size."""
        return f"StarPiece(guard={self.guard}, {len(self.faces)} facets, area_share={self.area_share:.6g})"

    @property
    def holds_guard(self) -> bool:
        """Whether the guard is on the inner side of all facets, or on them: decided exactly."""
        planes = HalfSpaces.from_mesh(self.mesh)
        return bool(points_inside(planes, self.point[None], np.zeros(len(planes), np.bool_))[0])

    def kernel(self) -> KernelPolytope:
        """Compute the exact kernel with its certificate; often it is a single point, the guard."""
        return exact_kernel(self.mesh)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StarCover(Frozen):
    """Star-shaped pieces that together hold what guards provably see, as `star_cover` returns them.

    Attributes
    ----------
    pieces : tuple of StarPiece
        One for each guard that sees a part of a facet by certificate, in the order of the guards.
    left_faces : (r,) int64
        Rows of the surface's `mesh.faces` that are not wholly in a piece.
    left_shares : (r,) float64
        Share of each of them that is in none, in (0, 1].
    guards : Guards
        What the pieces were made from.
    """

    pieces: tuple[StarPiece, ...]
    left_faces: NDArray[np.int64]
    left_shares: NDArray[np.float64]
    guards: Guards

    def __repr__(self) -> str:
        """Name the number of pieces and what is left."""
        return f"StarCover({len(self.pieces)} pieces, certified={self.guards.certified:.6g})"

    def __len__(self) -> int:
        """Count the pieces."""
        return len(self.pieces)

    def verify(self) -> bool:
        """Decide exactly whether every piece is closed and its guard in its kernel.

        Returns
        -------
        bool
            True where each piece is star-shaped with its guard as a centre.
        """
        return all(piece.mesh.facts().is_closed and piece.holds_guard for piece in self.pieces)

    def to_dict(self) -> dict[str, Any]:
        """Give guard, size and share of each piece and what is left as plain numbers, ready for JSON."""
        return plain({
            "pieces": [
                {"guard": p.guard, "point": p.point, "n_facets": len(p.faces), "area_share": p.area_share}
                for p in self.pieces
            ],
            "left_faces": self.left_faces,
            "left_shares": self.left_shares,
        })

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the pieces: a folder of files, or one mesh with a colour for each piece.

        Parameters
        ----------
        path : str or os.PathLike
            A folder, made where there is none, for ``piece_000.ply`` and so on; or a file that ends in ``.ply``.

        Raises
        ------
        OSError
            If a file cannot be written.
        """
        target = as_path("path", path)
        if target.suffix.lower() == ".ply":
            meshes = [piece.mesh for piece in self.pieces]
            starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
            none = [np.zeros((0, 3), np.int64)]
            colors = [np.tile(distinct_color(piece.guard), (len(piece.mesh.faces), 1)) for piece in self.pieces]
            write_colored_ply(
                target,
                np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)]),
                np.concatenate([*none, *(mesh.faces + at for mesh, at in zip(meshes, starts, strict=False))]),
                np.concatenate([np.zeros((0, 3), np.uint8), *colors]),
            )
            return
        target.mkdir(exist_ok=True)
        for piece in self.pieces:
            piece.mesh.write(target / f"piece_{piece.guard:03d}.ply")


def star_cover(guards: Guards) -> StarCover:
    """Cut what guards provably see into star-shaped pieces, one for each guard.

    Parameters
    ----------
    guards : Guards
        What `guards` found.

    Returns
    -------
    StarCover
        Pieces that together hold all certified facets and parts of facets, and what is left.

    Raises
    ------
    TypeError
        If `guards` is not a `Guards`.

    Notes
    -----
    A piece is the union of the hulls of its guard and each of its facets. The guard is strictly on the inner side of
    the facets and lies on the planes of the walls, so it is in the kernel; most kernels are this single point. Pieces
    are no partition of the volume: those of different guards overlap inside.

    Examples
    --------
    >>> import voxkernel
    >>> from voxkernel.demo_shapes import torus
    >>> cover = voxkernel.star_cover(voxkernel.guards(torus(n_major=24, n_minor=12), coverage=0.9))
    >>> len(cover), cover.verify(), cover.pieces[0].kernel().certificate.verify()
    (2, True, True)
    """
    if not isinstance(guards, Guards):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"`guards` must be Guards; got {type(guards).__name__}")
    parts, mesh = guards.parts, guards.mesh
    shares = 0.25**parts.depths
    total = float(mesh.facet_areas.sum())
    pieces = tuple(
        StarPiece(
            _closed(parts.corners[rows], guards.points[i], f"piece {i}"), i, guards.points[i], parts.faces[rows],
            float((shares[rows] * mesh.facet_areas[parts.faces[rows]]).sum()) / total,
        )
        for i in range(len(guards.points))
        if len(rows := np.flatnonzero(parts.guards == i))
    )  # fmt: skip
    held = np.asarray(np.bincount(parts.faces, shares, len(mesh.faces)), np.float64)
    left = np.flatnonzero(held < 1.0)
    return StarCover(pieces, read_only(left), read_only(1.0 - held[left]), guards)


def _closed(corners: NDArray[np.float64], point: NDArray[np.float64], source: str) -> TriangleMesh:
    """Triangles and walls from their border to a point; every edge has two triangles.

    Corners become one vertex only where their triangles are linked by edges, so that a vertex where two borders touch
    is there twice.
    """
    places, rows = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = rows.reshape(-1, 3)
    edges = half_edges(faces, len(places))
    one, other = edges.pairs()
    tails, heads = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    opposite = tails[one] == heads[other]
    one, other = one[opposite], other[opposite]
    after_one, after_other = _following(one), _following(other)
    n, vertex = components(
        faces.size, np.concatenate([one, after_one]), np.concatenate([after_other, other])
    )
    vertices = np.empty((n + 1, 3))
    vertices[vertex] = corners.reshape(-1, 3)
    vertices[n] = point
    border = np.ones(faces.size, np.bool_)
    border[one] = border[other] = False
    loose = np.flatnonzero(border)
    walls = np.stack([vertex[_following(loose)], vertex[loose], np.full(len(loose), n)], axis=1)
    triangles = np.concatenate([vertex.reshape(-1, 3), walls]).astype(np.int64)
    return TriangleMesh.from_triangles(vertices, triangles, source=source)


def _following(half: NDArray[np.int64]) -> NDArray[np.int64]:
    """The next half-edge of the same triangle."""
    return half - half % 3 + (half + 1) % 3
