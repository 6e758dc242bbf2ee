"""What the points of a surface are weighed with: merged facet planes and integer weights.

Weights are shares of the whole in fixed point, 60 bits: sums of integers are exact in any order, so a bound is certain
and does not depend on the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, fsum, inf, nextafter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh

__all__ = ["UNITS", "WeighedPlanes", "weigh"]

UNITS = 1 << 60
_BLOCK = 1 << 14  # weights that are rounded in one go


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WeighedPlanes(Frozen):
    """Facet planes of positive weight with their shares of the whole in units of 1 / `UNITS`.

    `shares` are lower bounds on the true ones as doubles. A sum of `weights` differs from that of the true
    shares by at most `slack` units.
    """

    facets: HalfSpaces
    weights: NDArray[np.int64]
    shares: NDArray[np.float64]
    slack: int

    def share_bounds(self, low: int, high: int) -> tuple[float, float]:
        """Turn sums of weights into certain bounds on shares of the whole; 0 stays 0."""
        lower = max(0, low - self.slack) / UNITS if low else 0.0
        upper = min(UNITS, high + self.slack) / UNITS if high else 0.0
        return max(0.0, nextafter(lower, -inf)), min(1.0, nextafter(upper, inf)) if high else 0.0

    def thresholds(self, shares: list[float]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """For every share: sums up to the first number are at most the share, sums above the second exceed it."""
        ins = [max(0, floor(Fraction(s) * UNITS) - self.slack) if s < 1.0 else 2 * UNITS for s in shares]
        outs = [ceil(Fraction(s) * UNITS) + self.slack if s > 0.0 else 0 for s in shares]
        return np.array(ins, np.int64), np.array(outs, np.int64)


def weigh(halfspaces: HalfSpaces, weights: Any = "area", *, mesh: TriangleMesh | None = None) -> WeighedPlanes:
    """Give every facet plane its weight and merge exactly coplanar ones.

    Parameters
    ----------
    halfspaces : HalfSpaces
        Facet planes, without a domain.
    weights : {"area", "count"} or (k,) array_like
        Facet areas (of half-spaces: their weights), one for each facet, or a number >= 0 for each facet id.
    mesh : TriangleMesh, optional
        Tells how many facet ids there are.

    Returns
    -------
    WeighedPlanes
        Planes without weight are left out.

    Raises
    ------
    ValueError
        If the weights have the wrong shape, are negative or not finite, or are all zero.
    """
    values = _plane_weights(halfspaces, weights, mesh)
    if not values.any():
        raise ValueError("`weights` must have one above 0; got only zeros")
    if not values.all():
        halfspaces, values = halfspaces.select(values > 0), values[values > 0]
    values /= values.max()  # keeps sums finite
    total = fsum(values)
    values /= total
    units = _units_of(values)
    values *= 1.0 - 1e-14
    shares = values
    slack = len(units) + 1024  # half a unit or one each; the quotients, 2**-53 of UNITS, a few times
    groups = halfspaces.coplanar_groups()
    heads = np.flatnonzero(groups == np.arange(len(groups)))
    if len(heads) < len(groups):
        sums = np.zeros(len(groups), np.int64)
        np.add.at(sums, groups, units)
        halfspaces, units, shares = halfspaces.select(heads), sums[heads], shares[heads]
    return WeighedPlanes(halfspaces, units, shares, slack)


def _units_of(shares: NDArray[np.float64]) -> NDArray[np.int64]:
    """Shares in whole units, at least one each; a block at a time."""
    units = np.empty(len(shares), np.int64)
    for first in range(0, len(shares), _BLOCK):
        units[first : first + _BLOCK] = np.maximum(np.rint(shares[first : first + _BLOCK] * UNITS), 1.0)
    return units


def _plane_weights(halfspaces: HalfSpaces, weights: Any, mesh: TriangleMesh | None) -> NDArray[np.float64]:
    """Weight of every half-space; a facet with several planes shares its weight among them by area."""
    if isinstance(weights, str):
        if weights == "area":
            return np.array(halfspaces.weights)
        if weights != "count":
            raise ValueError(f"`weights` must be 'area', 'count' or an array; got {weights!r}")
        given = None
    else:
        given = np.asarray(weights, dtype=np.float64)
        n = len(halfspaces) if mesh is None else mesh.n_input_facets
        if given.shape != (n,):
            raise ValueError(f"`weights` must have shape ({n},), one for each facet; got {given.shape}")
        if not (np.isfinite(given) & (given >= 0.0)).all():
            raise ValueError("`weights` must be finite and >= 0; got a value that is not")
    if mesh is None:
        return np.ones(len(halfspaces)) if given is None else given.copy()
    ids = halfspaces.facet_ids
    one_each = np.ones(len(ids))
    counts = np.bincount(ids, minlength=mesh.n_input_facets)
    if counts.max() > 1:
        areas = np.bincount(ids, weights=halfspaces.weights, minlength=mesh.n_input_facets)
        one_each = np.where(counts[ids] > 1, halfspaces.weights / areas[ids], 1.0)
    return one_each if given is None else given[ids] * one_each
