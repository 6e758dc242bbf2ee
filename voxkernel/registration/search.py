"""Candidate motions from kernel moments, and how well each lays one surface on the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel._open3d import open3d
from voxkernel.measures import KernelMoments
from voxkernel.registration.icp import icp
from voxkernel.registration.prepare import PreparedSurface, Samples

__all__ = [
    "Guess", "ScoredCloud", "add_guesses", "frame_transforms", "inverse", "kernel_guesses", "net_guesses",
    "pair_score", "rotation_angle_deg", "tried",
]  # fmt: skip

_SAME_DEG = 10.0  # guesses nearer than this lead to the same place
_MANY = 24  # guesses after which they must be farther apart
_NEAR = 1 / 15  # of the diagonal: pairs farther apart count as nothing when guesses are scored
_FAR = 1 / 8
_STEPS = 15
_FACING = 0.5  # cosine between normals of a pair that counts
_EQUAL_AXES = 0.1  # axes whose spreads differ by less than this share can be exchanged


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Guess(Frozen):
    """A motion from source to target in local frames, where it comes from, and its scores."""

    transform: NDArray[np.float64]
    origin: str
    margin: float
    moved: NDArray[np.float64]
    score: float = 0.0
    moved_score: float = 0.0


class ScoredCloud:
    """Samples with a search tree and an Open3D cloud, scaled to the size of the pair."""

    def __init__(self, samples: Samples, scale: float) -> None:
        from scipy.spatial import KDTree

        library = open3d()
        self.points = samples.points / scale
        self.normals = samples.normals
        self.n_vertices = samples.n_vertices
        self.tree = KDTree(self.points)
        self.cloud: Any = library.geometry.PointCloud(library.utility.Vector3dVector(self.points.copy()))
        self.cloud.normals = library.utility.Vector3dVector(self.normals.copy())

    def share_near(self, other: ScoredCloud, transform: NDArray[np.float64], reach: float) -> float:
        """Mean over the points of 1 - (d / reach)^2, 0 beyond reach or where the normals disagree."""
        _, found, nearest, distances = self.pairs(other, transform, reach)
        turned = self.normals[found] @ transform[:3, :3].T
        agree = np.einsum("ij,ij->i", turned, other.normals[nearest]) > _FACING
        return float(np.sum(1.0 - (distances[agree] / reach) ** 2)) / len(self.points)

    def pairs(
        self, other: ScoredCloud, transform: NDArray[np.float64], reach: float
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Move the points; those with a partner within reach, their partners, and how far apart they are."""
        moved = self.points @ transform[:3, :3].T + transform[:3, 3]
        answer: Any = other.tree.query(moved, distance_upper_bound=reach)
        found = np.flatnonzero(np.isfinite(answer[0]))
        return moved[found], found, answer[1][found], answer[0][found]


def pair_score(source: ScoredCloud, target: ScoredCloud, transform: NDArray[np.float64], reach: float) -> float:
    """Mean of the shares of both surfaces that lie near the other, facing the same way; 1 is a perfect fit."""
    back = inverse(transform)
    return 0.5 * (source.share_near(target, transform, reach) + target.share_near(source, back, reach))


def inverse(motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Invert a rigid motion."""
    back = np.eye(4)
    back[:3, :3] = motion[:3, :3].T
    back[:3, 3] = -motion[:3, :3].T @ motion[:3, 3]
    return back


def rotation_angle_deg(one: NDArray[np.float64], two: NDArray[np.float64]) -> float:
    """Angle between two rotations, degrees, accurate near 0 and 180."""
    difference = one[:3, :3] @ two[:3, :3].T
    sine = np.linalg.norm(difference - difference.T) / np.sqrt(8.0)
    return float(np.degrees(np.arctan2(sine, 0.5 * (np.trace(difference) - 1.0))))


def frame_transforms(source: KernelMoments, target: KernelMoments) -> NDArray[np.float64]:
    """Lay the principal frame of one kernel on that of the other in every proper way.

    Returns (k, 4, 4): the four choices of signs; where spreads are nearly equal, the axes
    are turned as well. None for an empty kernel, the identity for two points.
    """
    if source.is_empty or target.is_empty:
        return np.empty((0, 4, 4))
    gaps = np.minimum(source.axis_gaps, target.axis_gaps)
    found = [np.diag([a, b, a * b]) for a, b in product((1.0, -1.0), repeat=2)]
    first, second = (bool(g < _EQUAL_AXES) for g in gaps)
    if first and second:
        found = _net()
    elif first:
        found = _turns(0, 2)[:, None] @ _turns(2, 8)
    elif second:
        found = _turns(2, 2)[:, None] @ _turns(0, 8)
    rotations = target.axes.T @ np.reshape(found, (-1, 3, 3)) @ source.axes
    return np.stack([_motion(r, source.centroid, target.centroid) for r in rotations])


def _turns(axis: int, count: int) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    angles = np.arange(count)[:, None] * (2.0 * np.pi / count)
    return Rotation.from_rotvec(angles * np.eye(3)[axis]).as_matrix()


def _net() -> NDArray[np.float64]:
    """Sixty rotations, those of an icosahedron: every rotation is within 45 degrees of one of them."""
    from scipy.spatial.transform import Rotation

    return Rotation.create_group("I").as_matrix()


def _motion(rotation: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = rotation, end - rotation @ start
    return motion


def kernel_guesses(
    margins: tuple[float, ...], source: tuple[KernelMoments, ...], target: tuple[KernelMoments, ...], origin: str
) -> list[Guess]:
    """Collect the guesses of kernels, margin by margin, without those that come close to one already there."""
    kept: list[Guess] = []
    for margin, one, two in zip(margins, source, target, strict=False):
        add_guesses(kept, [Guess(t, origin, margin, t) for t in frame_transforms(one, two)])
    return kept


def net_guesses(source: PreparedSurface, target: PreparedSurface, kept: list[Guess]) -> list[Guess]:
    """Give more guesses: the frames of the surfaces, then a net of rotations about the kernels' centroids."""
    more: list[Guess] = []
    for a, b in product((1.0, -1.0), repeat=2):
        turn = _motion(np.diag([a, b, a * b]), np.zeros(3), np.zeros(3))
        more.append(Guess(turn, "surface", np.nan, turn))
    centers = [next((m.centroid for m in reversed(s.moments) if not m.is_empty), np.zeros(3)) for s in (source, target)]
    more += [Guess(m, "net", np.nan, m) for m in (_motion(r, *centers) for r in _net())]
    return [g for g in more if all(rotation_angle_deg(g.transform, k.transform) > 2 * _SAME_DEG for k in kept)]


def add_guesses(kept: list[Guess], more: list[Guess]) -> None:
    """Add guesses that are not close to one already there."""
    apart = _SAME_DEG if len(kept) < _MANY else 3.0 * _SAME_DEG
    for guess in more:
        if all(rotation_angle_deg(guess.transform, k.transform) > apart for k in kept):
            kept.append(guess)


def tried(guesses: list[Guess], clouds: tuple[ScoredCloud, ScoredCloud], scale: float, most: int) -> list[Guess]:
    """Score guesses, move the best by a short ICP on few samples, and sort them, the best first."""
    scored = sorted((_scored(g, clouds, scale) for g in guesses), key=lambda g: -g.score)
    return sorted((_tried(g, clouds, scale) for g in scored[:most]), key=lambda g: -g.moved_score)


def _scored(guess: Guess, clouds: tuple[ScoredCloud, ScoredCloud], scale: float) -> Guess:
    start = guess.transform.copy()
    start[:3, 3] /= scale
    return replace(guess, score=pair_score(*clouds, start, _NEAR))


def _tried(guess: Guess, clouds: tuple[ScoredCloud, ScoredCloud], scale: float) -> Guess:
    """Move a guess by a short ICP, unless that makes it worse."""
    source, target = clouds
    start = guess.transform.copy()
    start[:3, 3] /= scale
    moved = start
    for reach in (_FAR, _NEAR):
        moved = icp(source.cloud, target.cloud, moved, reach, "point_to_plane", steps=_STEPS, change=1e-6).transform
    moved_score = pair_score(source, target, moved, _NEAR)
    if not np.isfinite(moved).all() or moved_score < guess.score:
        moved, moved_score = start, guess.score
    moved = moved.copy()
    moved[:3, 3] *= scale
    return replace(guess, moved=moved, moved_score=moved_score)
