"""Which points satisfy all half-spaces, decided exactly."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.predicates import touched_and_violated

__all__ = ["points_inside"]

_UNIT = 2.0**-53
_FAR = 2.0**500  # beyond this squares leave the range of doubles
_MOST = 1 << 19  # products held at a time


def points_inside(halfspaces: HalfSpaces, xyz: NDArray[np.float64], first: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which world points satisfy every half-space; those of the mask `first` are asked first.

    A point x becomes local by one rounding, of `x - origin`; the scale is a power of two. So its local distance
    from a plane is known to `local_errors * (|x| + 1) + u |x|`, and a few roundings of these, which 4 u |x| covers.
    Where that leaves the sign open, integers decide.
    """
    inside = np.ones(len(xyz), np.bool_)
    with np.errstate(over="ignore", invalid="ignore"):
        local = halfspaces.to_local(xyz)
        sizes = np.sqrt((local**2).sum(axis=1))
    is_open = ~(sizes < _FAR)
    for rows in (np.flatnonzero(first), np.flatnonzero(~first)):
        normals, offsets = halfspaces.local_normals[rows], halfspaces.local_offsets[rows]
        errors = halfspaces.local_errors[rows]
        step = max(1, _MOST // max(1, len(rows)))
        asked = np.flatnonzero(inside & (sizes < _FAR))
        for start in range(0, len(asked), step):
            ids = asked[start : start + step]
            slack = offsets - local[ids] @ normals.T
            pads = errors * (sizes[ids, None] + 1.0) + 4.0 * _UNIT * sizes[ids, None] + 1e-300
            inside[ids] = ~(slack < -pads).any(axis=1)
            is_open[ids] |= (np.abs(slack) <= pads).any(axis=1)
    for i in np.flatnonzero(inside & is_open):
        x, y, z = (Fraction(v) for v in xyz[i].tolist())
        inside[i] = not len(touched_and_violated(halfspaces, halfspaces.world_to_lattice((x, y, z)))[1])
    return inside
