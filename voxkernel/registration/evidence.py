"""What can be measured of a motion after refinement: how much it explains, what contradicts it, how firmly it holds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.side import Side

__all__ = ["Evidence", "Fit", "evidence_of", "fit_of", "slack_of"]

_FACING = 0.5  # cosine between normals that counts as facing the same way
_BESIDE = 5.0  # reaches within which a surface that goes on beside the other one contradicts the motion
_PENALTY = 0.6  # of a contradicted area, against an explained one
_AROUND = 16  # neighbours over which offsets are averaged


class Fit(NamedTuple):
    """Samples of both surfaces under a motion: offsets, areas, which are explained and which contradict."""

    rank: float
    distances: tuple[NDArray[np.float64], NDArray[np.float64]]
    offsets: tuple[NDArray[np.float64], NDArray[np.float64]]
    cosines: tuple[NDArray[np.float64], NDArray[np.float64]]
    explained: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    contradicted: tuple[NDArray[np.bool_], NDArray[np.bool_]]


class Evidence(NamedTuple):
    """Numbers about a motion, lengths as shares of the smaller diagonal.

    `explained_more` and `explained_less` are the explained shares of the surface that the other one covers best and
    least, `agreement` what is explained of all that could contradict, `systematic` the offset that neighbours have in
    common, `noise` what is left, `turned` the mean of 1 - cosine of the normals, `held` the smallest eigenvalue that
    keeps the surfaces from sliding over the largest, `overlap` the root of the explained area, `shortfall` the
    contradicted area over the explained one, on the side where it is larger, `core` the median of the offsets that
    neighbours have in common: small where most of a surface is the same, whatever the rest does.
    """

    explained_more: float
    explained_less: float
    agreement: float
    systematic: float
    noise: float
    turned: float
    held: float
    overlap: float
    shortfall: float
    core: float


def fit_of(source: Side, target: Side, motion: NDArray[np.float64], reach: float) -> Fit:
    """Look from the samples of each surface at the other one."""
    back = np.asarray(np.linalg.inv(motion), dtype=np.float64)
    halves = [_half(source, target, motion, reach), _half(target, source, back, reach)]
    worth = sum(
        float(side.areas[e] @ (1.0 - (d[e] / reach) ** 2)) - _PENALTY * float(side.areas[c].sum())
        for side, (d, _, _, e, c) in zip((source, target), halves, strict=True)
    )
    rank = worth / (2.0 * min(source.area, target.area) or 1.0)
    return Fit(rank, *zip(*halves, strict=True))


def _half(
    own: Side, other: Side, motion: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    moved = own.points @ motion[:3, :3].T + motion[:3, 3]
    found = other.nearest(moved)
    turn = motion[:3, :3] / np.cbrt(np.linalg.det(motion[:3, :3]))
    cosines = np.einsum("ij,ij->i", own.normals @ turn.T, found.normals)
    offsets = np.einsum("ij,ij->i", found.spots - moved, found.normals)
    faces = cosines > _FACING
    explained = faces & (found.distances < reach) & ~(found.on_rim & (found.distances > 0.5 * reach))
    contradicted = ~explained & ~found.on_rim & (cosines > 0.0) & (found.distances < _BESIDE * reach)
    return found.distances, offsets, cosines, explained, contradicted


def evidence_of(source: Side, target: Side, motion: NDArray[np.float64], fit: Fit) -> Evidence:
    """Sum a fit up."""
    from scipy.spatial import KDTree

    sides = source, target
    explained = [float(s.areas[e].sum()) for s, e in zip(sides, fit.explained, strict=True)]
    against = [float(s.areas[c].sum()) for s, c in zip(sides, fit.contradicted, strict=True)]
    shares = [e / (s.area or 1.0) for s, e in zip(sides, explained, strict=True)]
    if min(int(e.sum()) for e in fit.explained) < 3 * _AROUND:
        return Evidence(max(shares), min(shares), 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0)
    length = float(np.sqrt(np.mean(explained)))
    common = noise = turned = total = 0.0
    means: list[NDArray[np.float64]] = []
    for side, inside, offsets, cosines in zip(sides, fit.explained, fit.offsets, fit.cosines, strict=True):
        points, own, areas = side.points[inside], offsets[inside], side.areas[inside]
        near = KDTree(points).query(points, k=_AROUND)[1]
        mean = own[near].mean(axis=1)
        means.append(np.abs(mean))
        rest = ((own[near] - mean[:, None]) ** 2).sum(axis=1) / (_AROUND - 1)
        common += float(areas @ np.maximum(mean**2 - rest / _AROUND, 0.0))
        noise += float(areas @ rest)
        turned += float(areas @ (1.0 - cosines[inside]))
        total += float(areas.sum())
    values = slack_of(source, target, fit)
    small = min(float(np.linalg.norm(np.ptp(s.points, axis=0))) for s in sides)
    return Evidence(
        max(shares), min(shares), sum(explained) / max(sum(explained) + sum(against), 1e-300),
        float(np.sqrt(common / total)) / small, float(np.sqrt(noise / total)) / small, turned / total,
        float(max(values[0], 0.0) / values[-1]), length / small,
        max(a / (e or 1.0) for a, e in zip(against, explained, strict=True)),
        max(float(np.median(m)) for m in means) / small,
    )  # fmt: skip


def slack_of(source: Side, target: Side, fit: Fit) -> NDArray[np.float64]:
    """How firmly the surfaces hold each other: six eigenvalues, ascending, 0 for a motion that slides freely.

    Of the mean of (p x n, n)(p x n, n)^T over what is explained, lengths scaled so that rotations
    and shifts compare [1]_; of the surface that is held less.

    .. [1] N. Gelfand et al., "Geometrically stable sampling for the ICP algorithm", 3DIM 2003.
    """
    found: list[NDArray[np.float64]] = []
    for side, inside in zip((source, target), fit.explained, strict=True):
        if inside.sum() < 6:
            return np.zeros(6)
        arms = side.points[inside] - side.points[inside].mean(axis=0)
        arms /= float(np.sqrt((arms**2).sum(axis=1).mean())) or 1.0
        rows = np.hstack([np.cross(arms, side.normals[inside]), side.normals[inside]])
        matrix = (rows * side.areas[inside][:, None]).T @ rows / side.areas[inside].sum()
        found.append(np.asarray(np.linalg.eigvalsh(matrix), dtype=np.float64))
    return min(found, key=lambda values: float(values[0] / values[-1]))
