"""What a domain changes about a kernel, decided exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import Domain, Feasibility, HalfSpaces, find_feasibility
from voxkernel.halfspaces.predicates import exact_slacks

__all__ = ["is_bounded", "is_cut"]


def is_bounded(halfspaces: HalfSpaces) -> bool:
    """Whether a non-empty kernel is bounded: no direction stays inside all half-spaces, decided exactly."""
    if halfspaces.bounds_volume:
        return True
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    return find_feasibility(halfspaces.recession_cone().with_planes(cube, np.ones(6))).dimension == 0


def is_cut(
    halfspaces: HalfSpaces,
    domain: Domain,
    unclipped: Feasibility,
    inside: Feasibility,
    vertices: NDArray[np.float64],
) -> bool:
    """Whether a part of the kernel lies beyond one of the planes of the domain."""
    if inside.dimension != unclipped.dimension:
        return True
    outer = HalfSpaces.from_planes(domain.normals, domain.offsets)
    reach = 1e-9 * halfspaces.scale * max(1.0, float(np.abs(vertices).max()))
    world = halfspaces.to_world(vertices)
    touched = np.flatnonzero((outer.normals @ world.T - outer.offsets[:, None]).max(axis=1) >= -reach)
    for j in touched:
        beyond = halfspaces.with_planes(-domain.normals[j : j + 1], -domain.offsets[j : j + 1])
        found = find_feasibility(beyond)
        # Its point lies in the relative interior: on the plane only if all that is left lies there.
        if found.point is not None and exact_slacks(beyond, [len(beyond) - 1], found.point)[0] > 0:
            return True
    return False
