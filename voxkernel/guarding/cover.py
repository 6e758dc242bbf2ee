"""Candidates and samples in, few points that see enough of the samples out: greedy, then exchanged and moved."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import cover_gains
from voxkernel.guarding.candidates import around, in_sight_of, start_points
from voxkernel.guarding.clock import Clock
from voxkernel.guarding.sight import Sight, Spots

__all__ = ["Cover", "union_of"]

_N_SAMPLES = 4096
_N_START = 700
_N_START_LARGE, _LARGE = 450, 50_000  # where rays take longer
_N_AIMED = 48  # unseen samples that new candidates are looked for in sight of
_AIMED_KEPT = 48  # of three candidates for each, those that see the most of what is unseen
_N_NEAR = 24  # moves tried for a guard at a time
_NEAR_KEPT = 4  # of these, by a quarter of the samples
_REACH = 0.05  # their size, in diagonals
_MOST_MOVED = 12  # guards moved in one round
_ROUNDS = 3
_FINE_ROUNDS = 7  # where little is missing
_DROPS = 3  # guards tried to do without

Words = NDArray[np.uint64]
Confirm = Callable[[list[NDArray[np.float64]]], tuple[float, Spots]]


def union_of(sets: list[Words], width: int, leave_out: int = -1) -> Words:
    """Bits that are in any of the sets but one."""
    whole = np.zeros(width, np.uint64)
    for i, one in enumerate(sets):
        if i != leave_out:
            whole |= one
    return whole


def _gains(sets: Words, left: Words) -> NDArray[np.int64]:
    found = np.empty(len(sets), np.int64)
    cover_gains(np.ascontiguousarray(sets).reshape(-1), len(left), left, found)
    return found


def _count(words: Words) -> int:
    return int(np.bitwise_count(words).sum())


class Cover:
    """The search on one body: its samples, candidates, and the guards so far."""

    def __init__(
        self,
        sight: Sight,
        faces: NDArray[np.int64],
        first: NDArray[np.float64],
        given: NDArray[np.float64] | None,
        distance: float,
        rng: np.random.Generator,
        clock: Clock,
    ) -> None:
        self.sight, self.distance, self.rng, self.clock = sight, distance, rng, clock
        self.may_move = given is None
        self.faces = faces
        self.spots = sight.samples(_N_SAMPLES, rng, faces)
        self.width = -(-_N_SAMPLES // 64)
        self.candidates = first if given is None else given
        self.sets = self._seen_by(self.candidates)
        self.points: list[NDArray[np.float64]] = []
        self.seen: list[Words] = []
        self.n_needed = 0  # no fewer guards were enough when one was left out
        self.has_start = given is not None

    def _seen_by(self, points: NDArray[np.float64]) -> Words:
        """In chunks, so that a time limit is kept: what was not looked at sees nothing."""
        rows = np.zeros((len(points), self.width), np.uint64)
        for start in range(0, len(points), 32):
            if start and self.clock.is_over:
                break
            rows[start : start + 32] = self.sight.sets_seen(points[start : start + 32], self.spots)
        return rows

    @property
    def share(self) -> float:
        """Share of the samples that the guards see."""
        return _count(union_of(self.seen, self.width)) / len(self.spots)

    def sort(self) -> None:
        """Put the guard that sees the most first."""
        order = sorted(range(len(self.points)), key=lambda i: -_count(self.seen[i]))
        self.points, self.seen = [self.points[i] for i in order], [self.seen[i] for i in order]

    def run(self, coverage: float, most: int, confirm: Confirm) -> str:
        """Add guards until fresh samples confirm it, `confirm` gives their share and the unseen; say why if not."""
        need = ceil(coverage * len(self.spots))
        while True:
            while _count(union_of(self.seen, self.width)) < need:
                if len(self.points) >= most:
                    return "max_guards"
                if self.clock.is_over:
                    if not (self.has_start or len(self.candidates)):
                        self._start()
                    while len(self.points) < most and self._add(aim=False):  # the best of what is known
                        if _count(union_of(self.seen, self.width)) >= need:
                            break
                    return "time limit"
                if not self.has_start and (self.points or not self._is_enough(need)):
                    self._start()
                if not self._add():
                    return "no point sees more"
                self._improve(need)
                self.clock.tell("search", len(self.points), self.share)
            self._drop(need)
            self.clock.tell("confirm", len(self.points), self.share)
            share, unseen = confirm(self.points)
            short = coverage - share
            if short <= 0.0:
                return ""
            if need == len(self.spots):
                self._refresh(unseen)
            # What is fitted to the samples flatters: ask for more of them.
            reached = _count(union_of(self.seen, self.width))
            need = min(len(self.spots), max(need + 1, reached + ceil(0.5 * short * len(self.spots))))
            if self.may_move:
                self._improve(need, _FINE_ROUNDS, patient=True)

    def _is_enough(self, need: int) -> bool:
        """Whether one candidate sees it all, so that no others are needed."""
        return any(_count(one) >= need for one in self.sets)

    def _start(self) -> None:
        self.has_start = True
        count = _N_START if len(self.sight.faces) <= _LARGE else _N_START_LARGE
        self._propose(start_points(self.sight, self.faces, count, self.distance, self.rng))

    def _refresh(self, unseen: Spots) -> None:
        """Draw other samples, some of the unseen among them: all of these are seen, but the surface is not."""
        spots = self.sight.samples(_N_SAMPLES, self.rng, self.faces)
        count = min(len(unseen), _N_SAMPLES // 4)
        chosen = self.rng.choice(len(unseen), count, replace=False)
        rows = self.rng.choice(_N_SAMPLES, count, replace=False)
        spots.places[rows], spots.faces[rows] = unseen.places[chosen], unseen.faces[chosen]
        self.spots = spots
        self.n_needed = 0
        self.sets = self._seen_by(self.candidates)
        self.seen = list(self.sight.sets_seen(np.array(self.points), self.spots)) if self.points else []

    def _add(self, *, aim: bool = True) -> bool:
        """Take the candidate that sees the most of what is left, new ones in sight of it among them."""
        left = ~union_of(self.seen, self.width)
        if aim and self.points and self.may_move:
            self._aim(left)
        gains = _gains(self.sets, left)
        if not len(gains) or gains.max() == 0:
            return False
        best = int(gains.argmax())
        self.points.append(self.candidates[best])
        self.seen.append(self.sets[best])
        return True

    def _aim(self, left: Words) -> None:
        unseen = self._ids_of(left)
        if not len(unseen):
            return
        ids = self.rng.choice(unseen, min(len(unseen), _N_AIMED), replace=False)
        points = in_sight_of(self.sight, self.spots.some(ids), 3, self.distance, self.rng)
        self._propose(self._best_of(points, unseen, _AIMED_KEPT))

    def _ids_of(self, words: Words) -> NDArray[np.int64]:
        return np.flatnonzero(np.unpackbits(words.view(np.uint8), bitorder="little")[: len(self.spots)])

    def _best_of(self, points: NDArray[np.float64], ids: NDArray[np.int64], count: int) -> NDArray[np.float64]:
        """Keep those points that see the most of some spots."""
        if len(points) <= count:
            return points
        sums = np.bitwise_count(self.sight.sets_seen(points, self.spots.some(ids))).sum(axis=1)
        return points[np.argsort(-sums.astype(np.int64), kind="stable")[:count]]

    def _propose(self, points: NDArray[np.float64]) -> None:
        self.candidates = np.concatenate([self.candidates, points])
        self.sets = np.concatenate([self.sets, self._seen_by(points)])

    def _improve(self, need: int, rounds: int = _ROUNDS, *, patient: bool = False) -> None:
        """Exchange or move one guard at a time, where that gains samples; end where none does, unless patient."""
        for r in range(rounds):
            moved = False
            order = np.arange(len(self.points))
            if len(order) > _MOST_MOVED:
                order = self.rng.choice(order, _MOST_MOVED, replace=False)
            for i in order:
                if self.clock.is_over or _count(union_of(self.seen, self.width)) >= need:
                    return
                moved |= self._move(int(i), _REACH * 0.5**r)
            if not (moved or patient):
                return

    def _move(self, i: int, reach: float) -> bool:
        left = ~union_of(self.seen, self.width, leave_out=i)
        now = _count(self.seen[i] & left)
        gains = _gains(self.sets, left)
        best = int(gains.argmax())
        point, bits, most = self.points[i], self.seen[i], now
        if gains[best] > now:
            point, bits, most = self.candidates[best], self.sets[best], int(gains[best])
        if self.may_move:
            near = around(
                self.sight, point, reach * self.sight.diagonal, _N_NEAR, self.distance, self.rng
            )
            ids = self._ids_of(left)
            if len(near) and len(ids):
                near = self._best_of(near, ids[::4], _NEAR_KEPT)
                some = self.spots.some(ids)
                sums = np.bitwise_count(self.sight.sets_seen(near, some)).sum(axis=1)
                if int(sums.max()) > most:
                    point = near[int(sums.argmax())]
                    bits, most = self.sight.sets_seen(point[None], self.spots)[0], int(sums.max())
        if most <= now:
            return False
        self.points[i], self.seen[i] = point, bits
        return True

    def _drop(self, need: int) -> None:
        """Leave one guard out as long as the others, moved, still see enough."""
        if len(self.points) <= self.n_needed:
            return
        if self.may_move and len(self.points) > 1:
            self._aim(~union_of(self.seen, self.width))
        while len(self.points) > 1 and not self.clock.is_over:
            losses = [_count(s & ~union_of(self.seen, self.width, leave_out=i)) for i, s in enumerate(self.seen)]
            kept = list(self.points), list(self.seen)
            for i in np.argsort(losses, kind="stable")[:_DROPS].tolist():
                del self.points[i], self.seen[i]
                self._improve(need, _ROUNDS + 2)
                if _count(union_of(self.seen, self.width)) >= need:
                    break
                self.points, self.seen = list(kept[0]), list(kept[1])
            else:
                self.n_needed = len(self.points)
                return
