"""ICP on the samples of two surfaces, how well the result holds them, and how well they fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.registration.icp import IcpEnd, Refine, icp
from voxkernel.registration.search import ScoredCloud

__all__ = ["Refined", "refined", "slack_of"]

# Shares of the diagonal.
_FAR = 1 / 17
_NEAR = 1 / 60
_CHANGE = 1e-6
_NEARLY_EXACT = 2e-3
_EXACT = 1e-9
_STEPS = 60
_SIGMAS = 4.0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Refined(Frozen):
    """A motion after ICP, and whether one more step would leave its RMSE as it is."""

    transform: NDArray[np.float64]
    settled: bool
    n_pairs: int


def refined(source: ScoredCloud, target: ScoredCloud, start: NDArray[np.float64], method: Refine) -> Refined:
    """Run ICP with a wide reach, then with one that fits the noise, until it stays where it is."""
    wide = icp(source.cloud, target.cloud, start, _FAR, method, steps=_STEPS, change=_CHANGE)
    reach = _reach_of(source, target, wide.transform)
    found = icp(source.cloud, target.cloud, wide.transform, reach, method, steps=2 * _STEPS, change=0.1 * _CHANGE)
    found = _of_copies(source, target, found) or found
    if not np.isfinite(found.transform).all():
        return Refined(start, False, 0)
    after = icp(source.cloud, target.cloud, found.transform, reach, method, steps=1, change=1e-15)
    rests = found.rmse < _EXACT or abs(after.rmse - found.rmse) < _CHANGE
    return Refined(found.transform, rests and found.n_pairs >= 3, found.n_pairs)


def _of_copies(source: ScoredCloud, target: ScoredCloud, found: IcpEnd) -> IcpEnd | None:
    """Lay the vertices of copies of one surface on each other to the last digits; None where they are none."""
    few = min(source.n_vertices, target.n_vertices)
    if few < 3 or len(source.pairs(target, found.transform, _NEARLY_EXACT)[0]) < 0.5 * few:
        return None
    one, two = (c.cloud.select_by_index(range(c.n_vertices)) for c in (source, target))
    end = icp(one, two, found.transform, _NEARLY_EXACT, "point_to_point", steps=10, change=1e-15)
    return end if end.n_pairs >= 0.5 * few and end.rmse < _EXACT else None


def _reach_of(source: ScoredCloud, target: ScoredCloud, transform: NDArray[np.float64]) -> float:
    """Choose how far apart pairs may be: four standard deviations of the noise, as a median tells it."""
    moved, _, nearest, _ = source.pairs(target, transform, _FAR)
    if not len(moved):
        return _FAR
    offsets = moved - target.points[nearest]
    residuals = np.abs(np.einsum("ij,ij->i", offsets, target.normals[nearest]))
    return float(np.clip(_SIGMAS * 1.4826 * np.median(residuals), _NEAR, _FAR))


def slack_of(source: ScoredCloud, target: ScoredCloud, transform: NDArray[np.float64]) -> NDArray[np.float64]:
    """How firmly the surfaces hold each other: six eigenvalues, ascending, 0 for a motion that slides freely.

    Of the mean of (p x n, n)(p x n, n)^T over pairs that face each other, lengths scaled so that rotations
    and shifts compare [1]_.

    .. [1] N. Gelfand et al., "Geometrically stable sampling for the ICP algorithm", 3DIM 2003.
    """
    moved, _, nearest, _ = source.pairs(target, transform, _FAR)
    if len(moved) < 6:
        return np.zeros(6)
    normals = target.normals[nearest]
    arms = moved - moved.mean(axis=0)
    arms /= np.sqrt((arms**2).sum(axis=1).mean()) or 1.0
    rows = np.hstack([np.cross(arms, normals), normals])
    return np.asarray(np.linalg.eigvalsh(rows.T @ rows / len(rows)), dtype=np.float64)
