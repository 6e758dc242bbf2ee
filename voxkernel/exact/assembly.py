"""What is known about a kernel -> `KernelPolytope`."""

from __future__ import annotations

import numpy as np

from voxkernel._checks import read_only
from voxkernel.exact.certificate import Proof
from voxkernel.exact.kernel_polytope import KernelPolytope
from voxkernel.exact.kernel_shape import Shape
from voxkernel.halfspaces import Domain

__all__ = ["empty_kernel", "polytope_of"]


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
    nowhere = read_only(np.full(3, np.nan))
    return KernelPolytope(
        dimension=-1,
        vertices=read_only(np.empty((0, 3))),
        face_starts=read_only(np.zeros(1, np.int64)),
        _face_vertices=read_only(np.empty(0, np.int32)),
        face_facets=read_only(np.empty(0, np.int64)),
        _vertex_rows=read_only(np.empty((0, 3), np.int32)),
        volume=0.0,
        area=0.0,
        centroid=nowhere,
        inertia=read_only(np.zeros((3, 3))),
        deepest_point=nowhere,
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
