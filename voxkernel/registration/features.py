"""Local features of thinned surfaces, matched and brought to agree, for where clutter or crops have moved kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._open3d import open3d
from voxkernel.registration.icp import laid
from voxkernel.registration.prepare import PreparedSurface, samples_of
from voxkernel.registration.rounding import on_grid

__all__ = ["FeaturePoints", "feature_motions", "feature_points"]

_SAMPLES = 8000
_NEIGHBOURS = 100
_MOST_POINTS = 2500
_MOST_MATCHES = 1000
_SAME = 1.0  # spacings by which lengths of a pair of matches may differ
_TURN = 0.35  # by which cosines of a pair of matches may differ
_GROUP = 10  # matches around a seed that give a motion
_NEAR = 1.5  # spacings within which a match holds
_FACING = 0.7  # cosine between the normals of a match that holds
_DISTINCT_DEG = 6.0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FeaturePoints(Frozen):
    """Points a spacing apart on a smoothed surface, their normals, and FPFH [1]_ as rows.

    .. [1] R. B. Rusu et al., "Fast point feature histograms (FPFH) for 3D registration", ICRA 2009.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    features: NDArray[np.float32]


def feature_points(surface: PreparedSurface, scale: float, spacing: float, radius: float) -> FeaturePoints:
    """Thin samples of a surface, in units of `scale`, to one a cell and describe each by what is within `radius`."""
    library = open3d()
    dense = samples_of(surface.smooth, surface.skin.faces, _SAMPLES)
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector(on_grid(dense.points / scale)))
    cloud.normals = library.utility.Vector3dVector(on_grid(dense.normals))
    thin = cloud.voxel_down_sample(spacing)
    thin.normalize_normals()
    if len(thin.points) > _MOST_POINTS:
        thin = thin.uniform_down_sample(-(-len(thin.points) // _MOST_POINTS))
    around = library.geometry.KDTreeSearchParamHybrid(radius, _NEIGHBOURS)
    found = library.pipelines.registration.compute_fpfh_feature(thin, around)
    return FeaturePoints(
        np.asarray(thin.points).copy(), np.asarray(thin.normals).copy(), np.asarray(found.data).T.astype(np.float32)
    )


def feature_motions(one: FeaturePoints, two: FeaturePoints, spacing: float, most: int) -> list[NDArray[np.float64]]:
    """Give the motions on which many matches agree, those with most of them first.

    Matches that keep lengths and angles support each other, and count by how many third ones both support [1]_;
    nothing is drawn at random.

    .. [1] Z. Chen et al., "SC2-PCR: a second order spatial compatibility for efficient and robust point cloud
       registration", CVPR 2022.
    """
    a, b = _matches(one.features, two.features)
    if len(a) < 3:
        return []
    p, q, n, m = one.points[a], two.points[b], one.normals[a], two.normals[b]
    agree = _compatible(p, q, n, m, spacing)
    support = agree * (agree @ agree)
    worth = support.sum(axis=1)
    seeds = np.argsort(-worth, kind="stable")
    seeds = seeds[worth[seeds] > 0]
    if not len(seeds):
        return []
    group = np.argsort(-support[seeds], axis=1, kind="stable")[:, :_GROUP]
    weights = np.take_along_axis(support[seeds], group, axis=1)
    weights[:, 0] = np.maximum(weights[:, 0], 1e-6)
    motions = laid(p[group], q[group], weights)
    holds = _holds(motions, (p, q, n, m), spacing)
    tried, kept = _Apart(p.mean(axis=0), spacing), _Apart(p.mean(axis=0), spacing)
    for k in np.argsort(-holds.sum(axis=1), kind="stable"):
        inside = holds[k]
        if inside.sum() < 3 or len(kept.motions) == most:
            break
        if tried.add(motions[k]):
            kept.add(laid(p[None, inside], q[None, inside], np.ones((1, int(inside.sum()))))[0])
    return kept.motions


def _holds(motions: NDArray[np.float64], matches: tuple[NDArray[np.float64], ...], spacing: float) -> NDArray[np.bool_]:
    """Say for each motion which matches it lays on each other, facing the same way."""
    p, q, n, m = matches
    turns = np.ascontiguousarray(motions[:, :3, :3])
    gaps = np.matmul(turns, p.T) + (motions[:, :3, 3:] - q.T)
    near = np.einsum("kin,kin->kn", gaps, gaps) < (_NEAR * spacing) ** 2
    cosines = turns.reshape(-1, 9) @ (m[:, :, None] * n[:, None, :]).reshape(-1, 9).T
    return near & (cosines > _FACING)


class _Apart:
    """Motions that are not close to one that is already there."""

    def __init__(self, middle: NDArray[np.float64], spacing: float) -> None:
        self.motions: list[NDArray[np.float64]] = []
        self._middle, self._spacing = middle, spacing
        self._turns, self._places = np.empty((0, 9)), np.empty((0, 3))

    def add(self, motion: NDArray[np.float64]) -> bool:
        """Keep a motion, unless it is close to another one."""
        turn, place = motion[:3, :3].ravel(), motion[:3, :3] @ self._middle + motion[:3, 3]
        same_turn = self._turns @ turn >= 1.0 + 2.0 * np.cos(np.radians(_DISTINCT_DEG))
        if (same_turn & (np.linalg.norm(self._places - place, axis=1) <= 3.0 * self._spacing)).any():
            return False
        self.motions.append(motion)
        self._turns, self._places = np.vstack([self._turns, turn]), np.vstack([self._places, place])
        return True


def _matches(one: NDArray[np.float32], two: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pair each point with the most similar one of the other surface, those that choose each other first."""
    if not len(one) or not len(two):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    gap = (one**2).sum(axis=1)[:, None] + (two**2).sum(axis=1) - 2.0 * (one @ two.T)
    to_two, to_one = gap.argmin(axis=1), gap.argmin(axis=0)
    first, second = np.arange(len(one)), np.arange(len(two))
    mutual = to_one[to_two] == first
    pairs = np.concatenate([
        np.column_stack([first[mutual], to_two[mutual]]),
        np.column_stack([first[~mutual], to_two[~mutual]]),
        np.column_stack([to_one, second])[to_two[to_one] != second],
    ])  # fmt: skip
    rank = np.concatenate([np.zeros(mutual.sum()), np.ones(len(pairs) - mutual.sum())])
    order = np.lexsort((gap[pairs[:, 0], pairs[:, 1]], rank))[:_MOST_MATCHES]
    return pairs[order, 0], pairs[order, 1]


def _compatible(
    p: NDArray[np.float64], q: NDArray[np.float64], n: NDArray[np.float64], m: NDArray[np.float64], spacing: float
) -> NDArray[np.float32]:
    """Say which matches keep the distance between their points and the angles of their normals, (k, k) of 0 and 1."""

    def facts(points: NDArray[np.float64], normals: NDArray[np.float64]) -> tuple[NDArray[np.float32], ...]:
        x, u = points.astype(np.float32), normals.astype(np.float32)
        square = (x**2).sum(axis=1)
        length = np.sqrt(np.maximum(square[:, None] + square - 2.0 * (x @ x.T), 0.0))
        along = (u @ x.T) - np.einsum("ij,ij->i", u, x)[:, None]  # n_i . (x_j - x_i)
        return length, along, u @ u.T

    one, two = facts(p - p.mean(axis=0), n), facts(q - q.mean(axis=0), m)
    agree = np.abs(one[0] - two[0]) < _SAME * spacing
    agree &= np.minimum(one[0], two[0]) > 2.0 * spacing
    tolerance = _TURN * one[0] + spacing * np.float32(0.5)
    aside = np.abs(one[1] - two[1]) < tolerance
    agree &= aside & aside.T & (np.abs(one[2] - two[2]) < 1.5 * _TURN)
    return agree.astype(np.float32)
