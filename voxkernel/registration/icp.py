"""One run of Open3D's ICP between two clouds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._open3d import open3d

__all__ = ["IcpEnd", "Refine", "icp"]

Refine = Literal["point_to_plane", "point_to_point", "none"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IcpEnd(Frozen):
    """What one run of ICP gave."""

    transform: NDArray[np.float64]
    rmse: float
    n_pairs: int


def icp(
    source: Any, target: Any, start: NDArray[np.float64], reach: float, method: Refine, *, steps: int, change: float
) -> IcpEnd:
    """Run Open3D's ICP between clouds of about unit size, until share and RMSE of pairs change by `change`."""
    pipeline = open3d().pipelines.registration
    estimate = (
        pipeline.TransformationEstimationPointToPlane()
        if method == "point_to_plane"
        else pipeline.TransformationEstimationPointToPoint(False)
    )
    limits = pipeline.ICPConvergenceCriteria(change, change, steps)
    result = pipeline.registration_icp(source, target, reach, start, estimate, limits)
    return IcpEnd(np.array(result.transformation), float(result.inlier_rmse), len(result.correspondence_set))
