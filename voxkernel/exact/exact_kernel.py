"""A surface or half-spaces -> the exact kernel as a convex polytope with a certificate: `exact_kernel`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from voxkernel._checks import as_depth, read_only
from voxkernel.exact.certificate import Proof
from voxkernel.exact.domain_cut import is_bounded, is_cut, without_domain
from voxkernel.exact.kernel_polytope import KernelPolytope
from voxkernel.exact.kernel_shape import Shape, flat_shape, solid_shape
from voxkernel.halfspaces import Domain, Feasibility, HalfSpaces, find_feasibility
from voxkernel.halfspaces.surface_arguments import EXACT, SurfaceLike, surface_argument

__all__ = ["exact_kernel", "kernel_of_halfspaces"]

# Facets whose planes are looked at to see whether sides are flat.
_SAMPLE = 512


def exact_kernel(
    surface: SurfaceLike, *, facets: Any = None, domain: Any = None, threads: int = 1
) -> KernelPolytope:
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
    threads : int
        Threads, at least 1; the result does not depend on it.

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
    four facets that none exists, two drop planes that cannot matter. Of the rest the convex hull of the dual points
    is taken: which planes meet where is decided by the sign of a determinant of the planes, in floating point where a
    bound on its error allows, else in integers made from the doubles given. So faces and vertices are exact; their
    coordinates are rounded.

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
    found = surface_argument(surface, facets, threads=as_depth("threads", threads, 1, 256))
    return kernel_of_halfspaces(found.halfspaces, found.domain(domain, EXACT), threads=threads)


def kernel_of_halfspaces(halfspaces: HalfSpaces, domain: Domain | None, *, threads: int = 1) -> KernelPolytope:
    """Compute the kernel of half-spaces inside a domain (None: everywhere)."""
    threads = as_depth("threads", threads, 1, 256)
    planes = halfspaces if domain is None else halfspaces.with_planes(domain.normals, domain.offsets)
    inside = find_feasibility(planes)
    unclipped = inside if domain is None else without_domain(halfspaces, planes, inside)
    if inside.dimension < 0:
        proof = Proof(planes, inside, (), is_own=True)
        return _empty_kernel(
            cut_by_domain=unclipped.dimension >= 0,
            is_bounded=unclipped.dimension < 0 or is_bounded(halfspaces),
            domain=domain,
            unclipped_dimension=unclipped.dimension,
            _proof=proof,
            _unclipped_proof=proof if domain is None else Proof(halfspaces, unclipped, (), is_own=False),
        )
    shape = _solid_shape(planes, inside, threads) if inside.dimension == 3 else flat_shape(planes, inside)
    if shape is None:
        raise ValueError("`domain` must be given for half-spaces whose kernel is unbounded; got None")
    cut = domain is not None and is_cut(halfspaces, domain, unclipped, inside, shape.vertices, shape.rows)
    proof = Proof(planes, inside, shape.corners, is_own=True)
    return KernelPolytope(
        dimension=inside.dimension,
        vertices=shape.vertices,
        face_starts=shape.face_starts,
        face_vertices=shape.face_vertices,
        face_facets=read_only(planes.facet_ids[shape.rows]),
        vertex_rows=shape.vertex_rows,
        volume=shape.volume,
        area=shape.area,
        centroid=shape.centroid,
        inertia=shape.inertia,
        deepest_point=shape.deepest,
        clearance=shape.clearance,
        domain=domain,
        cut_by_domain=cut,
        is_bounded=not cut or is_bounded(halfspaces),
        unclipped_dimension=unclipped.dimension,
        max_residual=shape.residual,
        volume_bounds=shape.volume_bounds,
        _proof=proof,
        _unclipped_proof=proof if domain is None else Proof(halfspaces, unclipped, (), is_own=False),
    )


def _solid_shape(planes: HalfSpaces, inside: Feasibility, threads: int) -> Shape | None:
    """Merge coplanar facets first where a sample says that sides are flat: then few planes are left to decide about."""
    if len(planes) < 2 * _SAMPLE:
        return solid_shape(planes, inside, threads=threads)
    sample = np.arange(0, len(planes), len(planes) // _SAMPLE)
    if 2 * len(planes.first_of_planes(sample)) > len(sample):
        return solid_shape(planes, inside, threads=threads)
    groups = planes.coplanar_groups(threads=threads)
    heads = np.flatnonzero(groups == np.arange(len(groups)))
    working_set = np.unique(np.searchsorted(heads, groups[inside.working_set]))
    merged = replace(planes.select(heads), bounds_volume=planes.bounds_volume)
    shape = solid_shape(merged, replace(inside, working_set=working_set), threads=threads)
    return None if shape is None else shape._replace(rows=heads[shape.rows], vertex_rows=heads[shape.vertex_rows])


def _empty_kernel(**facts: Any) -> KernelPolytope:
    nowhere = read_only(np.full(3, np.nan))
    return KernelPolytope(
        dimension=-1,
        vertices=read_only(np.empty((0, 3))),
        face_starts=read_only(np.zeros(1, np.int64)),
        face_vertices=read_only(np.empty(0, np.int64)),
        face_facets=read_only(np.empty(0, np.int64)),
        vertex_rows=read_only(np.empty((0, 3), np.int64)),
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
