"""Statistics of a run: confusion counts, ROC curves, rank correlation, quantiles. Plain arrays in and out."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._frozen import Frozen

__all__ = ["RocCurve", "area_under", "average_ranks", "confusion_counts", "quantiles", "roc_curve", "spearman"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RocCurve(Frozen):
    """How well one score separates two classes.

    Attributes
    ----------
    false_positive_rate, true_positive_rate : (k,) float64
        From (0, 0) to (1, 1), one point per distinct score, falling threshold; both never fall.
    area : float
        Area under the curve: the share of (positive, negative) pairs in which the positive has the
        larger score, ties as one half. NaN when one class is empty.
    n_positive, n_negative : int
        Scores used; those that are NaN are left out.
    """

    false_positive_rate: NDArray[np.float64]
    true_positive_rate: NDArray[np.float64]
    area: float
    n_positive: int
    n_negative: int

    def __repr__(self) -> str:
        """Name the area and the counts."""
        return f"RocCurve(area={self.area:.4g}, n_positive={self.n_positive}, n_negative={self.n_negative})"


def roc_curve(scores: ArrayLike, positive: ArrayLike) -> RocCurve:
    """Trace the receiver operating characteristic of a score.

    Parameters
    ----------
    scores : (n,) float
        Larger means more likely positive. Infinite scores are ordinary, NaN are left out.
    positive : (n,) bool
        Which items belong to the positive class.

    Returns
    -------
    RocCurve
        Equal scores make one point: the curve crosses them by a straight line, as the area counts them.

    Raises
    ------
    ValueError
        If the two arrays differ in length.

    Notes
    -----
    O(n log n). The area is the Mann-Whitney statistic over ``n_positive * n_negative``.

    Examples
    --------
    >>> roc_curve([0.9, 0.8, 0.8, 0.1], [True, True, False, False])
    RocCurve(area=0.875, n_positive=2, n_negative=2)
    """
    values = np.asarray(scores, dtype=np.float64)
    truth = np.asarray(positive, dtype=bool)
    if values.shape != truth.shape or values.ndim != 1:
        raise ValueError(f"`positive` must have the length of `scores`; got {truth.shape} and {values.shape}")
    known = ~np.isnan(values)
    values, truth = values[known], truth[known]
    n_positive, n_negative = int(truth.sum()), int((~truth).sum())
    order = np.argsort(-values, kind="stable")
    values, truth = values[order], truth[order]
    last = np.flatnonzero(np.append(values[1:] != values[:-1], True)) if len(values) else np.empty(0, np.int64)
    hits = np.concatenate([[0], np.cumsum(truth)[last]]).astype(np.float64)
    misses = np.concatenate([[0], np.cumsum(~truth)[last]]).astype(np.float64)
    if not n_positive or not n_negative:
        ends = np.array([0.0, 1.0])
        return RocCurve(_frozen(ends), _frozen(ends.copy()), float("nan"), n_positive, n_negative)
    x, y = misses / n_negative, hits / n_positive
    # Whole numbers until the division: the area is exact up to one rounding.
    twice = float(np.sum(np.diff(misses) * (hits[1:] + hits[:-1])))
    return RocCurve(_frozen(x), _frozen(y), twice / (2.0 * n_positive * n_negative), n_positive, n_negative)


def area_under(scores: ArrayLike, positive: ArrayLike) -> float:
    """Give the area under the ROC curve alone; NaN when a class is empty."""
    return roc_curve(scores, positive).area


def average_ranks(values: ArrayLike) -> NDArray[np.float64]:
    """Rank numbers from 1; equal numbers share the mean of their ranks.

    Parameters
    ----------
    values : (n,) float
        Not NaN.

    Returns
    -------
    (n,) float64
    """
    array = np.asarray(values, dtype=np.float64)
    _, group, counts = np.unique(array, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2.0)[group.reshape(-1)]


def spearman(a: ArrayLike, b: ArrayLike) -> tuple[float, int]:
    """Correlate the ranks of two scores.

    Parameters
    ----------
    a, b : (n,) float
        Pairs in which either is NaN are left out.

    Returns
    -------
    rho : float
        In [-1, 1]; NaN for fewer than two pairs or when one score is constant.
    n : int
        Pairs used.

    Raises
    ------
    ValueError
        If the two differ in length.

    Examples
    --------
    >>> rho, n = spearman([1, 2, 3, 4], [1, 4, 9, 16])
    >>> round(rho, 12), n
    (1.0, 4)
    """
    x, y = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"`b` must have the length of `a`; got {y.shape} and {x.shape}")
    known = ~(np.isnan(x) | np.isnan(y))
    n = int(known.sum())
    if n < 2:
        return float("nan"), n
    x, y = average_ranks(x[known]), average_ranks(y[known])
    x, y = x - x.mean(), y - y.mean()
    spread = float(np.sqrt(np.dot(x, x) * np.dot(y, y)))
    return (float(np.clip(np.dot(x, y) / spread, -1.0, 1.0)) if spread else float("nan")), n


def confusion_counts(
    truths: Sequence[Hashable], answers: Sequence[Hashable], rows: Sequence[Hashable], columns: Sequence[Hashable]
) -> NDArray[np.int64]:
    """Count how often each answer was given to each truth.

    Parameters
    ----------
    truths, answers : sequence, n items each
        Pairs with a truth not in `rows` or an answer not in `columns` are not counted.
    rows, columns : sequence
        The truths and answers to count, without repetition.

    Returns
    -------
    (len(rows), len(columns)) int64
        Empty input gives zeros.

    Raises
    ------
    ValueError
        If `truths` and `answers` differ in length.

    Examples
    --------
    >>> confusion_counts(["a", "a", "b"], [1, 2, 2], ["a", "b"], [1, 2]).tolist()
    [[1, 1], [0, 1]]
    """
    if len(truths) != len(answers):
        raise ValueError(f"`answers` must have the length of `truths`; got {len(answers)} and {len(truths)}")
    row_of = {name: i for i, name in enumerate(rows)}
    column_of = {name: i for i, name in enumerate(columns)}
    counts = np.zeros((len(rows), len(columns)), dtype=np.int64)
    for truth, answer in zip(truths, answers, strict=True):
        if truth in row_of and answer in column_of:
            counts[row_of[truth], column_of[answer]] += 1
    return counts


def quantiles(values: ArrayLike, shares: Sequence[float]) -> list[float]:
    """Give quantiles by linear interpolation; NaN values are left out, and NaN is given where none is left."""
    array = np.asarray(values, dtype=np.float64)
    array = array[~np.isnan(array)]
    if not len(array):
        return [float("nan")] * len(shares)
    return [float(q) for q in np.quantile(array, list(shares))]


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.setflags(write=False)
    return array
