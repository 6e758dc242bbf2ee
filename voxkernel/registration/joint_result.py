"""What a joint registration gives: poses, groups, which pairs were used and which refused, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._plain import plain
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh

__all__ = ["JointRegistration", "JudgedPair", "Use"]

Use = Literal["tree", "loop", "refused", "contradicts", "not tried"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JudgedPair(Frozen):
    """One pair of a joint registration.

    Attributes
    ----------
    source, target : int
        Positions in the list of surfaces, source < target.
    use : {"tree", "loop", "refused", "contradicts", "not tried"}
        It makes the poses, agrees with them, was not believed, disagrees with them, or was left out because the two
        look less alike than others.
    reason : str
        Why it was not used; "" where it was.
    verdict : {"right", "uncertain", "no match", ""}
        Of the pair alone; "" where it was not tried.
    probability : float
        That the motion of the pair alone is right; NaN where it was not tried.
    likeness : float
        How alike the two seem, which orders the pairs; about the number of matches of local descriptors that agree.
    led_by : str
        ``"matches"`` of local descriptors, or ``"register"`` where those did not do; "" where it was not tried.
    T_target_source : (4, 4) float64
        What the pair alone says; NaN where it was not tried.
    """

    source: int
    target: int
    use: Use
    reason: str
    verdict: str
    probability: float
    likeness: float
    led_by: str
    T_target_source: NDArray[np.float64]

    def __repr__(self) -> str:
        """Name the pair and what became of it."""
        why = f", {self.reason!r}" if self.reason else ""
        return f"JudgedPair({self.source} -> {self.target}, {self.use!r}, probability={self.probability:.3g}{why})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JointRegistration(Frozen):
    """Many scans of one thing, laid together.

    Attributes
    ----------
    poses : (n, 4, 4) float64
        Each maps a scan into the frame of the scan `reference`; NaN for a scan that belongs to nothing.
    reference : int
        The first scan that belongs to the largest group: 0 unless the first one belongs to nothing or to a smaller
        group.
    groups : tuple of tuple of int
        Scans that hang together, the largest group first; only its scans have poses. A scan alone is in none.
    apart : tuple of int
        The scans without a pose.
    reasons : tuple of str
        For each scan, why it has no pose; "" where it has one.
    pairs : tuple of JudgedPair
        All pairs, in the order of their positions.
    tree_residual, residual : float
        How far overlapping scans are off each other, as the tree lays them and after the joint refinement, mesh
        units: root of the mean square, parts without a partner counting the reach. The second is never the larger;
        NaN where nothing overlaps.
    """

    poses: NDArray[np.float64]
    reference: int
    groups: tuple[tuple[int, ...], ...]
    apart: tuple[int, ...]
    reasons: tuple[str, ...]
    pairs: tuple[JudgedPair, ...]
    tree_residual: float
    residual: float

    def __repr__(self) -> str:
        """Count scans and pairs."""
        used = sum(p.use in ("tree", "loop") for p in self.pairs)
        return (
            f"JointRegistration({len(self.poses) - len(self.apart)} of {len(self.poses)} scans, "
            f"{used} of {len(self.pairs)} pairs used, residual={self.residual:.4g}, apart={list(self.apart)})"
        )

    def merged(self, surfaces: Sequence[MeshLike]) -> TriangleMesh:
        """Lay the scans that have a pose together in one mesh: all their triangles, not fused.

        Parameters
        ----------
        surfaces : sequence
            The surfaces that were registered, in the same order.

        Returns
        -------
        TriangleMesh
            In the frame of the scan `reference`.

        Raises
        ------
        ValueError
            If there are more or fewer surfaces than poses.
        """
        if len(surfaces) != len(self.poses):
            raise ValueError(f"`surfaces` must be the {len(self.poses)} that were registered; got {len(surfaces)}")
        vertices: list[NDArray[np.float64]] = []
        faces: list[NDArray[np.int64]] = []
        count = 0
        for i in sorted(set(range(len(surfaces))) - set(self.apart)):
            mesh = as_mesh(surfaces[i]).transformed(self.poses[i])
            vertices.append(mesh.vertices)
            faces.append(mesh.faces + count)
            count += len(mesh.vertices)
        return TriangleMesh.from_triangles(np.concatenate(vertices), np.concatenate(faces), source="merged scans")

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers and lists, ready for JSON; NaN becomes None."""
        return plain({
            "poses": [None if i in self.apart else pose for i, pose in enumerate(self.poses)],
            "reference": self.reference,
            "groups": self.groups,
            "apart": self.apart,
            "reasons": self.reasons,
            "tree_residual": self.tree_residual,
            "residual": self.residual,
            "pairs": [
                {
                    "source": p.source,
                    "target": p.target,
                    "use": p.use,
                    "reason": p.reason,
                    "verdict": p.verdict,
                    "probability": p.probability,
                    "likeness": p.likeness,
                    "led_by": p.led_by,
                    "T_target_source": None if p.use == "not tried" else p.T_target_source,
                }
                for p in self.pairs
            ],
        })
