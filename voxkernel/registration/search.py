"""Candidate motions from kernel moments, and how well each lays one surface on the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.measures import KernelMoments
from voxkernel.registration.prepare import PreparedSurface, Samples
from voxkernel.registration.rounding import motion_on_grid, on_grid

__all__ = [
    "Guess", "ScoredCloud", "add_guesses", "frame_transforms", "inverse", "kernel_guesses", "net_guesses",
    "pair_scores", "rotation_angle_deg", "stepped", "tried",
]  # fmt: skip

_SAME_DEG = 10.0  # guesses nearer than this lead to the same place
_MANY = 24  # guesses after which they must be farther apart
_NEAR = 1 / 15  # of the diagonal: pairs farther apart count as nothing when guesses are scored
_FAR = 1 / 8
_STEPS = 10
_MOVED = 300  # samples of the source that a short ICP moves, at least
_FEWEST = 6
_RESTS = 1e-5
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
    """Samples with a search tree, scaled to the size of the pair."""

    def __init__(self, samples: Samples, scale: float) -> None:
        from scipy.spatial import KDTree

        self.points = on_grid(samples.points / scale)
        self.normals = on_grid(samples.normals)
        self.tree = KDTree(self.points)
        step = max(1, len(self.points) // _MOVED)
        self.few, self.few_normals = self.points[::step], self.normals[::step]

    def nearest(
        self, points: NDArray[np.float64], reach: float
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.float64]]:
        """For points (..., 3) whether a sample lies within reach, the nearest one, and how far it is."""
        answer: Any = self.tree.query(points.reshape(-1, 3), distance_upper_bound=reach)
        shape = points.shape[:-1]
        distances: NDArray[np.float64] = answer[0].reshape(shape)
        return np.isfinite(distances), np.minimum(answer[1], len(self.points) - 1).reshape(shape), distances

    def shares_near(self, other: ScoredCloud, motions: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
        """For each motion the mean over samples of 1 - (d / reach)^2, 0 beyond reach or where the normals disagree."""
        turns = motions[:, :3, :3].transpose(0, 2, 1)
        near, ids, distances = other.nearest(self.few @ turns + motions[:, None, :3, 3], reach)
        near &= np.einsum("gni,gni->gn", self.few_normals @ turns, other.normals[ids]) > _FACING
        return np.where(near, 1.0 - (np.where(near, distances, 0.0) / reach) ** 2, 0.0).mean(axis=1)


def pair_scores(
    source: ScoredCloud, target: ScoredCloud, motions: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """Mean of the shares of both surfaces that lie near the other, facing the same way; 1 is a perfect fit."""
    backs = np.stack([inverse(m) for m in motions])
    return 0.5 * (source.shares_near(target, motions, reach) + target.shares_near(source, backs, reach))


def stepped(
    source: ScoredCloud, target: ScoredCloud, starts: NDArray[np.float64], reach: float, steps: int
) -> NDArray[np.float64]:
    """Move all motions by so many steps of point-to-plane ICP; one that has come to rest stays."""
    motions, going = starts.copy(), np.arange(len(starts))
    for _ in range(steps):
        now = motions[going]
        moved = source.few @ now[:, :3, :3].transpose(0, 2, 1) + now[:, None, :3, 3]
        near, ids, _ = target.nearest(moved, reach)
        normals = target.normals[ids]
        offsets = np.einsum("gni,gni->gn", target.points[ids] - moved, normals)
        middle = moved.mean(axis=1)
        rows = np.concatenate([np.cross(moved - middle[:, None], normals), normals], axis=2)
        rows[~near] = 0.0
        turned = rows.transpose(0, 2, 1)
        matrix = turned @ rows
        spread = np.einsum("gii->g", matrix)
        held = (near.sum(axis=1) >= _FEWEST) & (spread > 0)
        going, now, middle = going[held], now[held], middle[held]
        if not len(going):
            break
        matrix = matrix[held] + 1e-9 * spread[held, None, None] * np.eye(6)
        answer = np.linalg.solve(matrix, (turned @ offsets[..., None])[held])[..., 0]
        change = _small_motions(answer, middle)
        motions[going] = change @ now
        going = going[np.abs(change - np.eye(4)).max(axis=(1, 2)) > _RESTS]
    return motions


def _small_motions(steps: NDArray[np.float64], middles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Motions (k, 4, 4) from turns (at most half a radian) about the middles, and shifts."""
    from scipy.spatial.transform import Rotation

    length = np.linalg.norm(steps[:, :3], axis=1, keepdims=True)
    turns = Rotation.from_rotvec(steps[:, :3] * np.minimum(1.0, 0.5 / np.maximum(length, 1e-300))).as_matrix()
    motions = np.tile(np.eye(4), (len(steps), 1, 1))
    motions[:, :3, :3] = turns
    motions[:, :3, 3] = middles + steps[:, 3:] - np.einsum("kij,kj->ki", turns, middles)
    return motions


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
    if not kept:
        return more
    turns = np.stack([k.transform[:3, :3] for k in kept])
    return [g for g in more if _all_apart(g.transform, turns, 2 * _SAME_DEG)]


def add_guesses(kept: list[Guess], more: list[Guess]) -> None:
    """Add guesses that are not close to one already there."""
    apart = _SAME_DEG if len(kept) < _MANY else 3.0 * _SAME_DEG
    turns = np.empty((len(kept) + len(more), 3, 3))
    for k, guess in enumerate(kept):
        turns[k] = guess.transform[:3, :3]
    for guess in more:
        if _all_apart(guess.transform, turns[: len(kept)], apart):
            turns[len(kept)] = guess.transform[:3, :3]
            kept.append(guess)


def _all_apart(motion: NDArray[np.float64], turns: NDArray[np.float64], angle_deg: float) -> bool:
    """Whether a rotation is farther than an angle from all of some (k, 3, 3), by the traces of the differences."""
    traces = np.einsum("kij,ij->k", turns, motion[:3, :3])
    return bool((traces < 1.0 + 2.0 * np.cos(np.radians(angle_deg))).all())


def tried(guesses: list[Guess], clouds: tuple[ScoredCloud, ScoredCloud], scale: float, most: int) -> list[Guess]:
    """Score guesses, move the best by a short ICP on few samples unless that makes them worse, and sort them."""
    starts = np.stack([motion_on_grid(_shrunk(g.transform, 1.0 / scale)) for g in guesses])
    scores = pair_scores(*clouds, starts, _NEAR)
    order = np.argsort(-scores, kind="stable")[:most]
    starts, scores = starts[order], scores[order]
    moved = stepped(*clouds, starts, _FAR, _STEPS)
    moved = stepped(*clouds, moved, _NEAR, _STEPS)
    after = pair_scores(*clouds, moved, _NEAR)
    better = after >= scores
    ends = [
        replace(
            guesses[k], score=float(scores[n]), moved=_shrunk(moved[n] if better[n] else starts[n], scale),
            moved_score=float(max(after[n], scores[n])),
        )
        for n, k in enumerate(order)
    ]  # fmt: skip
    return sorted(ends, key=lambda g: -g.moved_score)


def _shrunk(motion: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    changed = motion.copy()
    changed[:3, 3] *= factor
    return changed
