"""Solid kernels that are thin or small: stretched until they are round, with dual points rounded once."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from voxkernel._solid import Polyhedron, polyhedron_of_duals
from voxkernel.halfspaces import HalfSpaces

__all__ = ["Stretched", "stretched_polyhedron"]

_BITS = 60
_REACHES = (64.0, 2.0**16)


@dataclass(frozen=True, slots=True)
class Stretched:
    """A polyhedron { center + basis @ y } and the same in round coordinates y; `misfit` is max |a . y - 1|."""

    solid: Polyhedron
    round_vertices: NDArray[np.float64]
    basis: NDArray[np.float64]
    misfit: float


def stretched_polyhedron(
    planes: HalfSpaces, point: NDArray[np.float64], cloud: NDArray[np.float64]
) -> Stretched | None:
    """Intersect half-spaces about a point strictly inside, in coordinates in which `cloud` is round.

    In x = point + basis y, the half-space n . x <= d is a . y <= 1 with a = basis^T n / (d - n . point).
    The basis is made of integers, so a is an exact rational of the input and rounded only once:
    neither a small distance nor a nearly parallel normal loses digits.

    Parameters
    ----------
    planes : HalfSpaces
        Those that may bound the kernel.
    point : (3,) float64
        Local coordinates, strictly inside all of them.
    cloud : (k, 3) float64
        Corners of a rough version of the kernel, local coordinates.

    Returns
    -------
    Stretched or None
        None where Qhull gives up or the polyhedron is unbounded.
    """
    spread = cloud - point
    _, _, axes = np.linalg.svd(spread, full_matrices=False)
    sizes = np.abs(spread @ axes.T).max(axis=0)
    if not (sizes > 0).all():
        return None
    directions = [[round(float(v) * 2**_BITS) for v in axis] for axis in axes]
    lattice = planes.to_lattice(point)
    unit = Fraction(planes.scale) * planes.lattice_unit
    factors = [Fraction(float(size)) * unit / 2**_BITS for size in sizes]
    duals = np.empty((len(planes), 3))
    for i, (a, b, c, d) in enumerate(planes.integer_planes(range(len(planes)))):
        distance = d - (a * lattice[0] + b * lattice[1] + c * lattice[2])
        if distance <= 0:
            return None
        for k, (u, v, w) in enumerate(directions):
            duals[i, k] = float((a * u + b * v + c * w) * factors[k] / distance)
    basis = np.array(directions, dtype=np.float64).T / 2.0**_BITS * sizes
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    for reach in _REACHES:
        found = polyhedron_of_duals(duals, cube / reach)
        if found is None:
            return None
        if found.is_closed:
            owner = np.repeat(found.rows, np.diff(found.start))
            products = np.einsum("ij,ij->i", duals[owner], found.vertices[found.ring])
            solid = Polyhedron(point.copy(), found.vertices @ basis.T, found.start, found.ring, found.rows)
            return Stretched(solid, found.vertices, basis, float(np.abs(products - 1.0).max()))
    return None
