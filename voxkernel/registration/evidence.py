"""What can be measured of a motion after refinement: how much it explains, what contradicts it, how firmly it holds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.side import Side

__all__ = ["Evidence", "Fit", "Slack", "evidence_of", "fit_of", "slack_of", "slides"]

_FACING = 0.5  # cosine between normals that counts as facing the same way
_BESIDE = 5.0  # reaches within which a surface that goes on beside the other one contradicts the motion
_PENALTY = 0.6  # of a contradicted area, against an explained one
_AROUND = 16  # neighbours over which offsets are averaged
_MOVED = 0.14  # how far surfaces are slid, radians or of the mean arm: 8 degrees
_FORESEEN = 0.25  # of the mean square that the slide foresees
_BESIDE_NOISE = 0.5  # of the mean square before the slide
_ROUNDED = 1e-8  # of the size of the pair: what rounding of coordinates may leave of an offset


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
    values = slack_of(source, target, fit).values
    small = min(float(np.linalg.norm(np.ptp(s.points, axis=0))) for s in sides)
    return Evidence(
        max(shares), min(shares), sum(explained) / max(sum(explained) + sum(against), 1e-300),
        float(np.sqrt(common / total)) / small, float(np.sqrt(noise / total)) / small, turned / total,
        float(max(values[0], 0.0) / values[-1]), length / small,
        max(a / (e or 1.0) for a, e in zip(against, explained, strict=True)),
        max(float(np.median(m)) for m in means) / small,
    )  # fmt: skip


class Slack(NamedTuple):
    """How firmly the surfaces hold each other: six eigenvalues, ascending, 0 for a motion that slides freely.

    Their directions, about `center` and with turns in units of `arm`, are those of the surface that is held less,
    number `own`.
    """

    values: NDArray[np.float64]
    directions: NDArray[np.float64]
    center: NDArray[np.float64]
    arm: float
    own: int


def slack_of(source: Side, target: Side, fit: Fit) -> Slack:
    """Eigenvalues and vectors of the mean of (p x n, n)(p x n, n)^T over what is explained [1]_.

    Lengths are scaled so that rotations and shifts compare.

    .. [1] N. Gelfand et al., "Geometrically stable sampling for the ICP algorithm", 3DIM 2003.
    """
    found: list[Slack] = []
    for own, (side, inside) in enumerate(zip((source, target), fit.explained, strict=True)):
        if inside.sum() < 6:
            return Slack(np.zeros(6), np.eye(6), np.zeros(3), 1.0, own)
        center = side.points[inside].mean(axis=0)
        arms = side.points[inside] - center
        arm = float(np.sqrt((arms**2).sum(axis=1).mean())) or 1.0
        rows = np.hstack([np.cross(arms / arm, side.normals[inside]), side.normals[inside]])
        matrix = (rows * side.areas[inside][:, None]).T @ rows / side.areas[inside].sum()
        values, directions = np.linalg.eigh(matrix)
        found.append(Slack(np.asarray(values, np.float64), np.asarray(directions, np.float64), center, arm, own))
    return min(found, key=lambda s: float(s.values[0] / s.values[-1]))


def slides(source: Side, target: Side, motion: NDArray[np.float64], fit: Fit, slack: Slack, way: int) -> bool:
    """Whether the surfaces still lie on each other after a small motion along a direction of `slack`.

    A direction may be soft because the surfaces are smooth and yet lead away from the fit: then offsets grow as the
    eigenvalue says and beyond what they are without it. Between bodies of revolution they stay those of the facets,
    and under noise those of the noise.
    """
    sides = (source, target) if slack.own == 0 else (target, source)
    there = motion if slack.own == 0 else np.asarray(np.linalg.inv(motion), np.float64)
    inside, own = fit.explained[slack.own], sides[0]
    points, areas = own.points[inside], own.areas[inside]
    if len(points) < 6:
        return True
    before = float(areas @ fit.offsets[slack.own][inside] ** 2 / areas.sum())
    foreseen = _MOVED**2 * float(slack.values[way]) * slack.arm**2
    grown = min(_grown(points, areas, sides[1], there, slack, way, sign * _MOVED) for sign in (-1.0, 1.0)) - before
    return grown < max(_FORESEEN * foreseen, _BESIDE_NOISE * before, _ROUNDED**2)


def _grown(
    points: NDArray[np.float64], areas: NDArray[np.float64], other: Side, there: NDArray[np.float64], slack: Slack,
    way: int, much: float,
) -> float:  # fmt: skip
    """Mean square of the distances to the other surface after a motion, where that does not end."""
    from scipy.spatial.transform import Rotation

    step = much * slack.directions[:, way]
    turn = Rotation.from_rotvec(step[:3]).as_matrix()
    shifted = (points - slack.center) @ turn.T + slack.center + slack.arm * step[3:]
    found = other.nearest(shifted @ there[:3, :3].T + there[:3, 3])
    inner = ~found.on_rim
    if inner.sum() < 6:
        return 0.0
    return float(areas[inner] @ found.distances[inner] ** 2 / areas[inner].sum())
