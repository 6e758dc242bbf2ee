"""The exact kernel as a convex polytope with a certificate: `exact_kernel`."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._exact_program import as_integers, deepest_rational_point, rank_of
from voxkernel._flat import rational_kernel, rational_moments
from voxkernel._solid import (
    convex_surface,
    polyhedron_around,
    polyhedron_moments,
    relevant_rows,
    rows_reaching,
)
from voxkernel.certificate import Certificate
from voxkernel.domain import Domain, as_domain, ball_domain
from voxkernel.errors import MeshError
from voxkernel.feasibility import Feasibility, find_feasibility
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh_input import as_mesh
from voxkernel.predicates import touched_and_violated

__all__ = ["KernelPolytope", "exact_kernel", "resolve_surface"]

# Below this share of depth to size, a solid is left to rational arithmetic.
_THIN = 1e-5
# A kernel smaller than this share of the surface gets its plane distances from rationals.
_SMALL = 1e-3


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
        return tuple(self.face_vertices[a:b] for a, b in zip(bounds[:-1], bounds[1:], strict=True))

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
            If the kernel has no faces: it is empty, a point or a segment.
        """
        if not len(self.face_facets):
            raise MeshError(
                f"`kernel` must have faces to become a mesh; got a kernel of dimension {self.dimension}"
            )
        return TriangleMesh.from_polygons(
            self.vertices, [list(map(int, f)) for f in self.faces], source="kernel"
        )

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
            "domain": None
            if self.domain is None
            else {"kind": self.domain.kind, "volume": self.domain.volume},
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
    unclipped_point = (
        None if unclipped.point is None else halfspaces.to_world(halfspaces.from_lattice(unclipped.point))
    )
    if inside.dimension < 0:
        bounded = unclipped.dimension < 0 or is_bounded(halfspaces)
        return KernelPolytope(
            -1, read_only(np.empty((0, 3))), *(read_only(np.zeros(k, np.int64)) for k in (1, 0, 0)), 0.0, 0.0,
            read_only(np.full(3, np.nan)), read_only(np.zeros((3, 3))), read_only(np.full(3, np.nan)), float("nan"),
            _certificate(planes, inside, []), domain, unclipped.dimension >= 0, bounded,
            unclipped.dimension, unclipped_point, _unclipped_certificate(halfspaces, unclipped), 0.0, (0.0, 0.0),
        )  # fmt: skip
    shape = _solid_shape(planes, inside) if inside.dimension == 3 else None
    if shape is None:
        shape = _rational_shape(planes, inside)
    if shape is None:
        raise ValueError("`domain` must be given for half-spaces whose kernel is unbounded; got None")
    vertices, starts, ring, rows, numbers, deepest, clearance, corners, residual, rounding = shape
    facet_ids = planes.facet_ids[rows]
    is_cut = domain is not None and _is_cut(halfspaces, domain, unclipped, inside, vertices)
    bounded = not is_cut or is_bounded(halfspaces)
    scale = planes.scale
    certificate = _certificate(planes, inside, corners)
    volume, centroid, inertia, area = numbers
    return KernelPolytope(
        inside.dimension, read_only(planes.to_world(vertices)), read_only(starts), read_only(ring),
        read_only(facet_ids), volume * scale**3, area * scale**2, read_only(planes.to_world(centroid)),
        read_only(inertia * scale**5), read_only(planes.to_world(deepest)), clearance * scale,
        certificate, domain, is_cut, bounded, unclipped.dimension, unclipped_point,
        certificate if domain is None else _unclipped_certificate(halfspaces, unclipped), residual * scale,
        (volume * scale**3 * max(0.0, 1.0 - rounding), volume * scale**3 * (1.0 + rounding)),
    )  # fmt: skip


def is_bounded(halfspaces: HalfSpaces) -> bool:
    """Whether a non-empty kernel is bounded: no direction stays inside all half-spaces, decided exactly."""
    if halfspaces.bounds_volume:
        return True
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    return find_feasibility(halfspaces.recession_cone().with_planes(cube, np.ones(6))).dimension == 0


_Numbers = tuple[float, NDArray[np.float64], NDArray[np.float64], float]
_Shape = tuple[
    NDArray[np.float64],
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
    _Numbers,
    NDArray[np.float64],
    float,
    list[tuple[Any, Any, Any]],
    float,
    float,
]


def _plain(point: NDArray[np.float64]) -> list[float] | None:
    return None if np.isnan(point).any() else [float(v) for v in point]


def _solid_shape(planes: HalfSpaces, inside: Feasibility) -> _Shape | None:
    """Find corners and faces in floating point; None where rationals must do it."""
    from voxkernel._loops.linear_program import deepest_point

    point = inside.local_point
    if point is None or inside.clearance <= 0.0:
        return None
    rows, _ = relevant_rows(planes, point, inside.working_set)
    solid = convex_surface(planes, point) if 2 * len(rows) > len(planes) else None
    near = planes
    if solid is None:
        near = planes.select(rows)
        heads = np.flatnonzero(near.coplanar_groups() == np.arange(len(near)))
        rows, near = rows[heads], near.select(heads)
        solid = polyhedron_around(near, point)
    if solid is None:
        return None
    basis, multipliers, best = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
    deepest_point(
        near.local_normals, near.local_offsets, solid.rows, len(solid.rows), 2.0**28, basis, multipliers, best,
        1e-14 * solid.extent, 2000,
    )  # fmt: skip
    slack = near.local_offsets[solid.rows] - near.local_normals[solid.rows] @ best[:3]
    deepest, clearance = best[:3], float(slack.min())
    if clearance < inside.clearance:  # the solver gave up early: keep the point already proven
        deepest, clearance = point, inside.clearance
    if clearance < _THIN * solid.extent:
        return None
    if solid.extent < _SMALL:
        solid = polyhedron_around(near, deepest, slacks=_exact_distances(near, deepest)) or solid
    volume, centroid, inertia, area = polyhedron_moments(solid)
    corners = solid.center + solid.vertices
    # The rows left out are clear of an outer polyhedron by 1e-9 of its size, so of these corners too.
    _, excess = rows_reaching(near, solid)
    owner = np.repeat(solid.rows, np.diff(solid.start))
    on_face = np.abs(
        np.einsum("ij,ij->i", near.local_normals[owner], corners[solid.ring]) - near.local_offsets[owner]
    )
    # Moving every plane by the largest misfit changes the volume by less than this share.
    misfit = max(float(on_face.max()), excess) + 2 * float(near.local_errors[solid.rows].max())
    rounding = 4.0 * misfit / clearance + 1e-14
    numbers = volume, solid.center + centroid, inertia, area
    return (
        corners,
        solid.start,
        solid.ring,
        rows[solid.rows],
        numbers,
        deepest,
        clearance,
        [],
        max(0.0, excess),
        rounding,
    )


def _exact_distances(planes: HalfSpaces, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of a local point from the planes, each rounded once from its exact value."""
    lattice = planes.to_lattice(point)
    unit = planes.scale * planes.lattice_unit
    distances = np.empty(len(planes))
    for i, (a, b, c, d) in enumerate(planes.integer_planes(range(len(planes)))):
        slack = d - (a * lattice[0] + b * lattice[1] + c * lattice[2])
        distances[i] = float(slack * (1 << 64) / isqrt((a * a + b * b + c * c) << 128) / Fraction(unit))
    return distances


def _rational_shape(planes: HalfSpaces, inside: Feasibility) -> _Shape | None:
    """Find corners and faces in rational arithmetic; None for an unbounded kernel."""
    kernel = rational_kernel(planes, inside)
    if kernel is None or inside.point is None:
        return None
    corners, faces = kernel
    unit = Fraction(planes.scale) * planes.lattice_unit
    volume, area, centroid, inertia = rational_moments(inside.dimension, corners, [f for _, f in faces])
    numbers = (
        float(volume / unit**3), planes.from_lattice(centroid),
        np.array([[float(v / unit**5) for v in line] for line in inertia]), float(area / unit**2),
    )  # fmt: skip
    vertices = np.array([planes.from_lattice(c) for c in corners])
    deepest, clearance = planes.from_lattice(inside.point), 0.0
    rows = [r for r, _ in faces]
    rings = [np.array(f, np.int64) for _, f in faces]
    if inside.dimension == 3:
        used = planes.integer_planes(rows)
        optimum = deepest_rational_point([(p[:3], Fraction(p[3])) for p in used], 3, unit=unit)
        x, y, z = optimum.point
        deepest = planes.from_lattice((x, y, z))
        clearance = min(
            float((p[3] - p[0] * x - p[1] * y - p[2] * z) / isqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2) / unit)
            for p in used
        )
    elif inside.dimension == 2:
        ring = [faces[0][1][0]]
        after = dict((f[0], f[1]) for _, f in faces)
        while after[ring[-1]] != ring[0]:
            ring.append(after[ring[-1]])
        rings, rows = [np.array(ring, np.int64)], [inside.witnesses[-1].ids[0]]
    else:
        rings, rows = [], []
    residual = float(np.max(planes.local_normals @ vertices.T - planes.local_offsets[:, None], initial=0.0))
    starts = np.concatenate([[0], np.cumsum([len(r) for r in rings], dtype=np.int64)])
    ring_array = np.concatenate(rings) if rings else np.empty(0, np.int64)
    return (
        vertices,
        starts,
        ring_array,
        np.array(rows, np.int64),
        numbers,
        deepest,
        clearance,
        corners,
        residual,
        1e-14,
    )


def _certificate(planes: HalfSpaces, inside: Feasibility, corners: list[tuple[Any, Any, Any]]) -> Certificate:
    """Assemble the proof of the dimension from what feasibility and the corners know."""
    dimension = inside.dimension
    if dimension == 3 and inside.point is not None:
        return Certificate("solid", 3, (), (), (planes.lattice_to_world(inside.point),), planes, ())
    witness = inside.witnesses[-1]
    facet_ids = tuple(int(planes.facet_ids[i]) for i in witness.ids)
    points: tuple[Any, ...] = ()
    if dimension >= 0:
        chosen = next(
            c
            for c in combinations(corners, dimension + 1)
            if rank_of([as_integers([u - v for u, v in zip(p, c[0], strict=True)]) for p in c[1:]])
            == dimension
        )
        points = tuple(planes.lattice_to_world(c) for c in chosen)
    kind = "empty" if dimension < 0 else "flat"
    return Certificate(kind, dimension, facet_ids, witness.multipliers, points, planes, witness.ids)


def _unclipped_certificate(halfspaces: HalfSpaces, unclipped: Feasibility) -> Certificate:
    """Prove the dimension without the domain; a flat kernel is cut out in a cube if it is unbounded."""
    if unclipped.dimension in (-1, 3):
        return _certificate(halfspaces, unclipped, [])
    assert unclipped.point is not None
    corners: list[tuple[Any, Any, Any]] = [unclipped.point]
    unit = Fraction(halfspaces.scale) * halfspaces.lattice_unit
    for (
        w
    ) in unclipped.directions:  # the point is in the relative interior: go a little way along each direction
        step = unit / max(map(abs, w))
        while True:
            corner = tuple(u + step * v for u, v in zip(unclipped.point, w, strict=True))
            if not len(touched_and_violated(halfspaces, corner)[1]):
                break
            step /= 4096
        corners.append((corner[0], corner[1], corner[2]))
    return _certificate(halfspaces, unclipped, corners)


def _is_cut(
    halfspaces: HalfSpaces,
    domain: Domain,
    unclipped: Feasibility,
    inside: Feasibility,
    vertices: NDArray[np.float64],
) -> bool:
    """Whether a part of the kernel lies outside the domain: beyond one of its planes there is a full-dimensional part."""
    if inside.dimension != unclipped.dimension:
        return True
    outer = HalfSpaces.from_planes(domain.normals, domain.offsets)
    reach = 1e-9 * halfspaces.scale
    world = halfspaces.to_world(vertices)
    touched = np.flatnonzero((outer.normals @ world.T - outer.offsets[:, None]).max(axis=1) >= -reach)
    for j in touched:
        beyond = halfspaces.with_planes(-domain.normals[j : j + 1], -domain.offsets[j : j + 1])
        if find_feasibility(beyond).dimension == unclipped.dimension:
            return True
    return False
