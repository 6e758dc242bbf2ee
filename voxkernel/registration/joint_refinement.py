"""Poses of many scans -> better ones: point-to-plane ICP of all pairs that overlap at once."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.rounding import on_grid

__all__ = ["Refinement", "refined_together"]

_SAMPLES = 1000
_REACHES = (1 / 12, 1 / 30, 1 / 80)  # of the common size
_NOISE = 4.0  # standard deviations of the noise that count
_LEAST = 1e-4  # of the common size: no reach below this
_OVERLAP = 0.05  # of the samples of a scan that must lie near another one for the two to pull
_FACING = 0.5
_STEPS = 30
_HALVINGS = 4
_SETTLED = 1e-5  # share of the energy that a step must still gain
_DAMPING = 1e-6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Refinement(Frozen):
    """Poses, root of the mean squared residual before and after, and the pairs that pulled."""

    poses: NDArray[np.float64]
    before: float
    after: float
    pairs: tuple[tuple[int, int], ...]


class _Cloud:
    """Samples of a scan in its own frame, in units of the common size, with a search tree."""

    def __init__(self, surface: PreparedSurface, size: float) -> None:
        from scipy.spatial import KDTree

        points, normals = on_grid(surface.fine.points / size), on_grid(surface.fine.normals)
        self.points, self.normals, self.tree = points, normals, KDTree(points)
        shown = np.linspace(0, len(points) - 1, min(_SAMPLES, len(points))).astype(np.int64)
        self.few, self.few_normals = points[shown], normals[shown]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Pull(Frozen):
    """Samples of scan i next to scan j, in the common frame, the normals of j there and how far off they are."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    n_samples: int


def refined_together(surfaces: list[PreparedSurface], poses: NDArray[np.float64], size: float) -> Refinement:
    """Let all scans that overlap pull at each other; never worse than what is given.

    The residual is the distance of a sample of one scan from the tangent plane at the next point of another, at most
    the reach, where the two face the same way and are within reach; other samples count the reach. Its mean square
    over all pairs falls from step to step, or the step is not taken. `poses` map local frames into that of the first.
    """
    clouds = [_Cloud(s, size) for s in surfaces]
    start = poses.copy()
    start[:, :3, 3] /= size
    pairs = _overlapping(clouds, start, _REACHES[0])
    if not pairs:
        return Refinement(poses, float("nan"), float("nan"), ())
    found = start
    for reach in _REACHES:
        found = _descended(clouds, found, pairs, reach)
    reach = _noise_reach(clouds, found, pairs)
    found = _descended(clouds, found, pairs, reach)
    before, after = (_energy(_pulls(clouds, p, pairs, reach), reach) for p in (start, found))
    if not after <= before:
        found = _descended(clouds, start, pairs, reach)
        after = _energy(_pulls(clouds, found, pairs, reach), reach)
    world = found.copy()
    world[:, :3, 3] *= size
    shown = tuple(sorted({(min(p), max(p)) for p in pairs}))
    return Refinement(world, size * float(np.sqrt(before)), size * float(np.sqrt(after)), shown)


def _pull(one: _Cloud, two: _Cloud, pose_one: Any, pose_two: Any, reach: float) -> _Pull:
    points = one.few @ pose_one[:3, :3].T + pose_one[:3, 3]
    turned = one.few_normals @ pose_one[:3, :3].T
    there = (points - pose_two[:3, 3]) @ pose_two[:3, :3]
    answer: Any = two.tree.query(there, distance_upper_bound=reach)
    found = np.flatnonzero(np.isfinite(answer[0]))
    normals = two.normals[answer[1][found]] @ pose_two[:3, :3].T
    facing = np.einsum("ij,ij->i", turned[found], normals) > _FACING
    found, normals = found[facing], normals[facing]
    ends = two.points[answer[1][found]] @ pose_two[:3, :3].T + pose_two[:3, 3]
    offsets = np.einsum("ij,ij->i", points[found] - ends, normals)
    return _Pull(points[found], normals, offsets, len(points))


def _pulls(
    clouds: list[_Cloud], poses: NDArray[np.float64], pairs: list[tuple[int, int]], reach: float
) -> list[_Pull]:
    return [_pull(clouds[i], clouds[j], poses[i], poses[j], reach) for i, j in pairs]


def _overlapping(clouds: list[_Cloud], poses: NDArray[np.float64], reach: float) -> list[tuple[int, int]]:
    pairs: list[tuple[int, int]] = []
    for i, j in permutations(range(len(clouds)), 2):
        pull = _pull(clouds[i], clouds[j], poses[i], poses[j], reach)
        if len(pull.points) >= _OVERLAP * pull.n_samples:
            pairs.append((i, j))
    return pairs


def _energy(pulls: list[_Pull], reach: float) -> float:
    """Mean square of what each sample is off, those without a partner as much as the reach."""
    total = sum(float(np.minimum(p.offsets**2, reach**2).sum()) for p in pulls)
    missing = sum(p.n_samples - len(p.points) for p in pulls)
    return (total + missing * reach**2) / sum(p.n_samples for p in pulls)


def _noise_reach(clouds: list[_Cloud], poses: NDArray[np.float64], pairs: list[tuple[int, int]]) -> float:
    offsets = np.concatenate([p.offsets for p in _pulls(clouds, poses, pairs, _REACHES[-1])])
    if not len(offsets):
        return _REACHES[-1]
    # Partners are points, not planes: a reach below their spacing would find none.
    spacing = max(float(np.median(c.tree.query(c.few, k=2)[0][:, 1])) for c in clouds)
    return float(np.clip(_NOISE * 1.4826 * np.median(np.abs(offsets)), max(_LEAST, spacing), _REACHES[0]))


def _descended(
    clouds: list[_Cloud], poses: NDArray[np.float64], pairs: list[tuple[int, int]], reach: float
) -> NDArray[np.float64]:
    """Take Gauss-Newton steps, halved where they would not help, until nothing changes."""
    pulls = _pulls(clouds, poses, pairs, reach)
    energy = _energy(pulls, reach)
    for _ in range(_STEPS):
        step = _step(pulls, pairs, len(clouds), reach)
        for halving in range(_HALVINGS):
            trial = _moved(poses, step * 0.5**halving)
            shown = _pulls(clouds, trial, pairs, reach)
            after = _energy(shown, reach)
            if after < energy:
                break
        else:
            return poses
        gain = energy - after
        poses, pulls, energy = trial, shown, after
        if gain <= _SETTLED * energy:
            break
    return poses


def _step(pulls: list[_Pull], pairs: list[tuple[int, int]], n: int, reach: float) -> NDArray[np.float64]:
    """Solve for turns and shifts of all scans but the first, (n, 6); Tukey's weights keep far pairs from pulling."""
    normal, right = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
    for (i, j), pull in zip(pairs, pulls, strict=True):
        rows = np.hstack([np.cross(pull.points, pull.normals), pull.normals])
        weight = np.maximum(0.0, 1.0 - (pull.offsets / reach) ** 2) ** 2
        block = rows.T @ (rows * weight[:, None])
        side = rows.T @ (weight * pull.offsets)
        one, two = slice(6 * i, 6 * i + 6), slice(6 * j, 6 * j + 6)
        normal[one, one] += block
        normal[two, two] += block
        normal[one, two] -= block
        normal[two, one] -= block
        right[one] -= side
        right[two] += side
    free = slice(6, 6 * n)
    inner = normal[free, free]
    inner[np.diag_indices_from(inner)] += _DAMPING * (1.0 + np.diag(inner).max(initial=0.0))
    steps = np.zeros((n, 6))
    steps[1:] = np.linalg.solve(inner, right[free]).reshape(n - 1, 6)
    return steps


def _moved(poses: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    moves = np.tile(np.eye(4), (len(poses), 1, 1))
    moves[:, :3, :3], moves[:, :3, 3] = Rotation.from_rotvec(step[:, :3]).as_matrix(), step[:, 3:]
    return moves @ poses
