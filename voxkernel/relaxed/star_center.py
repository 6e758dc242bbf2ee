"""`StarCenter`: the point that faces the most of a surface, and the cube it is looked for in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._plain import plain
from voxkernel.halfspaces import Domain
from voxkernel.relaxed.root_cube import RootCube, root_cube

__all__ = ["MAX_CELLS", "StarCenter", "skew_cube"]

MAX_CELLS = 2_000_000


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StarCenter(Frozen):
    """The point that faces the most of a surface, and bounds on what it cannot face.

    Attributes
    ----------
    point : (3,) float64
        World coordinates, inside the domain.
    violation_bounds : (float, float)
        Certain bounds on the smallest violation in the domain, as a share of the whole weight. The upper
        one is reached at `point`, or within rounding of it where the least violated points fill no volume.
        Both are 0 exactly when the kernel is not empty.
    domain : Domain or None
        Where the point was looked for; None when a kernel was found without one.
    n_cells : int
        Octree cells looked at; 0 when the kernel is not empty.
    reason : str
        Why the bounds are further apart than asked for; "" when they are not.
    """

    point: NDArray[np.float64]
    violation_bounds: tuple[float, float]
    domain: Domain | None
    n_cells: int
    reason: str

    def __repr__(self) -> str:
        """Name the point and the bounds."""
        low, high = self.violation_bounds
        place = ", ".join(f"{v:.6g}" for v in self.point)
        return f"StarCenter(point=({place}), violation_bounds=({low:.6g}, {high:.6g}))"

    @property
    def gap(self) -> float:
        """Distance between the bounds."""
        return self.violation_bounds[1] - self.violation_bounds[0]

    @property
    def border_distance(self) -> float:
        """Distance of the point from the nearest plane of the domain, mesh units; infinite without a domain.

        Near 0 the domain decides where the point lies: a larger one would have a better point further out.
        """
        if self.domain is None:
            return float("inf")
        return max(0.0, float((self.domain.offsets - self.domain.normals @ self.point).min()))

    @property
    def is_at_border(self) -> bool:
        """Whether the point lies within 0.5 % of the domain's size of the domain's border, and faces not all."""
        if self.domain is None or not self.violation_bounds[1]:
            return False
        return self.border_distance < 5e-3 * float(np.ptp(self.domain.vertices, axis=0).max())

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers, ready for JSON."""
        return plain({
            "point": self.point,
            "violation_bounds": self.violation_bounds,
            "domain": None if self.domain is None else self.domain.kind,
            "n_cells": self.n_cells,
            "reason": self.reason,
        })


def skew_cube(region: Domain, axes: NDArray[np.float64]) -> RootCube:
    """Place a cube around the domain whose cells do not line up with planes at simple fractions of its size."""
    cube, _ = root_cube(region.vertices, axes)
    edge = cube.edge * 1.0860342
    shift = cube.edge * np.array([0.0398107, 0.0466301, 0.0321433])
    return RootCube(cube.corner - shift @ axes, edge, axes)
