"""ICP from triangles to triangles, both ways, with a robust loss: the motion that a pair is refined by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.side import Side

__all__ = ["LAST_STEP", "Pairs", "Polished", "pairs_of", "polished"]

_FACING = 0.5  # cosine between the normals of a pair that counts
_SIGMAS = 3.5
LAST_STEP = 2e-5  # below which a motion rests
_OF_ERROR = 0.1  # a step below this share of the standard error of the motion says no more than noise does
_MOST_OF_ERROR = 2e-4
_FEWEST = 10
_NO_ERRORS = np.zeros(6)


class Pairs(NamedTuple):
    """Points of the source after the motion, their partners, the normals between them and the area they stand for."""

    moved: NDArray[np.float64]
    partners: NDArray[np.float64]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]


class Polished(NamedTuple):
    """A motion (or similarity) after ICP, the last step it took, the reach it ended with, its pairs, standard errors.

    The errors are those of three turns, three shifts and, where it was asked for, the logarithm of the scale.
    """

    transform: NDArray[np.float64]
    step: float
    reach: float
    n_pairs: int
    errors: NDArray[np.float64] = _NO_ERRORS

    def rests(self, step: float = LAST_STEP) -> bool:
        """Whether the last step is small by itself, or beside what noise leaves unknown of the motion."""
        return self.step < max(step, min(_OF_ERROR * float(self.errors.max()), _MOST_OF_ERROR))


def pairs_of(source: Side, target: Side, motion: NDArray[np.float64], reach: float) -> Pairs:
    """Pair the samples of each surface with the other one, where they face the same way and neither one ends."""
    size = float(np.cbrt(np.linalg.det(motion[:3, :3])))
    turn = motion[:3, :3] / size
    moved = source.points @ motion[:3, :3].T + motion[:3, 3]
    there = target.nearest(moved)
    normals = source.normals @ turn.T
    good = (there.distances < reach) & ~there.on_rim & (np.einsum("ij,ij->i", normals, there.normals) > _FACING)
    back = (target.points - motion[:3, 3]) @ turn / size
    here = source.nearest(back)
    turned = here.normals @ turn.T
    well = (here.distances * size < reach) & ~here.on_rim & (np.einsum("ij,ij->i", turned, target.normals) > _FACING)
    both = np.concatenate([(normals + there.normals)[good], (turned + target.normals)[well]])
    both /= np.linalg.norm(both, axis=1, keepdims=True)
    return Pairs(
        np.concatenate([moved[good], here.spots[well] @ motion[:3, :3].T + motion[:3, 3]]),
        np.concatenate([there.spots[good], target.points[well]]),
        both,
        np.concatenate([source.areas[good] * size**2, target.areas[well]]),
    )


def polished(
    source: Side, target: Side, start: NDArray[np.float64], *, reach: float, least: float, steps: int,
    with_scale: bool = False, rests: float = LAST_STEP,
) -> Polished:  # fmt: skip
    """Repeat: pair, weigh by Tukey's loss whose width follows the noise, solve; until the motion rests.

    The width only shrinks, from `reach` down to what the median of the offsets tells, never below `least`.
    """
    found = Polished(start.copy(), np.inf, reach, 0)
    for _ in range(steps):
        pairs = pairs_of(source, target, found.transform, reach)
        count = len(pairs.moved)
        if count < _FEWEST:
            return Polished(found.transform, np.inf, reach, count)
        offsets = np.einsum("ij,ij->i", pairs.partners - pairs.moved, pairs.normals)
        width = max(least, min(reach, _SIGMAS * 1.4826 * float(np.median(np.abs(offsets)))))
        shrinks = width < 0.9 * reach
        reach = max(width, 0.6 * reach)
        weights = pairs.areas * np.where(np.abs(offsets) < width, (1.0 - (offsets / width) ** 2) ** 2, 0.0)
        solved = _solved(pairs, offsets, weights, with_scale)
        if solved is None:
            return Polished(found.transform, np.inf, reach, count)
        change, errors = solved
        step = float(np.abs(change - np.eye(4)).max())
        found = Polished(change @ found.transform, step, reach, count, errors)
        if found.rests(rests) and not shrinks:
            break
    return found


def _solved(
    pairs: Pairs, offsets: NDArray[np.float64], weights: NDArray[np.float64], with_scale: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Solve for the small motion that takes the points along the normals to their partners; with standard errors [1]_.

    .. [1] H. White, "A heteroskedasticity-consistent covariance matrix estimator", Econometrica 1980.
    """
    from scipy.spatial.transform import Rotation

    total = weights.sum()
    if not total > 0:
        return None
    center = weights @ pairs.moved / total
    arms = pairs.moved - center
    columns = [np.cross(arms, pairs.normals), pairs.normals]
    if with_scale:
        columns.append(np.einsum("ij,ij->i", arms, pairs.normals)[:, None])
    rows = np.hstack(columns)
    matrix = (rows * weights[:, None]).T @ rows
    spread = np.sqrt(np.diag(matrix))
    if not (np.isfinite(matrix).all() and (spread > 0).all()):
        spread = np.where(spread > 0, spread, 1.0)
    normed = matrix / np.outer(spread, spread) + 1e-9 * np.eye(len(matrix))
    pull = rows * (weights * offsets)[:, None]
    solution = np.linalg.solve(normed, np.column_stack([pull.sum(axis=0) / spread, np.diag(1.0 / spread)]))
    answer, back = solution[:, 0] / spread, solution[:, 1:] / spread[:, None]
    if not np.isfinite(answer).all():
        return None
    errors = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", back, pull.T @ pull, back), 0.0))
    size = float(np.exp(np.clip(answer[6], -0.2, 0.2))) if with_scale else 1.0
    length = float(np.linalg.norm(answer[:3]))
    turn = Rotation.from_rotvec(answer[:3] * min(1.0, 0.5 / max(length, 1e-300))).as_matrix() * size
    change = np.eye(4)
    change[:3, :3] = turn
    change[:3, 3] = center + answer[3:6] - turn @ center
    return change, errors
