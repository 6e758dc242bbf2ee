"""The exact kernel as a convex polytope with a certificate: `exact_kernel`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel.errors import MeshError
from voxkernel.exact.certificate import Certificate, certify, certify_unclipped
from voxkernel.exact.domain_cut import is_bounded, is_cut
from voxkernel.exact.kernel_shape import Shape, rational_shape, solid_shape
from voxkernel.halfspaces import Domain, HalfSpaces, ball_domain, find_feasibility
from voxkernel.halfspaces.domain import as_domain
from voxkernel.mesh import TriangleMesh, as_mesh

__all__ = ["KernelPolytope", "exact_kernel", "kernel_of_halfspaces", "resolve_surface"]

# Above what a number below the normal range of doubles loses, several times over.
_LEAST = 2.0**-1070


@dataclass(frozen=True, slots=True, repr=False)
class KernelPolytope:
    """The kernel of a surface: a convex polytope, possibly flat or empty.

    Attributes
    ----------
    dimension : int
        -1 empty, 0 point, 1 segment, 2 flat polygon, 3 solid; exact for the doubles given.
    vertices : (k, 3) float64
        Corners, world coordinates, rounded; (0, 3) when empty.
    face_starts, face_vertices : (f + 1,) and (j,) int64
        Polygon i is `face_vertices[face_starts[i]:face_starts[i + 1]]`, vertex ids counter-clockwise
        seen from outside. A flat kernel has one polygon; a segment and a point have none.
    face_facets : (f,) int64
        The input facet that made each face; -1 - j for plane j of the domain.
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
    certificate : Certificate
        Proof of `dimension`.
    domain : Domain or None
        Where the kernel was looked for; None means everywhere.
    cut_by_domain : bool
        Whether the domain removed a part of the kernel.
    is_bounded : bool
        Whether the kernel without the domain is bounded (an empty one is).
    unclipped_dimension : int
        Dimension of the kernel without the domain.
    unclipped_point : (3,) float64 or None
        A point of the kernel without the domain, rounded.
    unclipped_certificate : Certificate
        Proof of `unclipped_dimension`.
    max_residual : float
        Largest distance by which a rounded vertex lies outside a half-space, mesh units.
    volume_bounds : (float, float)
        Interval around `volume` that covers the rounding of the vertices.
    """

    dimension: int
    vertices: NDArray[np.float64]
    face_starts: NDArray[np.int64]
    face_vertices: NDArray[np.int64]
    face_facets: NDArray[np.int64]
    volume: float
    area: float
    centroid: NDArray[np.float64]
    inertia: NDArray[np.float64]
    deepest_point: NDArray[np.float64]
    clearance: float
    certificate: Certificate
    domain: Domain | None
    cut_by_domain: bool
    is_bounded: bool
    unclipped_dimension: int
    unclipped_point: NDArray[np.float64] | None
    unclipped_certificate: Certificate
    max_residual: float
    volume_bounds: tuple[float, float]

    def __repr__(self) -> str:
        """Name dimension, size and volume."""
        return (
            f"KernelPolytope(dimension={self.dimension}, vertices={len(self.vertices)}, "
            f"faces={len(self.face_facets)}, volume={self.volume:.6g})"
        )

    @property
    def faces(self) -> tuple[NDArray[np.int64], ...]:
        """The polygons as a tuple of vertex id arrays."""
        bounds = self.face_starts.tolist()
        return tuple(self.face_vertices[a:b] for a, b in pairwise(bounds))

    @property
    def is_empty(self) -> bool:
        """Whether no point sees the whole surface."""
        return self.dimension < 0

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

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers and lists, ready for JSON; NaN becomes None."""
        return {
            "dimension": self.dimension,
            "vertices": self.vertices.tolist(),
            "faces": [f.tolist() for f in self.faces],
            "face_facets": self.face_facets.tolist(),
            "volume": self.volume,
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
            "unclipped_point": None if self.unclipped_point is None else _plain(self.unclipped_point),
            "max_residual": self.max_residual,
        }


def exact_kernel(surface: Any, *, facets: Any = None, domain: Any = None) -> KernelPolytope:
    """Compute the kernel of a surface: the points from which the whole surface can be seen.

    The kernel is the intersection of the inner half-spaces of the facets [1]_. Whether it is empty, flat
    or solid is decided exactly for the float64 coordinates given, with a certificate.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Convex polytope in which the kernel is looked for. By default none for surfaces that bound a
        volume and "ball" for open ones, whose kernel can be unbounded.

    Returns
    -------
    KernelPolytope
        An empty kernel is a result of dimension -1.

    Raises
    ------
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.
    ValueError
        If the domain cannot be used, or half-spaces without a domain have an unbounded kernel.

    Notes
    -----
    One pass over the facets builds the planes, two or three find a deep point or a witness of at most
    four facets that none exists, two drop planes that cannot matter; the rest goes to Qhull once.
    Kernels too thin for floating point are cut out in rational arithmetic.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, Theorem 1.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> kernel = voxkernel.exact_kernel(tetrahedron)
    >>> kernel.dimension, round(kernel.volume, 12)
    (3, 0.166666666667)
    """
    halfspaces, region = resolve_surface(surface, facets=facets, domain=domain)
    return kernel_of_halfspaces(halfspaces, region)


def resolve_surface(
    surface: Any, *, facets: Any = None, domain: Any = None, default: str = "ball"
) -> tuple[HalfSpaces, Domain | None]:
    """Turn surface and domain arguments into half-spaces and a domain, with the defaults of the library."""
    if isinstance(surface, HalfSpaces):
        halfspaces = surface if facets is None else surface.select(np.asarray(facets))
        return halfspaces, as_domain(domain, None)
    mesh = as_mesh(surface, facets=facets)
    halfspaces = HalfSpaces.from_mesh(mesh)
    if domain is None and not halfspaces.bounds_volume:
        return halfspaces, ball_domain(mesh) if default == "ball" else as_domain(default, mesh)
    return halfspaces, as_domain(domain, mesh)


def kernel_of_halfspaces(halfspaces: HalfSpaces, domain: Domain | None) -> KernelPolytope:
    """Compute the kernel of half-spaces inside a domain (None: everywhere)."""
    planes = halfspaces if domain is None else halfspaces.with_planes(domain.normals, domain.offsets)
    inside = find_feasibility(planes)
    unclipped = inside if domain is None else find_feasibility(halfspaces)
    point = unclipped.local_point
    clip: dict[str, Any] = {
        "domain": domain,
        "unclipped_dimension": unclipped.dimension,
        "unclipped_point": None if point is None else halfspaces.to_world(point),
    }
    if inside.dimension < 0:
        certificate = certify(planes, inside, [])
        return _empty_kernel(
            certificate=certificate,
            cut_by_domain=unclipped.dimension >= 0,
            is_bounded=unclipped.dimension < 0 or is_bounded(halfspaces),
            unclipped_certificate=certificate if domain is None else certify_unclipped(halfspaces, unclipped),
            **clip,
        )
    shape = solid_shape(planes, inside) if inside.dimension == 3 else None
    if shape is None:
        shape = rational_shape(planes, inside)
    if shape is None:
        raise ValueError("`domain` must be given for half-spaces whose kernel is unbounded; got None")
    cut = domain is not None and is_cut(halfspaces, domain, unclipped, inside, shape.vertices)
    certificate = certify(planes, inside, shape.corners)
    scale = planes.scale
    volume = shape.volume * scale**3
    return KernelPolytope(
        dimension=inside.dimension,
        vertices=read_only(planes.to_world(shape.vertices)),
        face_starts=read_only(shape.face_starts),
        face_vertices=read_only(shape.face_vertices),
        face_facets=read_only(planes.facet_ids[shape.rows]),
        volume=volume,
        area=shape.area * scale**2,
        centroid=read_only(planes.to_world(shape.centroid)),
        inertia=read_only(shape.inertia * scale**5),
        deepest_point=read_only(planes.to_world(shape.deepest)),
        clearance=shape.clearance * scale,
        certificate=certificate,
        cut_by_domain=cut,
        is_bounded=not cut or is_bounded(halfspaces),
        unclipped_certificate=certificate if domain is None else certify_unclipped(halfspaces, unclipped),
        max_residual=shape.residual * scale,
        volume_bounds=_volume_bounds(shape, scale) if inside.dimension == 3 else (0.0, 0.0),
        **clip,
    )


def _volume_bounds(shape: Shape, scale: float) -> tuple[float, float]:
    """Bounds that hold where the volume is too small or too large for a double with all its digits, too."""
    lower, upper = (
        max(0.0, shape.volume * (1.0 - shape.rounding) - _LEAST) * scale**3,
        (shape.volume * (1.0 + shape.rounding) + _LEAST) * scale**3,
    )
    return max(0.0, float(np.nextafter(lower, -np.inf))), float(np.nextafter(upper, np.inf))


def _empty_kernel(**facts: Any) -> KernelPolytope:
    nowhere = read_only(np.full(3, np.nan))
    return KernelPolytope(
        dimension=-1,
        vertices=read_only(np.empty((0, 3))),
        face_starts=read_only(np.zeros(1, np.int64)),
        face_vertices=read_only(np.empty(0, np.int64)),
        face_facets=read_only(np.empty(0, np.int64)),
        volume=0.0,
        area=0.0,
        centroid=nowhere,
        inertia=read_only(np.zeros((3, 3))),
        deepest_point=nowhere,
        clearance=float("nan"),
        max_residual=0.0,
        volume_bounds=(0.0, 0.0),
        **facts,
    )


def _plain(point: NDArray[np.float64]) -> list[float] | None:
    return None if np.isnan(point).any() else [float(v) for v in point]
