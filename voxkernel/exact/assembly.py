"""What is known about a kernel -> `KernelPolytope`."""

from __future__ import annotations

import numpy as np

from voxkernel._checks import read_only
from voxkernel.exact.certificate import Proof
from voxkernel.exact.kernel_polytope import KernelPolytope
from voxkernel.exact.kernel_shape import Shape
from voxkernel.halfspaces import Domain

__all__ = ["empty_kernel", "polytope_of"]

# Of every kernel without points.
_NO_POINTS = read_only(np.empty((0, 3)))
_NO_FACES = read_only(np.zeros(1, np.int64))
_NO_IDS = read_only(np.empty(0, np.int32))
_NO_FACETS = read_only(np.empty(0, np.int64))
_NO_ROWS = read_only(np.empty((0, 3), np.int32))
_NOWHERE = read_only(np.full(3, np.nan))
_NO_INERTIA = read_only(np.zeros((3, 3)))


def polytope_of(
    shape: Shape, domain: Domain | None, cut: bool, bounded: bool, proof: Proof, unclipped: Proof
) -> KernelPolytope:
    """Put together a kernel that has points; the rows of its shape are those of the planes of its proof."""
    return KernelPolytope(
        dimension=proof.inside.dimension,
        vertices=shape.vertices,
        face_starts=shape.face_starts,
        _face_vertices=shape.face_vertices,
        face_facets=read_only(proof.planes.facet_ids.take(shape.rows)),
        _vertex_rows=shape.vertex_rows,
        volume=shape.volume,
        area=shape.area,
        centroid=shape.centroid,
        inertia=shape.inertia,
        deepest_point=shape.deepest,
        clearance=shape.clearance,
        domain=domain,
        cut_by_domain=cut,
        is_bounded=bounded,
        unclipped_dimension=unclipped.inside.dimension,
        max_residual=shape.residual,
        volume_bounds=shape.volume_bounds,
        _proof=proof,
        _unclipped_proof=unclipped,
    )


def empty_kernel(domain: Domain | None, cut: bool, bounded: bool, proof: Proof, unclipped: Proof) -> KernelPolytope:
    """Put together a kernel without points."""
    return KernelPolytope(
        dimension=-1,
        vertices=_NO_POINTS,
        face_starts=_NO_FACES,
        _face_vertices=_NO_IDS,
        face_facets=_NO_FACETS,
        _vertex_rows=_NO_ROWS,
        volume=0.0,
        area=0.0,
        centroid=_NOWHERE,
        inertia=_NO_INERTIA,
        deepest_point=_NOWHERE,
        clearance=float("nan"),
        domain=domain,
        cut_by_domain=cut,
        is_bounded=bounded,
        unclipped_dimension=unclipped.inside.dimension,
        max_residual=0.0,
        volume_bounds=(0.0, 0.0),
        _proof=proof,
        _unclipped_proof=unclipped,
    )
