"""`Guards`: few points that see a surface, and what is known about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._notebook import InNotebooks
from voxkernel._plain import plain
from voxkernel.guarding.certificate import CertifiedParts
from voxkernel.mesh import TriangleMesh

__all__ = ["GuardBound", "Guards"]


@dataclass(frozen=True, slots=True, repr=False)
class GuardBound(InNotebooks):
    """How many guards are needed at least, anywhere inside a surface.

    Attributes
    ----------
    at_least : int
        No fewer guards see `coverage` of the area. Wrong with a probability of at most `error_probability`.
    error_probability : float
        Of `at_least`, over the random samples; 0 where it follows without them.
    at_least_for_samples : int
        No fewer guards see all the samples: certain for these `n_samples` points of the surface.
    coverage : float
        Share of the area that the bound is about.
    n_samples : int
        Random samples of the surface.
    n_needed : int
        So many of them are seen by any guards, chosen before, that see `coverage` of the area, but with
        `error_probability`.
    linear : float
        Value of the linear program, rounded down; `at_least` is this rounded up, or more by branching.
    n_cells : int
        Cells of space in the last program.
    reason : str
        Why the bound may be less than it could be; "" when nothing was left out.
    """

    at_least: int
    error_probability: float
    at_least_for_samples: int
    coverage: float
    n_samples: int
    n_needed: int
    linear: float
    n_cells: int
    reason: str

    def __repr__(self) -> str:
        """Name the bound and how it may err."""
        return f"GuardBound(at_least={self.at_least}, error_probability={self.error_probability:.3g})"

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers, ready for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Guards(Frozen):
    """Few points that together see a surface, as `guards` returns them.

    Attributes
    ----------
    points : (k, 3) float64
        World coordinates, body by body, the guard that sees the most first.
    seen : float
        Share of the area that at least one guard sees, in [0, 1]: measured on `n_samples` fresh samples that the
        search never used, and moved to `certified` or `facing_bound` where it lies beyond.
    seen_bounds : (float, float)
        Confidence interval of `seen`, at least `certified` and at most `facing_bound`. Clopper and Pearson's, which
        is on the safe side for samples in strata.
    confidence : float
        Of `seen_bounds`.
    n_samples : int
        Fresh samples; 100,000 unless a time limit ended their count.
    certified : float
        Share of the area in facets, or parts of facets, that are proven to be seen as a whole; rounded down.
    facing_bound : float
        Share of the area in facets with at least one guard on their inner side: no more than this can be seen.
    first_seen : (m,) int64
        The first guard that sees the middle of each triangle of `mesh.faces`; -1 where none does.
    bodies : (k,) int64
        Which body of the surface each guard is for; a cavity belongs to the body around it. All 0 for open surfaces
        and outside.
    coverage : float
        What was asked for, of the area of each body.
    is_reached : bool
        Whether the fresh samples confirm `coverage`: the lower of `seen_bounds` is not below it, or all are seen.
    reason : str
        Why `coverage` is not reached; "" when it is.
    left_out : str
        What a time limit left out of `seen`, `first_seen` and `certified`, which hold for what was done; "" when
        nothing.
    side : {"inside", "outside"}
        The side of the facets that is seen.
    distance : float
        Distance of guards outside from the surface, mesh units; 0 inside.
    bound : GuardBound or None
        How many guards are needed at least; None unless asked for.
    parts : CertifiedParts
        What `certified` counts.
    mesh : TriangleMesh
        The surface.
    """

    points: NDArray[np.float64]
    seen: float
    seen_bounds: tuple[float, float]
    confidence: float
    n_samples: int
    certified: float
    facing_bound: float
    first_seen: NDArray[np.int64]
    bodies: NDArray[np.int64]
    coverage: float
    is_reached: bool
    reason: str
    left_out: str
    side: Literal["inside", "outside"]
    distance: float
    bound: GuardBound | None
    parts: CertifiedParts
    mesh: TriangleMesh

    def __repr__(self) -> str:
        """Name the number of guards and what they see."""
        low, high = self.seen_bounds
        least = "" if self.bound is None else f", at_least={self.bound.at_least}"
        return (
            f"Guards({len(self.points)} guards, seen={self.seen:.6g} in ({low:.6g}, {high:.6g}), "
            f"certified={self.certified:.6g}{least})"
        )

    def __len__(self) -> int:
        """Count the guards."""
        return len(self.points)

    @property
    def at_least(self) -> int | None:
        """How many guards are needed at least, see `GuardBound`; None unless asked for."""
        return None if self.bound is None else self.bound.at_least

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the mesh and the parts as plain numbers, ready for JSON."""
        return plain({
            "points": self.points,
            "seen": self.seen,
            "seen_bounds": self.seen_bounds,
            "confidence": self.confidence,
            "n_samples": self.n_samples,
            "certified": self.certified,
            "facing_bound": self.facing_bound,
            "first_seen": self.first_seen,
            "bodies": self.bodies,
            "coverage": self.coverage,
            "is_reached": self.is_reached,
            "reason": self.reason,
            "left_out": self.left_out,
            "side": self.side,
            "distance": self.distance,
            "bound": None if self.bound is None else self.bound.to_dict(),
        })
