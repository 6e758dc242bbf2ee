"""Where kernels are looked for: a ball, the convex hull, the bounding box, or given half-spaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import read_only
from voxkernel._frozen import Frozen
from voxkernel.halfspaces.area_moments import mesh_moments
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.edges import half_edges

__all__ = [
    "Domain",
    "as_domain",
    "ball_domain",
    "bounds_domain",
    "box_domain",
    "framed_ball",
    "hull_domain",
    "planes_domain",
    "points_hull",
    "surface_frame",
]

BALL_FACTOR = 1.3
_SUBDIVISIONS = 3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Domain(Frozen):
    """A bounded convex polytope in which a kernel is looked for.

    Attributes
    ----------
    kind : str
        "ball", "hull", "box" or "planes".
    normals, offsets : (k, 3) and (k,) float64
        The polytope is `normals . x <= offsets`, world coordinates; these doubles are exact.
    vertices : (v, 3) float64
        Corners of the polytope, rounded.
    volume : float
        Volume of the polytope, mesh units cubed, rounded.
    """

    kind: str
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    vertices: NDArray[np.float64]
    volume: float

    def __repr__(self) -> str:
        """Name the kind and the volume."""
        return f"Domain(kind={self.kind!r}, n_planes={len(self.offsets)}, volume={self.volume:.6g})"


def as_domain(domain: Any, mesh: TriangleMesh | None) -> Domain | None:
    """Turn a domain argument into a `Domain`; None stays None.

    Parameters
    ----------
    domain : Domain, {"ball", "hull", "box"}, HalfSpaces, (normals, offsets) or None
        What the caller gave.
    mesh : TriangleMesh or None
        The surface that "ball", "hull" and "box" are made from.

    Returns
    -------
    Domain or None

    Raises
    ------
    ValueError
        If the name is unknown, needs a mesh that is not there, or the planes bound no volume.
    TypeError
        If `domain` is something else.
    """
    if domain is None or isinstance(domain, Domain):
        return domain
    if isinstance(domain, str):
        makers = {"ball": ball_domain, "hull": hull_domain, "box": box_domain}
        if domain not in makers:
            raise ValueError(f"`domain` must be one of {', '.join(map(repr, makers))}; got {domain!r}")
        if mesh is None:
            raise ValueError(f"`domain` must be given as half-spaces when there is no mesh; got {domain!r}")
        return makers[domain](mesh)
    if isinstance(domain, HalfSpaces):
        return planes_domain(domain.normals, domain.offsets)
    if isinstance(domain, tuple) and len(domain) == 2:
        return planes_domain(*domain)
    raise TypeError(
        "`domain` must be 'ball', 'hull', 'box', a Domain, HalfSpaces or (normals, offsets); "
        f"got {type(domain).__name__}"
    )


def ball_domain(mesh: TriangleMesh, *, factor: float = BALL_FACTOR) -> Domain:
    """Make the default domain of open surfaces: a geodesic polytope around a ball.

    The ball has its centre at the area centroid and `factor` times the largest vertex distance as
    radius. The polytope has 642 planes that touch it, in the principal frame of the surface, so it
    moves with the surface; the icosahedral directions are symmetric under a change of sign of any
    axis, so the signs of the frame do not matter.

    Parameters
    ----------
    mesh : TriangleMesh
        The surface.
    factor : float
        Radius over the largest distance of a vertex from the area centroid, > 0.

    Returns
    -------
    Domain
        Of kind "ball".
    """
    centroid, frame = surface_frame(mesh)
    reach = float(np.sqrt(((mesh.used_vertices - centroid) ** 2).sum(axis=1).max()))
    return framed_ball(centroid, frame, factor * reach)


def framed_ball(centroid: NDArray[np.float64], frame: NDArray[np.float64], radius: float) -> Domain:
    """Make the polytope of `ball_domain` around a ball, its planes in a frame."""
    unit = _unit_ball()
    normals = unit.normals @ frame
    return Domain(
        "ball", read_only(normals), read_only(normals @ centroid + radius),
        read_only(unit.vertices @ frame * radius + centroid), unit.volume * radius**3,
    )  # fmt: skip


def hull_domain(mesh: TriangleMesh) -> Domain:
    """Make the convex hull of the vertices in use; the default where nothing may leak outside a shape.

    Parameters
    ----------
    mesh : TriangleMesh
        The surface; its vertices must not lie in one plane.

    Returns
    -------
    Domain
        Of kind "hull".

    Raises
    ------
    ValueError
        If the vertices lie in one plane.
    """
    return points_hull(mesh.used_vertices)


def points_hull(used: NDArray[np.float64]) -> Domain:
    """Make the convex hull of points; ValueError where they lie in one plane, or nearly."""
    from scipy.spatial import ConvexHull, QhullError

    center = used.mean(axis=0)
    try:
        hull = ConvexHull(used - center)
    except (QhullError, ValueError):
        raise ValueError(
            "`domain` must have a volume; got the hull of a surface that lies in one plane, or nearly"
        ) from None
    equations = np.unique(hull.equations, axis=0)  # triangles of one face share theirs
    normals = np.ascontiguousarray(equations[:, :3])
    return Domain(
        kind="hull",
        normals=read_only(normals),
        offsets=read_only(normals @ center - equations[:, 3]),
        vertices=read_only(used[hull.vertices]),
        volume=float(hull.volume),
    )


def box_domain(mesh: TriangleMesh) -> Domain:
    """Make the axis-aligned bounding box of the vertices in use.

    Parameters
    ----------
    mesh : TriangleMesh
        The surface; its box must not be flat.

    Returns
    -------
    Domain
        Of kind "box".

    Raises
    ------
    ValueError
        If the box is flat.
    """
    return bounds_domain(*mesh.bounds)


def bounds_domain(low: NDArray[np.float64], high: NDArray[np.float64]) -> Domain:
    """Make the box between two corners; ValueError where it is flat."""
    if not (high > low).all():
        raise ValueError("`domain` must have a volume; got the bounding box of a surface that lies in one plane")
    return _make("box", np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([high, -low]))


def planes_domain(normals: ArrayLike, offsets: ArrayLike) -> Domain:
    """Make a domain from half-spaces `normals . x <= offsets` that bound a volume.

    Parameters
    ----------
    normals : (k, 3) array_like
        Outward normals of any length but zero.
    offsets : (k,) array_like
        Right-hand sides.

    Returns
    -------
    Domain
        Of kind "planes".

    Raises
    ------
    ValueError
        If the half-spaces bound no finite volume.
    """
    planes = HalfSpaces.from_planes(normals, offsets)
    return _make("planes", np.array(normals, dtype=np.float64), np.array(offsets, dtype=np.float64), planes=planes)


def surface_frame(mesh: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute area centroid and principal frame of a surface.

    Parameters
    ----------
    mesh : TriangleMesh
        The surface.

    Returns
    -------
    centroid : (3,) float64
        Area centroid, world coordinates.
    frame : (3, 3) float64
        Rows are the principal axes of the area distribution, longest first, right-handed; the signs
        of the first two follow the third moments, so the frame turns with the surface unless the
        surface is symmetric.
    """
    moments = mesh_moments(mesh)
    return moments.centroid, moments.axes(moments.spread)


@lru_cache(maxsize=1)
def _unit_ball() -> Domain:
    """Make the geodesic polytope around the unit ball once; every ball domain is similar to it."""
    normals = _geodesic_directions(_SUBDIVISIONS)
    return _make("ball", normals, np.ones(len(normals)))


def _make(
    kind: str, normals: NDArray[np.float64], offsets: NDArray[np.float64], *, planes: HalfSpaces | None = None
) -> Domain:
    """Compute corners and volume with Qhull about a deep point."""
    from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

    from voxkernel.halfspaces.feasibility import find_feasibility

    if planes is None:
        planes = HalfSpaces.from_planes(normals, offsets)
    inside = find_feasibility(planes)
    message = "`domain` must be half-spaces that bound a finite volume; got half-spaces that do not"
    if inside.dimension < 3 or inside.local_point is None:
        raise ValueError(message)
    rows = np.column_stack([planes.local_normals, planes.local_normals @ inside.local_point - planes.local_offsets])
    box = np.column_stack([np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, -(2.0**20))])
    try:
        local = HalfspaceIntersection(np.concatenate([rows, box]), np.zeros(3)).intersections
        hull = ConvexHull(local)
    except QhullError:
        raise ValueError(message) from None
    if np.abs(local).max() > 2.0**19:
        raise ValueError(message)
    vertices = planes.to_world(local[hull.vertices] + inside.local_point)
    return Domain(
        kind, read_only(np.ascontiguousarray(normals)), read_only(np.ascontiguousarray(offsets)),
        read_only(vertices), float(hull.volume * planes.scale**3),
    )  # fmt: skip


def _geodesic_directions(subdivisions: int) -> NDArray[np.float64]:
    """Unit vectors of a subdivided icosahedron, symmetric under a change of sign of any coordinate."""
    from scipy.spatial import ConvexHull

    golden = (1 + 5**0.5) / 2
    points = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)], dtype=np.float64)
    points = np.concatenate([np.roll(points, k, axis=1) for k in range(3)])
    for _ in range(subdivisions):
        simplices = np.asarray(ConvexHull(points).simplices, dtype=np.int64)
        middles = points[half_edges(simplices, len(points)).ends(simplices)].sum(axis=1)
        points = np.concatenate([points, middles])
        points /= np.linalg.norm(points, axis=1)[:, None]
    return points
