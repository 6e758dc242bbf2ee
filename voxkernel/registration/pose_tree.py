"""Motions between pairs of scans, some of them wrong -> poses: a tree of the best, checked by all loops."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.registration.search import inverse, rotation_angle_deg

__all__ = ["Edge", "PoseTree", "Scans", "pose_tree"]

_CLOSES_DEG = 6.0
_CLOSES_SHARE = 0.03  # of the common size: how far the middle of a scan may be off around a loop
_LOOP = 1.5  # log-odds that an edge gains where a loop through it closes; no more, because scans may be nearly the same
_MOST_LOOPS = 3
_JOINS = 2.0  # log-odds that two parts must have to be joined
_ALONE = 1.5  # and those of the best edge between them where others contradict: a thing may be like its own image
_MOST_SWAPS = 50


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Edge(Frozen):
    """A motion from one scan to another, and the log-odds that it is right."""

    source: int
    target: int
    motion: NDArray[np.float64]
    evidence: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Scans(Frozen):
    """Middles of the scans in their own coordinates, and the size that lengths are measured against."""

    middles: NDArray[np.float64]
    size: float

    def agree(self, edge: Edge, motion: NDArray[np.float64]) -> bool:
        """Whether a motion from the edge's source to its target is the edge's own."""
        middle = np.append(self.middles[edge.source], 1.0)
        off = float(np.linalg.norm((edge.motion - motion)[:3] @ middle))
        return off <= _CLOSES_SHARE * self.size and rotation_angle_deg(edge.motion, motion) <= _CLOSES_DEG


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseTree(Frozen):
    """Poses and where they come from.

    `roots[i]` is the lowest scan of the group that scan i is in, and `poses[i]` maps it into that scan's frame.
    `tree` and `loops` are edges by number: those that make the poses, and the others that agree with them.
    """

    poses: NDArray[np.float64]
    roots: NDArray[np.int64]
    tree: tuple[int, ...]
    loops: tuple[int, ...]


def pose_tree(scans: Scans, edges: list[Edge]) -> PoseTree:
    """Join scans by the edges that most others agree with; parts whose joint is not believed stay apart.

    1. An edge weighs its log-odds, and more for every loop of three through it that closes.
    2. The heaviest edges make a tree (Kruskal). An edge that contradicts it takes the place of an edge of its loop
       as long as the edges that agree with the poses then weigh more.
    3. Each edge of the tree divides its group in two. Where the edges across that agree weigh too little against those
       that contradict, the two are parted.
    """
    weights = _weights(scans, edges)
    order = sorted(range(len(edges)), key=lambda e: -weights[e])
    tree = _kruskal(len(scans.middles), edges, order)
    tree = _swapped(scans, edges, weights, order, tree)
    tree = _parted(scans, edges, weights, tree)
    poses, roots = _poses(len(scans.middles), edges, tree)
    agree = _agreeing(scans, edges, poses, roots)
    loops = tuple(e for e in range(len(edges)) if agree[e] and e not in tree)
    return PoseTree(poses, roots, tuple(sorted(tree)), loops)


def _weights(scans: Scans, edges: list[Edge]) -> NDArray[np.float64]:
    at: dict[tuple[int, int], list[int]] = defaultdict(list)
    near: dict[int, set[int]] = defaultdict(set)
    for e, edge in enumerate(edges):
        at[edge.source, edge.target].append(e)
        near[edge.source].add(edge.target)
        near[edge.target].add(edge.source)

    def between(i: int, j: int) -> list[tuple[int, NDArray[np.float64]]]:
        there = [(e, edges[e].motion) for e in at.get((i, j), ())]
        return there + [(e, inverse(edges[e].motion)) for e in at.get((j, i), ())]

    closed: dict[int, set[int]] = defaultdict(set)
    for i in sorted(near):
        for j, k in combinations(sorted(s for s in near[i] if s > i), 2):
            for a, T_ji in between(i, j):
                for b, T_kj in between(j, k):
                    for c, T_ki in between(i, k):
                        around = Edge(i, k, T_ki, 0.0)
                        if scans.agree(around, T_kj @ T_ji):
                            closed[a].add(k)
                            closed[b].add(i)
                            closed[c].add(j)
    gains = np.array([_LOOP * min(len(closed[e]), _MOST_LOOPS) for e in range(len(edges))])
    return np.array([edge.evidence for edge in edges]) + gains if edges else np.empty(0)


def _kruskal(n: int, edges: list[Edge], order: list[int]) -> set[int]:
    root = np.arange(n)
    tree: set[int] = set()
    for e in order:
        one, two = root[edges[e].source], root[edges[e].target]
        if one != two:
            root[root == max(one, two)] = min(one, two)
            tree.add(e)
    return tree


def _poses(n: int, edges: list[Edge], tree: set[int]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Follow the tree from the lowest scan of each group."""
    near: dict[int, list[tuple[int, NDArray[np.float64]]]] = defaultdict(list)
    for e in sorted(tree):
        edge = edges[e]
        near[edge.target].append((edge.source, edge.motion))
        near[edge.source].append((edge.target, inverse(edge.motion)))
    poses, roots = np.tile(np.eye(4), (n, 1, 1)), np.full(n, -1)
    for start in range(n):
        if roots[start] >= 0:
            continue
        roots[start], queue = start, [start]
        while queue:
            here = queue.pop()
            for other, T_here_other in near[here]:
                if roots[other] < 0:
                    roots[other], poses[other] = start, poses[here] @ T_here_other
                    queue.append(other)
    return poses, roots


def _agreeing(
    scans: Scans, edges: list[Edge], poses: NDArray[np.float64], roots: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which edges lie inside a group and say what its poses say."""
    answer = np.zeros(len(edges), bool)
    for e, edge in enumerate(edges):
        if roots[edge.source] == roots[edge.target]:
            answer[e] = scans.agree(edge, inverse(poses[edge.target]) @ poses[edge.source])
    return answer


def _swapped(
    scans: Scans, edges: list[Edge], weights: NDArray[np.float64], order: list[int], tree: set[int]
) -> set[int]:
    """Exchange edges of the tree for edges that contradict it, as long as more weight agrees."""

    def agreement(shown: set[int]) -> tuple[float, NDArray[np.bool_]]:
        agree = _agreeing(scans, edges, *_poses(len(scans.middles), edges, shown))
        return float(np.maximum(weights, 0.0)[agree].sum()), agree

    best, agree = agreement(tree)
    for _ in range(_MOST_SWAPS):
        better: set[int] | None = None
        for e in (e for e in order if not agree[e] and weights[e] > 0.0):
            loop = sorted((t for t in tree if _divides(edges, tree, t, e)), key=lambda t: weights[t])
            for trial in ((tree - {t}) | {e} for t in loop):
                total, shown = agreement(trial)
                if total > best * (1.0 + 1e-12):
                    best, agree, better = total, shown, trial
                    break
            if better is not None:
                break
        if better is None:
            break
        tree = better
    return tree


def _divides(edges: list[Edge], tree: set[int], cut: int, edge: int) -> bool:
    """Whether an edge leads from one side of an edge of the tree to the other."""
    side = _side(edges, tree, cut)
    return (edges[edge].source in side) != (edges[edge].target in side)


def _side(edges: list[Edge], tree: set[int], cut: int) -> set[int]:
    """Collect the scans that hang together with the source of an edge of the tree without it."""
    side, queue = {edges[cut].source}, [edges[cut].source]
    while queue:
        here = queue.pop()
        for t in tree:
            if t != cut and here in (edges[t].source, edges[t].target):
                other = edges[t].target if edges[t].source == here else edges[t].source
                if other not in side:
                    side.add(other)
                    queue.append(other)
    return side


def _parted(scans: Scans, edges: list[Edge], weights: NDArray[np.float64], tree: set[int]) -> set[int]:
    """Take out the edges of the tree whose joint is not believed, the worst first."""
    tree = set(tree)
    while tree:
        poses, roots = _poses(len(scans.middles), edges, tree)
        agree = _agreeing(scans, edges, poses, roots)
        trust = {t: _across(edges, tree, t, agree, roots) for t in sorted(tree)}
        worst = min(trust, key=lambda t: (trust[t], weights[t]))
        if trust[worst] >= _JOINS:
            break
        tree.remove(worst)
    return tree


def _across(
    edges: list[Edge], tree: set[int], cut: int, agree: NDArray[np.bool_], roots: NDArray[np.int64]
) -> float:
    """Log-odds of the joint at an edge of the tree: edges across that agree, less those that contradict."""
    side, group = _side(edges, tree, cut), roots[edges[cut].source]
    best: dict[tuple[int, int], float] = {}
    against: dict[tuple[int, int], float] = {}
    for e, edge in enumerate(edges):
        inside = roots[edge.source] == roots[edge.target] == group
        if not inside or (edge.source in side) == (edge.target in side):
            continue
        pair = min(edge.source, edge.target), max(edge.source, edge.target)
        shown = best if agree[e] else against
        shown[pair] = max(shown.get(pair, -np.inf), edge.evidence)
    if against.keys() - best.keys() and max(best.values()) < _ALONE:
        return -np.inf
    contradicted = sum(max(0.0, v) for pair, v in against.items() if pair not in best)
    return sum(best.values()) + _LOOP * (len(best) - 1) - contradicted
