"""Which pairs of many surfaces are worth a registration: by moments of their kernels and by local descriptors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._open3d import open3d
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.rounding import on_grid

__all__ = ["Description", "Likeness", "compared", "describe", "ranked_pairs", "shortlist"]

_POINTS = 600
_REACH = 0.12  # of the diagonal: how far a local descriptor sees
_SAME_LENGTH = 0.03  # of the diagonal: lengths between matched points that differ by less agree
_SAME_BEND = 0.35  # of cosines between normals and lengths
_NEAREST = 3  # descriptors that may match one
_MOST_MATCHES = 400
_LEAST_MATCHES = 3.0
_MOST_MOTIONS = 3
_IN_CLUSTER = 0.3  # of the largest weight: matches that count for the motion
_MOMENT_SIGMA = 0.35  # of the logarithms of the kernels' spreads


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Description(Frozen):
    """Points of a surface with a local descriptor each, and the spreads of its kernels."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    descriptors: NDArray[np.float64]
    spreads: NDArray[np.float64]
    diagonal: float


class Likeness(NamedTuple):
    """How alike two surfaces are, and the motions between local frames that matches which agree ask for."""

    value: float
    motions: tuple[NDArray[np.float64], ...]  # in units of the common size, the best first


def describe(surface: PreparedSurface, scale: float) -> Description:
    """Describe some points of a surface by fast point feature histograms [1]_, whose reach goes with `scale`.

    .. [1] R. B. Rusu, N. Blodow, M. Beetz, "Fast point feature histograms (FPFH) for 3D registration", ICRA 2009.
    """
    library = open3d()
    cloud: Any = library.geometry.PointCloud(library.utility.Vector3dVector(on_grid(surface.coarse.points / scale)))
    cloud.normals = library.utility.Vector3dVector(on_grid(surface.coarse.normals))
    step = max(1, len(surface.coarse.points) // _POINTS)
    near = library.geometry.KDTreeSearchParamHybrid(_REACH, 100)
    histograms = np.asarray(library.pipelines.registration.compute_fpfh_feature(cloud, near).data).T
    spreads = [m.spread if not m.is_empty else np.full(3, np.nan) for m in surface.moments]
    return Description(
        np.asarray(cloud.points)[::step].copy(), np.asarray(cloud.normals)[::step].copy(), histograms[::step].copy(),
        np.concatenate(spreads) / scale if spreads else np.empty(0), surface.diagonal / scale,
    )  # fmt: skip


def compared(one: Description, two: Description) -> Likeness:
    """Say how much of two surfaces seems to be the same, and the motion that lays that part on the other.

    Points are matched where each is the other's best; of the table of pairs of matches whose lengths agree on both
    surfaces the largest eigenvalue counts those that agree with each other, and its vector says which they are [1]_.
    Kernels of like spreads make it up to half larger. Moved surfaces give the same.

    .. [1] M. Leordeanu, M. Hebert, "A spectral technique for correspondence problems using pairwise constraints",
       ICCV 2005.
    """
    if not len(one.points) or not len(two.points):
        return Likeness(0.0, ())
    ends = _matches(one, two)
    if len(ends) < 3:
        return Likeness(0.0, ())
    first, second = ends.T
    agree = _agreement(
        one.points[first], one.normals[first], two.points[second], two.normals[second]
    )
    motions: list[NDArray[np.float64]] = []
    matched, left = 0.0, np.arange(len(ends))
    for _ in range(_MOST_MOTIONS):
        values, vectors = np.linalg.eigh(agree[np.ix_(left, left)])
        value, weight = float(values[-1]), np.abs(vectors[:, -1])
        matched = max(matched, value)
        if value < _LEAST_MATCHES or value < 0.4 * matched:
            break
        kept = weight > _IN_CLUSTER * weight.max()
        chosen = left[kept]
        motions.append(_laid(one.points[first[chosen]], two.points[second[chosen]], weight[kept]))
        left = left[~kept]
        if len(left) < 3:
            break
    return Likeness(matched * (1.0 + 0.5 * _like_kernels(one, two)), tuple(motions))


def _matches(one: Description, two: Description) -> NDArray[np.int64]:
    """Pairs of points with like descriptors, (k, 2): those that are each other's best first, the most alike first."""
    from scipy.spatial import KDTree

    there: Any = KDTree(two.descriptors).query(one.descriptors, k=min(_NEAREST, len(two.points)))
    back: Any = KDTree(one.descriptors).query(two.descriptors, k=min(_NEAREST, len(one.points)))
    n = len(two.points)
    forth = (np.arange(len(one.points))[:, None] * n + there[1].reshape(len(one.points), -1)).ravel()
    again = (back[1].reshape(n, -1) * n + np.arange(n)[:, None]).ravel()
    codes = np.intersect1d(forth, again)
    pairs = np.column_stack([codes // n, codes % n])
    apart = np.linalg.norm(one.descriptors[pairs[:, 0]] - two.descriptors[pairs[:, 1]], axis=1)
    return pairs[np.argsort(apart, kind="stable")[:_MOST_MATCHES]]


def _agreement(
    points: NDArray[np.float64], normals: NDArray[np.float64],
    others: NDArray[np.float64], other_normals: NDArray[np.float64],
) -> NDArray[np.float64]:  # fmt: skip
    """How well any two matches agree, in [0, 1]: the length between them, and how the normals stand to it.

    The last of the four numbers changes its sign in a mirror.
    """
    shapes: list[tuple[NDArray[np.float64], ...]] = []
    for at, normal in ((points, normals), (others, other_normals)):
        way = at[None] - at[:, None]
        length = np.linalg.norm(way, axis=2)
        way /= np.maximum(length, 1e-12)[..., None]
        here = np.einsum("ik,ijk->ij", normal, way)
        turn = np.einsum("ijk,ijk->ij", np.cross(normal[:, None], normal[None]), way)
        shapes.append((length, here, turn))
    (length, here, turn), (other_length, other_here, other_turn) = shapes
    differ = np.abs(length - other_length) / _SAME_LENGTH
    bend = np.abs(here - other_here) / _SAME_BEND
    bend = np.maximum(np.maximum(bend, bend.T), np.abs(turn - other_turn) / _SAME_BEND)
    apart = np.minimum(length, other_length) > _SAME_LENGTH
    return np.where(apart & (differ < 1.0) & (bend < 1.0), 1.0 - differ, 0.0)


def _laid(start: NDArray[np.float64], end: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lay points on their partners by least squares: the rotation from a singular value decomposition (Kabsch)."""
    share = weight / weight.sum()
    middles = share @ start, share @ end
    u, _, vt = np.linalg.svd((start - middles[0]).T @ ((end - middles[1]) * share[:, None]))
    turn = vt.T @ np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)]) @ u.T
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn, middles[1] - turn @ middles[0]
    return motion


def _like_kernels(one: Description, two: Description) -> float:
    """1 for kernels of equal spreads, toward 0 for others; 0 where one is empty."""
    if one.spreads.shape != two.spreads.shape or not len(one.spreads):
        return 0.0
    good = (one.spreads > 0) & (two.spreads > 0)
    if not good.any():
        return 0.0
    apart = np.log(one.spreads[good] / two.spreads[good])
    return float(np.exp(-0.5 * np.mean((apart / _MOMENT_SIGMA) ** 2)))


def ranked_pairs(likenesses: NDArray[np.float64]) -> list[tuple[int, int]]:
    """All pairs i < j of a symmetric table, the most alike first."""
    i, j = np.triu_indices(len(likenesses), 1)
    order = np.argsort(-likenesses[i, j], kind="stable")
    return [(int(i[k]), int(j[k])) for k in order]


def shortlist(likenesses: NDArray[np.float64], neighbors: int) -> list[tuple[int, int]]:
    """Choose for every surface the ones most like it, and the best pairs that join all of them to one."""
    n = len(likenesses)
    table = likenesses.copy()
    np.fill_diagonal(table, -np.inf)
    nearest = np.argsort(-table, axis=1, kind="stable")[:, : min(neighbors, n - 1)]
    chosen = {(min(i, int(j)), max(i, int(j))) for i in range(n) for j in nearest[i]}
    root = list(range(n))
    for i, j in ranked_pairs(likenesses):
        if root[i] != root[j]:
            chosen.add((i, j))
            old, new = root[j], root[i]
            root = [new if r == old else r for r in root]
    return sorted(chosen)
