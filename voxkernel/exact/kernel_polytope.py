"""`KernelPolytope`: the kernel of a surface as a convex polytope."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points, read_only
from voxkernel._frozen import Frozen
from voxkernel._plain import json_text
from voxkernel._thumbnail import ORANGE, thumbnail
from voxkernel._viewing import plot_kernel
from voxkernel.errors import MeshError
from voxkernel.exact.certificate import Certificate, Proof
from voxkernel.exact.meeting_points import meeting_points
from voxkernel.exact.membership import points_inside
from voxkernel.exact.polygon_ply import write_polygon_ply
from voxkernel.halfspaces import Domain
from voxkernel.mesh import TriangleMesh

__all__ = ["KernelPolytope"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class KernelPolytope(Frozen):
    """The kernel of a surface: a convex polytope, possibly flat or empty.

    Attributes
    ----------
    dimension : int
        -1 empty, 0 point, 1 segment, 2 flat polygon, 3 solid; exact for the doubles given.
    vertices : (k, 3) float64
        Corners, world coordinates, rounded; (0, 3) when empty.
    face_starts, face_vertices : (f + 1,) and (j,) int64
        Polygon i is `face_vertices[face_starts[i]:face_starts[i + 1]]`, vertex ids counter-clockwise
        seen from outside. A flat kernel has one polygon; a segment and a point have none. `face_vertices` is made from
        ids of 32 bits when first asked for, and kept; so is `vertex_rows`.
    face_facets : (f,) int64
        The input facet that made each face; -1 - j for plane j of the domain.
    vertex_rows : (k, 3) int64
        Rows of `certificate.halfspaces`: three planes that meet in each vertex and nowhere else; (0, 3) for a flat
        kernel, whose vertices are known otherwise.
    volume, area : float
        Mesh units cubed and squared; the area of a flat kernel is that of its polygon.
    centroid : (3,) float64
        Centroid; NaN when empty.
    inertia : (3, 3) float64
        Second central moment, the integral of (x - c)(x - c)^T over the volume; zero when flat.
    deepest_point : (3,) float64
        Centre of a largest inscribed ball; NaN when empty.
    clearance : float
        Its distance from the nearest facet plane; 0 for a flat kernel, NaN when empty.
    domain : Domain or None
        Where the kernel was looked for; None means everywhere.
    cut_by_domain : bool
        Whether the domain removed a part of the kernel.
    is_bounded : bool
        Whether the kernel without the domain is bounded (an empty one is).
    unclipped_dimension : int
        Dimension of the kernel without the domain.
    max_residual : float
        No rounded vertex lies farther than this from the exact one, nor, so, outside a half-space; mesh units, for
        coordinates relative to the centre of the surface.
    volume_bounds : (float, float)
        Interval around `volume` that covers the rounding of the vertices.
    """

    dimension: int
    vertices: NDArray[np.float64]
    face_starts: NDArray[np.int64]
    face_facets: NDArray[np.int64]
    volume: float
    area: float
    centroid: NDArray[np.float64]
    inertia: NDArray[np.float64]
    deepest_point: NDArray[np.float64]
    clearance: float
    domain: Domain | None
    cut_by_domain: bool
    is_bounded: bool
    unclipped_dimension: int
    max_residual: float
    volume_bounds: tuple[float, float]
    _face_vertices: NDArray[np.int32]
    _vertex_rows: NDArray[np.signedinteger]
    _proof: Proof
    _unclipped_proof: Proof
    _wide_face_vertices: NDArray[np.int64] | None = field(init=False, default=None)
    _wide_vertex_rows: NDArray[np.int64] | None = field(init=False, default=None)

    def __repr__(self) -> str:
        """Name dimension, size and volume."""
        return (
            f"KernelPolytope(dimension={self.dimension}, vertices={len(self.vertices)}, "
            f"faces={len(self.face_facets)}, volume={self.volume:.6g})"
        )

    def _more_rows(self) -> dict[str, Any]:
        return {"certificate": self.certificate}

    def _picture(self) -> str:
        if self.dimension < 3 or not len(self.face_facets):
            return ""
        fans = [np.column_stack([np.full(len(f) - 2, f[0]), f[1:-1], f[2:]]) for f in self.faces]
        return thumbnail(self.vertices, np.concatenate(fans), ORANGE)

    @property
    def face_vertices(self) -> NDArray[np.int64]:
        """(j,) int64: vertex ids of the polygons, one behind the other; made at first use and kept."""
        if self._wide_face_vertices is None:
            object.__setattr__(self, "_wide_face_vertices", _wide(self._face_vertices))
        return cast("NDArray[np.int64]", self._wide_face_vertices)

    @property
    def vertex_rows(self) -> NDArray[np.int64]:
        """(k, 3) int64: rows of three half-spaces that meet in each vertex; made at first use and kept."""
        if self._wide_vertex_rows is None:
            object.__setattr__(self, "_wide_vertex_rows", _wide(self._vertex_rows))
        return cast("NDArray[np.int64]", self._wide_vertex_rows)

    @property
    def certificate(self) -> Certificate:
        """Proof of `dimension`; made at first use and kept."""
        return self._proof.certificate

    @property
    def unclipped_point(self) -> NDArray[np.float64] | None:
        """A point of the kernel without the domain, (3,), rounded; None where that is empty."""
        planes, point = self._unclipped_proof.planes, self._unclipped_proof.inside.local_point
        return None if point is None else read_only(planes.to_world(point))

    @property
    def unclipped_certificate(self) -> Certificate:
        """Proof of `unclipped_dimension`; made at first use and kept."""
        return self._unclipped_proof.certificate

    @property
    def faces(self) -> tuple[NDArray[np.int64], ...]:
        """The polygons as a tuple of vertex id arrays."""
        bounds = self.face_starts.tolist()
        return tuple(self.face_vertices[a:b] for a, b in pairwise(bounds))

    @property
    def is_empty(self) -> bool:
        """Whether no point sees the whole surface."""
        return self.dimension < 0

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points lie in the kernel, its border included, exactly for the doubles given.

        Parameters
        ----------
        points : (n, 3) array_like
            World coordinates.

        Returns
        -------
        (n,) bool
            Decided against the half-spaces, not the rounded corners.

        Raises
        ------
        TypeError, ValueError
            If `points` is not finite real (n, 3).

        Examples
        --------
        >>> import voxkernel
        >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> voxkernel.exact_kernel(tetrahedron).contains([[0.25, 0.25, 0.5], [0.25, 0.25, 0.5 + 2**-52]])
        array([ True, False])
        """
        xyz = as_points("points", points)
        if self.is_empty:
            return np.zeros(len(xyz), np.bool_)
        planes = self._proof.planes
        return points_inside(planes, xyz, np.isin(planes.facet_ids, self.face_facets))

    def classify(self, points: ArrayLike) -> NDArray[np.int8]:
        """Give 1 for points (n, 3) in the kernel and -1 for those outside; none is undecided (0)."""
        return np.where(self.contains(points), 1, -1).astype(np.int8)

    def exact_vertices(self) -> list[tuple[Fraction, Fraction, Fraction]]:
        """Give the corners as fractions, exact for the doubles given, in the order of `vertices`.

        Returns
        -------
        list of 3-tuples of Fraction
            World coordinates; empty for an empty kernel.

        Examples
        --------
        >>> import voxkernel
        >>> tetrahedron = ([[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> max(voxkernel.exact_kernel(tetrahedron).exact_vertices())
        (Fraction(3, 1), Fraction(0, 1), Fraction(0, 1))
        """
        planes = self._proof.planes
        found = self._proof.corners if self.dimension < 3 else meeting_points(planes, self._vertex_rows)
        return [planes.lattice_to_world(p) for p in found]

    def to_points(self) -> NDArray[np.float64]:
        """Give the corners, (k, 3): `vertices`."""
        return self.vertices

    def to_mesh(self) -> TriangleMesh:
        """Give the faces as a polygon mesh.

        Returns
        -------
        TriangleMesh
            Facet i of it is `faces[i]`.

        Raises
        ------
        MeshError
            If the kernel has no faces: it is empty, a point or a segment, or so small that its
            corners, rounded, are.
        """
        if not len(self.face_facets):
            raise MeshError(f"`kernel` must have faces to become a mesh; got a kernel of dimension {self.dimension}")
        return TriangleMesh.from_polygons(self.vertices, [list(map(int, f)) for f in self.faces], source="kernel")

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the kernel; the suffix picks the format.

        Parameters
        ----------
        path : str or os.PathLike
            ``.ply``: the polygons, each with its `face_facets` as ``input_facet``; a file without vertices for an
            empty kernel. ``.json``: what `to_dict` gives.

        Raises
        ------
        ValueError
            If the suffix is neither.
        OSError
            If the file cannot be written.
        """
        target = Path(path)
        if target.suffix.lower() == ".ply":
            write_polygon_ply(target, self.vertices, self.faces, self.face_facets)
        elif target.suffix.lower() == ".json":
            target.write_text(json_text(self.to_dict(), indent=2) + "\n", encoding="utf-8")
        else:
            raise ValueError(f"`path` must end in .ply or .json for a polytope; got {os.fspath(path)!r}")

    plot = plot_kernel

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers and lists, ready for JSON; NaN becomes None."""
        return {
            "dimension": self.dimension,
            "vertices": self.vertices.tolist(),
            "faces": [f.tolist() for f in self.faces],
            "face_facets": self.face_facets.tolist(),
            "vertex_rows": self.vertex_rows.tolist(),
            "volume": self.volume,
            "volume_bounds": list(self.volume_bounds),
            "area": self.area,
            "centroid": _plain(self.centroid),
            "inertia": self.inertia.tolist(),
            "deepest_point": _plain(self.deepest_point),
            "clearance": None if np.isnan(self.clearance) else self.clearance,
            "certificate": self.certificate.to_dict(),
            "domain": None if self.domain is None else {"kind": self.domain.kind, "volume": self.domain.volume},
            "cut_by_domain": self.cut_by_domain,
            "is_bounded": self.is_bounded,
            "unclipped_dimension": self.unclipped_dimension,
            "unclipped_point": None if (point := self.unclipped_point) is None else _plain(point),
            "max_residual": self.max_residual,
        }


def _wide(ids: NDArray[np.signedinteger]) -> NDArray[np.int64]:
    """Ids as users reckon with them, so that no product of two overflows."""
    return read_only(ids.astype(np.int64))


def _plain(point: NDArray[np.float64]) -> list[float] | None:
    return None if np.isnan(point).any() else [float(v) for v in point]
