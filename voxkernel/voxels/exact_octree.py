"""The octree of an exact kernel with the half-spaces that can make a difference to a voxel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from voxkernel.exact.dual_hull import polyhedron_around
from voxkernel.exact.inner_point import inner_point
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.plane_passes import reaching_planes, tightest_planes

__all__ = ["blow_up", "rows_for_voxels"]

_CULL_ABOVE = 1000


def blow_up(inside: Feasibility, voxel: float, pad: float) -> float | None:
    """Give 1 + e / r of `rows_for_voxels`, local units; None where there is no depth to blow up about."""
    radius = 0.999 * inside.clearance
    if inside.dimension < 3 or not radius > 0.0:
        return None
    beyond = 0.5 * np.sqrt(3.0) * voxel * (1 + 1e-9) + 4.0 * pad
    return 1.0 + beyond / radius


def rows_for_voxels(
    planes: HalfSpaces, inside: Feasibility, reach: NDArray[np.float64], voxel: float, pad: float
) -> NDArray[np.int64]:
    """List half-spaces with which the octree finds, bit for bit, what it finds with all of them.

    Parameters
    ----------
    planes : HalfSpaces
        All of them.
    inside : Feasibility
        What is known of their common part.
    reach : (n,) float64
        |n|_1 along the axes of the voxels.
    voxel, pad : float
        Edge of the smallest voxel and largest pad of `cube_planes`, in local units.

    Returns
    -------
    (k,) int64
        Ascending.

    Notes
    -----
    Let r be the depth of a point p, Q a polytope around the kernel, and e what the centre of a voxel that no
    half-space excludes may lie beyond each of them: the reach of a voxel and the pad. Moved towards p by the factor
    r / (r + e) such a centre lies in the kernel, so in Q. So a half-space that Q, blown up about p by 1 + e / r,
    passes by no more than the reach of a voxel excludes none that the others leave; and one that keeps clear of Q by
    more than its pad takes none from the inside.
    """
    everything = np.arange(len(planes))
    factor = blow_up(inside, voxel, pad)
    if factor is None or len(planes) <= _CULL_ABOVE:
        return everything
    point = inner_point(planes, inside)
    tight = np.unique(np.concatenate([tightest_planes(planes, point.local), inside.working_set]))
    outer = polyhedron_around(planes, point, tight)
    if outer is None:
        return everything
    # The corners are rounded, by far less than the margin.
    margin = 1e-9 * outer.extent + outer.reach + 2.0 * pad
    is_near = np.zeros(len(planes), np.bool_)
    is_near[tight] = True
    is_near[reaching_planes(planes, point.local, outer.vertices, margin=margin)] = True
    farther = replace(planes, local_offsets=planes.local_offsets + 0.5 * voxel * reach)
    blown_up = outer.vertices * factor
    is_near[reaching_planes(farther, point.local, blown_up, margin=margin, among=~is_near)] = True
    return np.flatnonzero(is_near)
