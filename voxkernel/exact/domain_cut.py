"""What a domain changes about a kernel, decided exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import Domain, Feasibility, HalfSpaces, find_feasibility
from voxkernel.halfspaces.predicates import exact_slacks

__all__ = ["is_bounded", "is_cut", "without_domain"]

_MOST = 1 << 17  # products held at a time


def is_bounded(halfspaces: HalfSpaces) -> bool:
    """Whether a non-empty kernel is bounded: no direction stays inside all half-spaces, decided exactly."""
    if halfspaces.bounds_volume:
        return True
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    return find_feasibility(halfspaces.recession_cone().with_planes(cube, np.ones(6))).dimension == 0


def without_domain(halfspaces: HalfSpaces, planes: HalfSpaces, inside: Feasibility) -> Feasibility:
    """What is known without the domain: of a solid kernel the same, of any other it is asked again.

    `planes` are the half-spaces and those of the domain, `inside` is what is known of them.
    """
    if inside.dimension < 3:
        return find_feasibility(halfspaces)
    own = inside.working_set[inside.working_set < len(halfspaces)]
    point = inside.exact_point
    if point is not None:
        point = halfspaces.world_to_lattice(planes.lattice_to_world(point))
    return replace(inside, halfspaces=halfspaces, exact_point=point, working_set=own)


def is_cut(
    halfspaces: HalfSpaces,
    domain: Domain,
    unclipped: Feasibility,
    inside: Feasibility,
    vertices: NDArray[np.float64],
    rows: NDArray[np.signedinteger],
) -> bool:
    """Whether a part of the kernel, with these corners, lies beyond one of the planes of the domain.

    `rows` are those of the faces, the rows of the domain last. A face names the first half-space of its plane, so a
    solid kernel with a face of the domain goes on beyond it, and one without is what its own half-spaces leave.
    """
    if inside.dimension != unclipped.dimension:
        return True
    if inside.dimension == 3:
        return bool((rows >= len(halfspaces)).any())
    outer = HalfSpaces.from_planes(domain.normals, domain.offsets)
    reach = 1e-9 * max(halfspaces.scale, float(np.abs(vertices - halfspaces.origin).max()))
    step = max(1, _MOST // len(vertices))
    for first in range(0, len(outer), step):
        height = outer.normals[first : first + step] @ vertices.T - outer.offsets[first : first + step, None]
        for j in (first + np.flatnonzero(height.max(axis=1) >= -reach)).tolist():
            beyond = halfspaces.with_planes(-domain.normals[j : j + 1], -domain.offsets[j : j + 1])
            found = find_feasibility(beyond)
            # Its point lies in the relative interior: on the plane only if all that is left lies there.
            if found.point is not None and exact_slacks(beyond, [len(beyond) - 1], found.point)[0] > 0:
                return True
    return False
