"""What a registration gives: the motion, its fit, what was tried, and whether to doubt it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points
from voxkernel._frozen import Frozen
from voxkernel._plain import plain
from voxkernel.registration.search import rotation_angle_deg

__all__ = ["Candidate", "Registration", "Verdict"]

Verdict = Literal["right", "uncertain", "no match"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Candidate(Frozen):
    """One motion that was tried.

    Attributes
    ----------
    T_target_source : (4, 4) float64
        As the kernels (or the frame it came from) gave it, before any ICP.
    origin : {"kernel", "feature", "part", "surface", "net"}
        Principal frames of kernels, local features, kernels of parts, frames of the surfaces themselves, or a net of
        rotations.
    margin : float
        Margin of the kernels; NaN for the other origins.
    score : float
        `score_alignment` of it on coarse samples, before ICP; in [0, 1].
    moved_score : float
        The same after a short ICP.
    """

    T_target_source: NDArray[np.float64]
    origin: str
    margin: float
    score: float
    moved_score: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Registration(Frozen):
    """The rigid motion that lays a source surface on a target surface.

    Attributes
    ----------
    T_target_source : (4, 4) float64
        Maps source points to target points: `x_target = T[:3, :3] @ x_source + T[:3, 3]`.
    kernel_T_target_source : (4, 4) float64
        What the kernels alone gave, before any ICP: of the candidates from kernels that lead to the answer the
        one that fits best as it is; of all candidates from kernels, where none leads there; else the answer.
    fitness : float
        Share of the *source's* area that lies within `max_distance` of the target's triangles after the
        final motion, in [0, 1].
    inlier_rmse : float
        Root of the mean squared distance of that area from the target's triangles, mesh units; NaN when the
        fitness is 0.
    score : float
        `score_alignment` of the final motion: both surfaces count, and facing the same way does.
    max_distance : float
        What `fitness` calls near, mesh units.
    margin : float
        Margin of the kernels that led to the answer; NaN when kernels did not.
    candidates : tuple of Candidate
        All that were tried, best first.
    converged : bool
        Whether ICP has come to rest on a fit; with `refine="none"`, whether a candidate fits at all. It does not
        say that the answer is right.
    ambiguous : bool
        Whether another motion fits as well.
    reason : str
        Why it is ambiguous, not right or did not converge; "" otherwise.
    verdict : {"right", "uncertain", "no match"}
        Whether to believe the motion.
    probability : float
        That the motion is right, in [0, 1].
    scale : float
        Size of the target over that of the source: 1 unless it was to be estimated.
    led_by : str
        Origin of the candidate that led to the answer; "" where none did.
    facets_turned : bool
        Whether the facets of one surface were turned over, because the two face opposite ways.
    evidence : mapping of str to float
        What the probability was computed from, by name (`voxkernel.registration.verdict`).
    """

    T_target_source: NDArray[np.float64]
    kernel_T_target_source: NDArray[np.float64]
    fitness: float
    inlier_rmse: float
    score: float
    max_distance: float
    margin: float
    candidates: tuple[Candidate, ...]
    converged: bool
    ambiguous: bool
    reason: str
    verdict: Verdict = "uncertain"
    probability: float = 0.5
    scale: float = 1.0
    led_by: str = ""
    facets_turned: bool = False
    evidence: Mapping[str, float] = field(default_factory=dict[str, float])

    def __repr__(self) -> str:
        """Name angle, fit and doubts."""
        angle = rotation_angle_deg(self.T_target_source, np.eye(4))
        doubts = f", {self.reason!r}" if self.reason else ""
        return (
            f"Registration({self.verdict!r}, probability={self.probability:.3g}, rotation_deg={angle:.6g}, "
            f"fitness={self.fitness:.6g}, inlier_rmse={self.inlier_rmse:.6g}, score={self.score:.4g}{doubts})"
        )

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Move source points (n, 3) to the target."""
        motion = self.T_target_source
        return as_points("points", points) @ motion[:3, :3].T + motion[:3, 3]

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers and lists, ready for JSON; NaN becomes None."""
        return plain({
            "T_target_source": self.T_target_source,
            "kernel_T_target_source": self.kernel_T_target_source,
            "fitness": self.fitness,
            "inlier_rmse": self.inlier_rmse,
            "score": self.score,
            "max_distance": self.max_distance,
            "margin": self.margin,
            "converged": self.converged,
            "ambiguous": self.ambiguous,
            "reason": self.reason,
            "verdict": self.verdict,
            "probability": self.probability,
            "scale": self.scale,
            "led_by": self.led_by,
            "facets_turned": self.facets_turned,
            "evidence": dict(self.evidence),
            "candidates": [
                {
                    "T_target_source": c.T_target_source,
                    "origin": c.origin,
                    "margin": c.margin,
                    "score": c.score,
                    "moved_score": c.moved_score,
                }
                for c in self.candidates
            ],
        })
