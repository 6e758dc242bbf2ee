"""A surface or half-spaces -> the exact kernel as a convex polytope with a certificate: `exact_kernel`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from voxkernel._checks import as_depth
from voxkernel.exact.assembly import empty_kernel, polytope_of
from voxkernel.exact.certificate import Proof
from voxkernel.exact.domain_cut import is_bounded, is_cut, without_domain
from voxkernel.exact.kernel_polytope import KernelPolytope
from voxkernel.exact.kernel_shape import Shape, flat_shape, solid_shape
from voxkernel.exact.streamed_kernel import streamed_kernel
from voxkernel.halfspaces import Domain, Feasibility, HalfSpaces, find_feasibility
from voxkernel.halfspaces.surface_arguments import EXACT, SurfaceLike, surface_argument
from voxkernel.large import StreamedSurface
from voxkernel.large.passes import workers_of
from voxkernel.large.stream_mesh import reader_of
from voxkernel.large.surface_reader import SurfaceReader

__all__ = ["exact_kernel", "kernel_of_halfspaces", "kernel_of_stream"]

# Facets whose planes are looked at to see whether sides are flat.
_SAMPLE = 512


def exact_kernel(
    surface: SurfaceLike | StreamedSurface,
    *,
    facets: Any = None,
    domain: Any = None,
    threads: int = 1,
    scheduler: str | None = None,
) -> KernelPolytope:
    """Compute the kernel of a surface: the points from which the whole surface can be seen.

    The kernel is the intersection of the inner half-spaces of the facets [1]_. Whether it is empty, flat
    or solid is decided exactly for the float64 coordinates given, with a certificate.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces), HalfSpaces or StreamedSurface
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; half-spaces; or a surface of
        `stream_mesh`, which is read in chunks.
    facets : int array or bool mask, optional
        Restrict the surface to these facets; not of a streamed one.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Convex polytope in which the kernel is looked for. By default none for surfaces that bound a
        volume and "ball" for open ones, whose kernel can be unbounded.
    threads : int
        Threads, at least 1; the result does not depend on it.
    scheduler : str, optional
        Address of a Dask scheduler whose workers go through the chunks of a streamed surface, such as
        ``"tcp://10.0.0.1:8786"``; files must have the same path there. The result is that of this process alone.

    Returns
    -------
    KernelPolytope
        An empty kernel is a result of dimension -1.

    Raises
    ------
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.
    ValueError
        If the domain cannot be used, or half-spaces without a domain have an unbounded kernel; if there is no
        scheduler at the address, or the surface is none of `stream_mesh`.
    SolverError
        If the workers of the scheduler are lost and do not come back.

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
    n_threads = as_depth("threads", threads, 1, 256)
    if isinstance(surface, StreamedSurface):
        reader = reader_of(surface, facets)
        with workers_of(n_threads, scheduler) as workers:
            return kernel_of_stream(reader.by(workers), domain, threads=n_threads)
    if scheduler is not None:
        raise ValueError(f"`scheduler` must be None unless the surface is one of `stream_mesh`; got {scheduler!r}")
    found = surface_argument(surface, facets, threads=n_threads)
    return _kernel_in(found.halfspaces, found.domain(domain, EXACT), n_threads)


def kernel_of_halfspaces(halfspaces: HalfSpaces, domain: Domain | None, *, threads: int = 1) -> KernelPolytope:
    """Compute the kernel of half-spaces inside a domain (None: everywhere)."""
    return _kernel_in(halfspaces, domain, as_depth("threads", threads, 1, 256))


def _kernel_in(halfspaces: HalfSpaces, domain: Domain | None, threads: int) -> KernelPolytope:
    planes = halfspaces if domain is None else halfspaces.with_planes(domain.normals, domain.offsets)
    inside = find_feasibility(planes, threads=threads)
    unclipped = inside if domain is None else without_domain(halfspaces, planes, inside)
    if inside.dimension < 0:
        proof = Proof(planes, inside, (), is_own=True)
        bounded = unclipped.dimension < 0 or is_bounded(halfspaces)
        own = proof if domain is None else Proof(halfspaces, unclipped, (), is_own=False)
        return empty_kernel(domain, unclipped.dimension >= 0, bounded, proof, own)
    shape = _solid_shape(planes, inside, threads) if inside.dimension == 3 else flat_shape(planes, inside)
    if shape is None:
        raise ValueError("`domain` must be given for half-spaces whose kernel is unbounded; got None")
    cut = domain is not None and is_cut(halfspaces, domain, unclipped, inside, shape.vertices, shape.rows)
    proof = Proof(planes, inside, shape.corners, is_own=True)
    own = proof if domain is None else Proof(halfspaces, unclipped, (), is_own=False)
    return polytope_of(shape, domain, cut, not cut or is_bounded(halfspaces), proof, own)


def kernel_of_stream(surface: SurfaceReader, domain: Any, *, threads: int = 1) -> KernelPolytope:
    """Compute the kernel of a streamed surface; `domain` is what `exact_kernel` takes."""
    return streamed_kernel(surface, domain, partial(kernel_of_halfspaces, threads=threads))


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
