"""How many guards are needed at least, anywhere inside: cells of space, a covering program, integers."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import find_cover, maximal_sets
from voxkernel.guarding.clock import Clock
from voxkernel.guarding.outside import OutsideGrid, outside_grid
from voxkernel.guarding.result import GuardBound
from voxkernel.guarding.sight import Sight, Spots

__all__ = ["Cells", "guard_bound", "proven_share"]

_N_SAMPLES = 700
_ERROR = 1e-3
_GRID = 64
_FIRST = 8  # cells along the longest side
_ROUNDS = 150
_AT_ONCE = 32  # cells cut where nothing says which, those that see the most
_MOST_CELLS = 2400
_GROWTH = 1.5
_STEPS = 4_000_000  # of the search for a cover by cells
_PROGRAM_SECONDS = 60.0  # of one program; it takes about one, so that the bound does not depend on the machine
_UNITS = 1 << 30
_NO_TIME = "the time limit is over"


class Cells:
    """Cubes that together hold every point inside, and the samples that a point of each may see: supersets."""

    def __init__(self, sight: Sight, grid: OutsideGrid, spots: Spots, clock: Clock) -> None:
        self.sight, self.grid, self.spots, self.clock = sight, grid, spots, clock
        half = 0.5 * float((sight.high - sight.low).max()) / _FIRST * (1.0 + 1e-9) + grid.slack
        axes = [np.arange(a + half, b + half, 2.0 * half) for a, b in zip(sight.low, sight.high, strict=True)]
        centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        halves = np.full(len(centers), half)
        nobody = np.full(len(centers), -1)
        sets = grid.may_see(sight, centers, halves, nobody, np.zeros((1, len(spots)), np.bool_), spots, clock)
        seeing = sets.any(axis=1)
        self.centers, self.halves, self.sets = centers[seeing], halves[seeing], sets[seeing]

    def __len__(self) -> int:
        """Count the cells."""
        return len(self.centers)

    def split(self, ids: NDArray[np.int64]) -> None:
        """Cut some cells into eight, which see less."""
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        centers = (self.centers[ids, None] + signs * self.halves[ids, None, None]).reshape(-1, 3)
        # A little larger than a half: together they hold the whole for certain.
        halves = np.repeat(0.5 * self.halves[ids] * (1.0 + 1e-9) + self.grid.slack, 8)
        sets = self.grid.may_see(self.sight, centers, halves, np.repeat(ids, 8), self.sets, self.spots, self.clock)
        kept = np.ones(len(self), np.bool_)
        kept[ids] = False
        seeing = sets.any(axis=1)
        self.centers = np.concatenate([self.centers[kept], centers[seeing]])
        self.halves = np.concatenate([self.halves[kept], halves[seeing]])
        self.sets = np.concatenate([self.sets[kept], sets[seeing]])

    def maximal(self) -> NDArray[np.int64]:
        """Cells whose sets are not within that of another one."""
        words = _packed(self.sets)
        return np.asarray(maximal_sets(words.reshape(-1), words.shape[1]))


def guard_bound(
    sight: Sight, coverage: float, rng: np.random.Generator, clock: Clock, n_found: int = 1 << 30
) -> GuardBound:
    """Bound the number of guards that see `coverage` of the area; stop where it meets the number found.

    A cell of space sees a superset of what any point of it sees. Weights w of the samples with a sum of at most 1 over
    the set of each cell prove that any guards number at least the sum of w over what they see, whose least value is
    that of the smallest weights. A linear program finds weights; integers prove it. No guards of an area share of
    `coverage`, fixed before the samples were drawn, see fewer than `n_needed` of them but with `error_probability`.
    """
    need, error = _needed(coverage)
    if n_found == 1 or clock.is_over:
        reason = "" if n_found == 1 else _NO_TIME
        return GuardBound(1, 0.0, 1, coverage, _N_SAMPLES, need, 0.0, 0, reason)
    spots = sight.samples(_N_SAMPLES, rng)
    cells = Cells(sight, outside_grid(sight, _GRID, clock), spots, clock)
    least, linear, reason, n_before = 1, 0.0, "", 0
    for _ in range(_ROUNDS):
        rows = cells.maximal()
        used = np.zeros(0, np.int64)
        if len(cells) > _GROWTH * n_before:  # programs take most of the time
            n_before = len(cells)
            share, used = _program(cells.sets[rows], need, min(_PROGRAM_SECONDS, clock.left))
            linear = max(linear, share)
            least = max(least, ceil(share))
        clock.tell("bound")
        if least >= n_found:
            break
        chosen = rows[used]
        cover = _cover_of(cells.sets[rows], least, need)
        if cover is None:
            reason = "whether so many cells are enough was left open"
            if not len(used):
                chosen = rows[:_AT_ONCE]
        elif not len(cover):
            least += 1  # no cells of this number are enough, so no points are
            continue
        else:
            chosen = np.union1d(chosen, rows[cover])
        if clock.is_over:
            reason = _NO_TIME
            break
        room = (_MOST_CELLS - len(cells)) // 7
        small = cells.halves[chosen] < 2e-3 * sight.diagonal
        chosen = chosen[~small]
        if room < 1 or not len(chosen):
            reason = "more cells are needed than allowed" if room < 1 else "the cells are small already"
            break
        cells.split(chosen[np.argsort(-cells.halves[chosen], kind="stable")][:room])
    rows = cells.maximal()
    if len(cells) > n_before and least < n_found:
        linear = max(linear, _program(cells.sets[rows], need, min(_PROGRAM_SECONDS, max(0.1, clock.left)))[0])
        least = max(least, ceil(linear))
    every = _program(cells.sets[rows], len(spots), min(_PROGRAM_SECONDS, max(0.1, clock.left)))[0]
    return GuardBound(
        at_least=least, error_probability=error if least > 1 else 0.0, at_least_for_samples=max(least, ceil(every)),
        coverage=coverage, n_samples=len(spots), n_needed=need, linear=linear, n_cells=len(cells),
        reason="" if least >= n_found else reason or "more rounds are needed than allowed",
    )  # fmt: skip


def proven_share(sets: NDArray[np.bool_], need: int, weights: NDArray[np.int64]) -> float:
    """Give the number of sets that weights >= 0 prove to be needed for `need` elements, rounded down."""
    most = int((sets.astype(np.int64) @ weights).max())
    least = int(np.sort(weights)[:need].sum())
    return 0.0 if most <= 0 else float(np.nextafter(least / most, -np.inf)) if least % most else float(least // most)


def _needed(coverage: float) -> tuple[int, float]:
    """So many samples are seen by whoever sees `coverage`, but with a probability of at most the second number."""
    from scipy.special import bdtr

    need = ceil(coverage * _N_SAMPLES)
    if coverage == 1.0:
        return need, 0.0
    while need > 0 and float(bdtr(need - 1, _N_SAMPLES, coverage)) > _ERROR:
        need -= 1
    return need, float(bdtr(need - 1, _N_SAMPLES, coverage)) if need else 0.0


def _program(sets: NDArray[np.bool_], need: int, seconds: float) -> tuple[float, NDArray[np.int64]]:
    """Solve the covering program by HiGHS; its dual is the proof, checked in integers. Also the cells it uses."""
    from scipy.optimize import linprog
    from scipy.sparse import csr_matrix, eye, hstack, vstack

    m, n = sets.shape
    cover = hstack([csr_matrix(-sets.T.astype(np.float64)), eye(n)])
    enough = csr_matrix(np.r_[np.zeros(m), -np.ones(n)][None])
    done = linprog(
        np.r_[np.ones(m), np.zeros(n)], A_ub=vstack([cover, enough]).tocsr(), b_ub=np.r_[np.zeros(n), -float(need)],
        bounds=[(0, None)] * m + [(0, 1)] * n, method="highs", options={"time_limit": max(0.1, seconds)},
    )  # fmt: skip
    if done.x is None or done.status != 0:
        weights = np.ones(n)
        used = np.argsort(-sets.sum(axis=1), kind="stable")[:8]
    else:
        weights = np.maximum(0.0, -done.ineqlin.marginals[:n])
        used = np.flatnonzero(done.x[:m] > 1e-6)
    top = float(weights.max())
    whole = np.rint(weights / top * _UNITS).astype(np.int64) if top > 0.0 else np.ones(n, np.int64)
    return max(proven_share(sets, need, whole), proven_share(sets, need, np.ones(n, np.int64))), used


def _packed(sets: NDArray[np.bool_]) -> NDArray[np.uint64]:
    width = -(-sets.shape[1] // 64)
    padded = np.zeros((len(sets), 64 * width), np.bool_)
    padded[:, : sets.shape[1]] = sets
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


def _cover_of(sets: NDArray[np.bool_], count: int, need: int) -> NDArray[np.int64] | None:
    """Rows of `count` sets that hold enough, none where there are none, None where that is open."""
    words = _packed(sets)
    found = find_cover(np.ascontiguousarray(words).reshape(-1), words.shape[1], count, need, _STEPS)
    return None if len(found) == 1 and found[0] < 0 else np.asarray(found)
