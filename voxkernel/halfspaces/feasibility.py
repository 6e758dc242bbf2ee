"""Whether half-spaces have a common point: a deep point, or a witness that there is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth
from voxkernel._core import find_deep_point
from voxkernel._frozen import Frozen
from voxkernel.errors import SolverError
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.halfspaces.integer_planes import IntegerPlane
from voxkernel.halfspaces.predicates import touched_and_violated
from voxkernel.halfspaces.rational_program import deepest_rational_point, kernel_of_rows, rank_of
from voxkernel.halfspaces.witness import Witness, empty_witness, lifted_witness, witness_of

__all__ = ["EVERY_DIRECTION", "ExactPlanes", "Feasibility", "exact_feasibility", "find_feasibility"]

LatticePoint = tuple[Fraction, Fraction, Fraction]
EVERY_DIRECTION = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

_Ids = NDArray[np.int64]


class ExactPlanes(Protocol):
    """What rational arithmetic asks of half-spaces, wherever these are."""

    @property
    def scale(self) -> float:
        """Of the local frame."""
        ...

    @property
    def is_cone(self) -> bool:
        """Whether the planes of the surface were moved to the origin."""
        ...

    @property
    def lattice_unit(self) -> int:
        """Lattice units per world unit."""
        ...

    def from_lattice(self, point: Sequence[Fraction | int]) -> NDArray[np.float64]:
        """Round an exact lattice point to local coordinates."""
        ...

    def to_lattice(self, local: NDArray[np.float64]) -> LatticePoint:
        """Map a local double point to exact lattice coordinates."""
        ...

    def integer_planes(self, ids: NDArray[Any] | Sequence[int]) -> list[IntegerPlane]:
        """Planes exactly."""
        ...


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Feasibility(Frozen):
    """The dimension of the common part of half-spaces, and what proves it.

    `local_point` lies in the relative interior: as it is where `clearance` is above 0, otherwise it is `exact_point`,
    in lattice coordinates, rounded. `directions` span the affine hull; `witnesses` prove that the dimension is not
    larger. `working_set` holds the half-spaces that mattered. `passes` counts the sweeps over all half-spaces.
    """

    halfspaces: ExactPlanes
    dimension: int
    exact_point: tuple[Fraction, Fraction, Fraction] | None
    directions: tuple[tuple[int, int, int], ...]
    witnesses: tuple[Witness, ...]
    working_set: NDArray[np.int64]
    local_point: NDArray[np.float64] | None
    clearance: float
    passes: int

    @property
    def point(self) -> LatticePoint | None:
        """A point in the relative interior, exactly, in lattice coordinates; None where there is none."""
        if self.exact_point is not None or self.local_point is None:
            return self.exact_point
        return self.halfspaces.to_lattice(self.local_point)


def find_feasibility(halfspaces: HalfSpaces, *, threads: int = 1) -> Feasibility:
    """Find the dimension of the intersection of half-spaces, exactly for the doubles given.

    Floating point proposes, with a bound on every rounding error; what it cannot prove is decided
    in rational arithmetic on a working set that grows until no half-space objects.

    Parameters
    ----------
    halfspaces : HalfSpaces
        At least one.
    threads : int
        Threads, 1 to 256; the result does not depend on it.

    Returns
    -------
    Feasibility
        dimension -1 (empty) to 3, with a point or witnesses.

    Raises
    ------
    TypeError, ValueError
        If `threads` is no integer from 1 to 256.
    """
    threads = as_depth("threads", threads, 1, 256)
    rows, passes, answer = _float_stage(halfspaces, threads)
    if answer is not None:
        return answer
    # Exactly coplanar facets would all be touched and tried one by one: one of each plane is enough.
    groups = halfspaces.coplanar_groups(threads=threads)
    heads = np.flatnonzero(groups == np.arange(len(groups)))
    merged = halfspaces.select(heads)
    rows = np.unique(np.searchsorted(heads, groups[rows]))
    found = exact_feasibility(merged, rows, passes, lambda point: touched_and_violated(merged, point))
    witnesses = tuple(Witness(tuple(int(heads[i]) for i in w.ids), w.multipliers) for w in found.witnesses)
    return replace(found, halfspaces=halfspaces, witnesses=witnesses, working_set=heads[found.working_set])


def _float_stage(halfspaces: HalfSpaces, threads: int) -> tuple[NDArray[np.int64], int, Feasibility | None]:
    """Grow a working set until it is proven solid or empty, or floating point has said all it can."""
    rows, opposing, gap, depth, point, nearest, passes = find_deep_point(
        halfspaces.local_normals, halfspaces.local_offsets, halfspaces.local_errors, threads
    )
    witness = empty_witness(halfspaces, opposing)
    if witness is not None:
        return rows, passes, Feasibility(halfspaces, -1, None, (), (witness,), rows, None, gap, passes)
    if depth == 0.0:
        return nearest, passes, None
    return rows, passes, Feasibility(halfspaces, 3, None, EVERY_DIRECTION, (), rows, point, depth, passes)


def exact_feasibility(
    halfspaces: ExactPlanes,
    rows: NDArray[np.int64],
    passes: int,
    ask: Callable[[LatticePoint], tuple[_Ids, _Ids]],
) -> Feasibility:
    """Decide in rationals on a working set without copies; add half-spaces that object until none does.

    `ask` splits the half-spaces that a point is not clear of into touched and violated ones.
    """
    while True:
        dimension, point, directions, witnesses, equal = _decide_rows(halfspaces, rows)
        if dimension < 0 or point is None:
            return Feasibility(halfspaces, -1, None, (), witnesses, rows, None, 0.0, passes)
        if halfspaces.is_cone and dimension == 0:  # the apex satisfies every plane
            local = halfspaces.from_lattice(point)
            return Feasibility(halfspaces, 0, point, directions, witnesses, rows, local, 0.0, passes)
        touched, violated = ask(point)
        passes += 1
        fresh = np.setdiff1d(violated, rows)
        if not len(fresh):
            if len(violated):
                raise SolverError("the exact linear program returned a point outside its own half-spaces")
            # A touched plane that is not constant on the affine hull leaves the point on the rim.
            others = np.setdiff1d(touched, rows)
            planes = halfspaces.integer_planes(others)
            on_rim = [
                i
                for i, p in zip(others, planes, strict=True)
                if any(sum(u * v for u, v in zip(p[:3], w, strict=True)) for w in directions)
            ]
            if not on_rim:
                local, known = halfspaces.from_lattice(point), np.union1d(rows, equal)
                return Feasibility(halfspaces, dimension, point, directions, witnesses, known, local, 0.0, passes)
            fresh = np.array(on_rim, np.int64)
        rows = np.concatenate([rows, _most_different(fresh)])


def _most_different(ids: NDArray[np.int64], count: int = 64) -> NDArray[np.int64]:
    """Thin out a long list of objecting planes evenly; the rest objects again if it still matters."""
    return ids if len(ids) <= count else ids[:: -(-len(ids) // count)]


_Decision = tuple[
    int,
    LatticePoint | None,
    tuple[tuple[int, int, int], ...],
    tuple[Witness, ...],
    NDArray[np.int64],
]


def _decide_rows(halfspaces: ExactPlanes, rows: NDArray[np.int64]) -> _Decision:
    """Find dimension, relative interior point and witnesses for the working set alone.

    Where the largest clearance is zero, the half-spaces with positive multipliers hold with
    equality; the search goes on in their common affine subspace, at most three times.
    """
    planes = halfspaces.integer_planes(rows)
    base: LatticePoint = (Fraction(0), Fraction(0), Fraction(0))
    directions = kernel_of_rows([])
    unit = Fraction(halfspaces.scale) * halfspaces.lattice_unit
    equal: list[int] = []
    witnesses: list[Witness] = []
    while directions:
        reduced = [
            (
                tuple(sum(u * v for u, v in zip(p[:3], w, strict=True)) for w in directions),
                p[3] - sum((u * v for u, v in zip(p[:3], base, strict=True)), Fraction(0)),
            )
            for p in planes
        ]
        moving = [i for i, (normal, _) in enumerate(reduced) if any(normal)]
        length = max(max(map(abs, w)) for w in directions)
        optimum = deepest_rational_point([reduced[i] for i in moving], len(directions), unit=unit / length)
        multipliers = {moving[i]: m for i, m in optimum.multipliers.items()}
        if optimum.clearance < 0:
            return -1, None, (), (witness_of(rows, multipliers),), rows[equal]
        shift = [
            sum((w[k] * z for w, z in zip(directions, optimum.point, strict=True)), Fraction(0))
            for k in range(3)
        ]
        base = (base[0] + shift[0], base[1] + shift[1], base[2] + shift[2])
        if optimum.clearance > 0:
            break
        equal += sorted(multipliers)
        witnesses.append(lifted_witness(rows, planes, equal))
        directions = kernel_of_rows([planes[i][:3] for i in equal])
    dimension = len(directions)
    if equal and 3 - rank_of([planes[i][:3] for i in equal]) != dimension:
        raise SolverError("the exact linear program lost count of the dimension")
    return dimension, base, tuple(directions), tuple(witnesses), rows[equal]
