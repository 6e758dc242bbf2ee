"""Point-to-point ICP in NumPy: sums in a fixed order, so that equal input gives equal output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen

__all__ = ["IcpEnd", "Refine", "icp", "laid"]

Refine = Literal["point_to_plane", "point_to_point", "none"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IcpEnd(Frozen):
    """What one run of ICP gave."""

    transform: NDArray[np.float64]
    rmse: float
    n_pairs: int


def icp(
    points: NDArray[np.float64], others: NDArray[np.float64], start: NDArray[np.float64], reach: float, *,
    steps: int, change: float,
) -> IcpEnd:  # fmt: skip
    """Lay points on the nearest of the others within reach, until share and RMSE of pairs change by `change`."""
    from scipy.spatial import KDTree

    tree = KDTree(others)
    motion, share, rmse, count = start.copy(), -1.0, np.inf, 0
    for step in range(steps + 1):
        moved = points @ motion[:3, :3].T + motion[:3, 3]
        answer: Any = tree.query(moved, distance_upper_bound=reach)
        found = np.flatnonzero(np.isfinite(answer[0]))
        before, count = (share, rmse), len(found)
        share = count / len(points)
        rmse = float(np.sqrt(np.mean(answer[0][found] ** 2))) if count else 0.0
        rests = abs(share - before[0]) < change and abs(rmse - before[1]) < change
        if count < 3 or rests or step == steps:
            break
        motion = laid(points[None, found], others[None, answer[1][found]], np.ones((1, count)))[0]
    return IcpEnd(motion, rmse, count)


def laid(p: NDArray[np.float64], q: NDArray[np.float64], weights: NDArray[Any]) -> NDArray[np.float64]:
    """Rigid motions (k, 4, 4) that lay weighted points (k, n, 3) on their partners: Kabsch, by least squares."""
    share = (weights / weights.sum(axis=1, keepdims=True))[:, :, None]
    start, end = (share * p).sum(axis=1), (share * q).sum(axis=1)
    cross = np.einsum("kni,knj->kij", share * (p - start[:, None]), q - end[:, None])
    u, _, vt = np.linalg.svd(cross)
    v = vt.transpose(0, 2, 1).copy()
    v[:, :, 2] *= np.sign(np.linalg.det(v @ u.transpose(0, 2, 1)))[:, None]
    motions = np.tile(np.eye(4), (len(p), 1, 1))
    motions[:, :3, :3] = v @ u.transpose(0, 2, 1)
    motions[:, :3, 3] = end - np.einsum("kij,kj->ki", motions[:, :3, :3], start)
    return motions
