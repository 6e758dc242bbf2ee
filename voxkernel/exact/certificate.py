"""What proves the dimension of a kernel, checkable in rational arithmetic from the input doubles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.halfspaces import Feasibility, HalfSpaces
from voxkernel.halfspaces.predicates import exact_slacks, touched_and_violated
from voxkernel.halfspaces.rational_program import as_integers, rank_of

__all__ = ["Certificate", "Proof"]

RationalPoint = tuple[Fraction, Fraction, Fraction]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Certificate(Frozen):
    """A proof of the dimension of a kernel.

    Attributes
    ----------
    kind : {"empty", "flat", "solid"}
        "empty": `facet_ids` are at most 4 facets and `multipliers` l > 0 with sum(l n) = 0 and
        sum(l d) < 0, so no point satisfies them (Farkas). "solid": one rational point strictly inside
        every half-space. "flat": `dimension` + 1 affinely independent points of the kernel, and
        facets with sum(l n) = 0 and sum(l d) = 0, on whose planes the whole kernel lies.
    dimension : int
        -1 empty, 0 point, 1 segment, 2 flat polygon, 3 solid.
    facet_ids : tuple of int
        Input facets of the multipliers; -1 - j for plane j of the domain.
    multipliers : tuple of int
        One per facet, for the facet planes scaled as `HalfSpaces.integer_planes` gives them.
    points : tuple of 3-tuples of Fraction
        World coordinates.
    halfspaces : HalfSpaces
        What was asked: the half-spaces of the surface and of the domain.
    rows : tuple of int
        Row of each multiplier in `halfspaces`.
    """

    kind: Literal["empty", "flat", "solid"]
    dimension: int
    facet_ids: tuple[int, ...]
    multipliers: tuple[int, ...]
    points: tuple[RationalPoint, ...]
    halfspaces: HalfSpaces
    rows: tuple[int, ...]

    def __repr__(self) -> str:
        """Name the kind and its size."""
        return f"Certificate(kind={self.kind!r}, facet_ids={self.facet_ids}, n_points={len(self.points)})"

    def verify(self, *, filtered: bool = True) -> bool:
        """Recompute the proof from the original coordinates.

        Parameters
        ----------
        filtered : bool
            True leaves a half-space out of the rational test where a floating-point bound proves
            that a point is strictly inside it; False tests every half-space in integers.

        Returns
        -------
        bool
            True when the proof holds.

        Examples
        --------
        >>> import voxkernel
        >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> voxkernel.exact_kernel(tetrahedron).certificate.verify()
        True
        """
        planes = self.halfspaces
        if len(self.rows) != len(self.multipliers) or len(self.rows) != len(self.facet_ids):
            return False
        if any(not 0 <= r < len(planes) for r in self.rows):
            return False
        if tuple(int(planes.facet_ids[r]) for r in self.rows) != tuple(self.facet_ids):
            return False
        if self.kind == "empty":
            return self.dimension == -1 and len(self.rows) <= 4 and self._balance() < 0
        if self.kind == "solid":
            return (
                self.dimension == 3
                and len(self.points) >= 1
                and all(self._inside(p, filtered, True) for p in self.points)
            )
        if self.kind != "flat" or not 0 <= self.dimension <= 2 or len(self.points) != self.dimension + 1:
            return False
        if self._balance() != 0 or not all(self._inside(p, filtered, False) for p in self.points):
            return False
        normals = [p[:3] for p in planes.integer_planes(self.rows)]
        spread = [[u - v for u, v in zip(p, self.points[0], strict=True)] for p in self.points[1:]]
        integers = [[int(v * _common_denominator(row)) for v in row] for row in spread]
        return rank_of(normals) == 3 - self.dimension and rank_of(integers) == self.dimension

    def to_dict(self) -> dict[str, Any]:
        """Give the certificate as plain numbers; rationals become "p/q" strings."""
        return {
            "kind": self.kind,
            "dimension": self.dimension,
            "facet_ids": list(self.facet_ids),
            "multipliers": [str(m) for m in self.multipliers],
            "points": [[str(v) for v in p] for p in self.points],
        }

    def _balance(self) -> Fraction:
        """sum(l d) where all l > 0 and sum(l n) = 0; +1 where that fails."""
        if not self.rows or any(m <= 0 for m in self.multipliers):
            return Fraction(1)
        planes = self.halfspaces.integer_planes(self.rows)
        sums = [sum(m * p[k] for m, p in zip(self.multipliers, planes, strict=True)) for k in range(4)]
        return Fraction(1) if any(sums[:3]) else Fraction(sums[3])

    def _inside(self, point: RationalPoint, filtered: bool, strictly: bool) -> bool:
        lattice = self.halfspaces.world_to_lattice(point)
        if filtered:
            touched, violated = touched_and_violated(self.halfspaces, lattice)
            return not len(violated) and not (strictly and len(touched))
        every: NDArray[np.int64] = np.arange(len(self.halfspaces))
        slacks = exact_slacks(self.halfspaces, every, lattice)
        return all(s > 0 if strictly else s >= 0 for s in slacks)


def _common_denominator(values: list[Fraction]) -> int:
    product = 1
    for v in values:
        product *= v.denominator
    return product


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Proof(Frozen):
    """What a certificate is made of when somebody asks for it.

    `corners` are those of a flat kernel, or points that span it, in lattice coordinates, where it `is_own`; otherwise
    the half-spaces are those without a domain, whose kernel may have no end, and points of a flat one are found.
    """

    planes: HalfSpaces
    inside: Feasibility
    corners: tuple[tuple[Fraction, Fraction, Fraction], ...]
    is_own: bool
    _certificate: Certificate | None = field(init=False, default=None)

    @property
    def certificate(self) -> Certificate:
        """Made at first use and kept."""
        if self._certificate is None:
            made = (
                _certify(self.planes, self.inside, self.corners)
                if self.is_own
                else _certify_unclipped(self.planes, self.inside)
            )
            object.__setattr__(self, "_certificate", made)
            return made
        return self._certificate


def _certify(planes: HalfSpaces, inside: Feasibility, corners: Sequence[RationalPoint]) -> Certificate:
    """Assemble the proof of the dimension from what feasibility and the corners know."""
    dimension = inside.dimension
    point = inside.point
    if dimension == 3 and point is not None:
        return Certificate("solid", 3, (), (), (planes.lattice_to_world(point),), planes, ())
    witness = inside.witnesses[-1]
    facet_ids = tuple(int(planes.facet_ids[i]) for i in witness.ids)
    points: tuple[Any, ...] = ()
    if dimension >= 0:
        chosen = next(
            c
            for c in combinations(corners, dimension + 1)
            if rank_of([as_integers([u - v for u, v in zip(p, c[0], strict=True)]) for p in c[1:]]) == dimension
        )
        points = tuple(planes.lattice_to_world(c) for c in chosen)
    kind = "empty" if dimension < 0 else "flat"
    return Certificate(kind, dimension, facet_ids, witness.multipliers, points, planes, witness.ids)


def _certify_unclipped(halfspaces: HalfSpaces, unclipped: Feasibility) -> Certificate:
    """Prove the dimension without the domain; a flat kernel is cut out in a cube if it is unbounded."""
    if unclipped.dimension in (-1, 3):
        return _certify(halfspaces, unclipped, [])
    point = unclipped.point
    assert point is not None
    corners: list[RationalPoint] = [point]
    unit = Fraction(halfspaces.scale) * halfspaces.lattice_unit
    # The point is in the relative interior: go a little way along each direction.
    for w in unclipped.directions:
        step = unit / max(map(abs, w))
        while True:
            corner = tuple(u + step * v for u, v in zip(point, w, strict=True))
            if not len(touched_and_violated(halfspaces, corner)[1]):
                break
            step /= 4096
        corners.append((corner[0], corner[1], corner[2]))
    return _certify(halfspaces, unclipped, corners)
