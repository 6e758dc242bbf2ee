"""Many scans of one thing -> the pose of each in one frame: `register_together`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, read_only
from voxkernel.registration.jobs import Run, runner
from voxkernel.registration.joint_refinement import Refinement, refined_together
from voxkernel.registration.joint_result import JointRegistration, JudgedPair, Use
from voxkernel.registration.pair_evidence import Trial, tried
from voxkernel.registration.pose_tree import Edge, PoseTree, Scans, pose_tree
from voxkernel.registration.prepare import PreparedSurface
from voxkernel.registration.register import as_margins
from voxkernel.registration.register_many import prepared_or_reason
from voxkernel.registration.search import inverse, rotation_angle_deg
from voxkernel.registration.shortlist import Likeness, compared, describe, ranked_pairs, shortlist

__all__ = ["register_together"]

_Pair = tuple[int, int]


def register_together(
    surfaces: Sequence[Any],
    *,
    pairs: Literal["shortlist", "all"] = "shortlist",
    neighbors: int = 5,
    workers: int = 1,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
    margins: Sequence[float] | None = None,
) -> JointRegistration:
    """Lay many scans of one thing together, from any poses; say which belong to nothing.

    Parameters
    ----------
    surfaces : sequence of mesh, path or (vertices, faces)
        Anything `as_mesh` takes, two or more. Facets of all must be turned the same way, lengths be in one unit.
    pairs : {"shortlist", "all"}
        Register only the pairs that look alike, or all.
    neighbors : int
        How many others each scan is registered to, of those most like it, 1 to 1000; pairs that hold the whole
        together are added, and more for each scan outside the largest group.
    workers : int
        Processes, 1 to 256; 1 works in this one. The answers do not depend on it.
    client : distributed.Client, optional
        A Dask cluster that works instead.
    progress : callable, optional
        Called with the number of steps done and of all steps known so far: a surface, a comparison and a
        registration are one each.
    margins : sequence of float, optional
        As for `register`.

    Returns
    -------
    JointRegistration
        A pose for each scan, NaN for those that belong to nothing; the groups, and what became of every pair.

    Raises
    ------
    ValueError
        If there are fewer than two surfaces or an option is out of range.

    Notes
    -----
    Pairs are ordered by how many matches of local descriptors agree, and by how like their kernels are. A pair is
    first laid together by those matches; scans that this leaves outside the largest group, by all that `register`
    tries. Both are judged as by `register`, and the log-odds that a motion is right are its weight, none for one of
    several that fit as well. The heaviest edges make a tree, loops
    are closed, edges that contradict are exchanged or dropped, and parts whose joint is not believed stay apart. All
    scans of the largest group that overlap then pull at each other at once (point-to-plane, Tukey's weights); a step
    that would make the residual larger is not taken, so that the end is never worse than the tree. The order of the
    scans decides nothing but the frame.

    A surface that cannot be used has no pose, and its reason says why.

    Examples
    --------
    >>> import numpy as np
    >>> from voxkernel.demo_shapes import face
    >>> mesh = face()
    >>> middles = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
    >>> lower, upper = mesh.faces[middles < 0.4], mesh.faces[middles > -0.4]
    >>> found = register_together([(mesh.vertices, lower), (mesh.vertices + [3, 0, 1], upper)])
    >>> found.apart, np.abs(found.poses[1][:3, 3] - [-3, 0, -1]).max() < 0.01
    ((), np.True_)
    """
    if pairs not in ("shortlist", "all"):
        raise ValueError(f"`pairs` must be 'shortlist' or 'all'; got {pairs!r}")
    if len(surfaces) < 2:
        raise ValueError(f"`surfaces` must be at least two; got {len(surfaces)}")
    near = as_depth("neighbors", neighbors, 1, 1000)
    n_workers = as_depth("workers", workers, 1, 256)
    kernels = as_margins(margins)
    counter = _Counter(progress)
    with runner(n_workers, client) as run:
        ready = counter.run(run, [(prepared_or_reason, (s, kernels)) for s in surfaces])
        usable = [i for i, s in enumerate(ready) if isinstance(s, PreparedSurface)]
        # From here on in an order that does not depend on how the scans were given.
        usable.sort(key=lambda i: (len(ready[i].faces), ready[i].area))
        scans: list[PreparedSurface] = [ready[i] for i in usable]
        if len(scans) < 2:
            return _result(ready, usable, scans, 1.0, {}, {}, pose_tree(Scans(np.empty((0, 3)), 1.0), []))
        size = float(np.median([s.diagonal for s in scans]))
        middles = np.stack([s.T_world_local[:3, 3] for s in scans])
        likes = _likenesses(run, counter, scans, size)
        table = np.zeros((len(scans), len(scans)))
        for (i, j), like in likes.items():
            table[i, j] = table[j, i] = like.value
        chosen = list(combinations(range(len(scans)), 2)) if pairs == "all" else shortlist(table, near)
        trials = _tried(run, counter, scans, likes, size, chosen, fully=False)
        tree = pose_tree(Scans(middles, size), _edges(trials))
        # A second look at the scans outside the largest group: pairs left out, and kernels where matches do not do.
        left = [p for p in ranked_pairs(table) if p not in trials]
        trials |= _tried(run, counter, scans, likes, size, _outside(left, tree, near), fully=False)
        tree = pose_tree(Scans(middles, size), _edges(trials))
        unsure = [p for p in ranked_pairs(table) if p in trials and trials[p].verdict != "right"]
        again = _outside(unsure, tree, near if pairs == "shortlist" else len(scans))
        trials |= _tried(run, counter, scans, likes, size, again, fully=True)
        tree = pose_tree(Scans(middles, size), _edges(trials))
    return _result(ready, usable, scans, size, likes, trials, tree)


class _Counter:
    """Counts steps over several batches of jobs and tells how many are known."""

    def __init__(self, progress: Callable[[int, int], None] | None) -> None:
        self.progress, self.done, self.total = progress, 0, 0

    def run(self, run: Run, jobs: list[Any]) -> list[Any]:
        self.total += len(jobs)
        answers = run(jobs, self._tick, self.done)
        self.done += len(jobs)
        return answers

    def _tick(self, done: int) -> None:
        if self.progress is not None:
            self.progress(done, self.total)


def _likenesses(run: Run, counter: _Counter, scans: list[PreparedSurface], size: float) -> dict[_Pair, Likeness]:
    shown = [describe(s, size) for s in scans]
    wanted = list(combinations(range(len(scans)), 2))
    return dict(zip(wanted, counter.run(run, [(compared, (shown[i], shown[j])) for i, j in wanted]), strict=True))


def _tried(
    run: Run, counter: _Counter, scans: list[PreparedSurface], likes: dict[_Pair, Likeness], size: float,
    wanted: list[_Pair], *, fully: bool,
) -> dict[_Pair, Trial]:  # fmt: skip
    work = partial(tried, fully=fully)
    jobs = [(work, (scans[i], scans[j], likes[i, j], size)) for i, j in wanted]
    return dict(zip(wanted, counter.run(run, jobs), strict=True))


def _edges(trials: dict[_Pair, Trial]) -> list[Edge]:
    return [Edge(i, j, t.motion, t.evidence) for (i, j), t in sorted(trials.items()) if t.verdict != "no match"]


def _outside(pairs: list[_Pair], tree: PoseTree, most: int) -> list[_Pair]:
    """Choose the first pairs, at most so many for a scan, that join one outside the largest group to another group."""
    main = max(_groups(tree.roots), key=len)
    counts = dict.fromkeys(set(range(len(tree.roots))) - set(main), 0)
    found: list[_Pair] = []
    for pair in pairs:
        outside = [s for s in pair if counts.get(s, most) < most]
        if tree.roots[pair[0]] != tree.roots[pair[1]] and outside:
            found.append(pair)
            for scan in outside:
                counts[scan] += 1
    return found


def _groups(roots: NDArray[np.int64]) -> list[list[int]]:
    return [np.flatnonzero(roots == r).tolist() for r in np.unique(roots)]


def _result(
    ready: list[Any], usable: list[int], scans: list[PreparedSurface], size: float, likes: dict[_Pair, Likeness],
    trials: dict[_Pair, Trial], tree: PoseTree,
) -> JointRegistration:  # fmt: skip
    """Refine the largest group, turn everything to the order that was given and say what became of each pair."""
    n = len(ready)
    given = [sorted(usable[k] for k in group) for group in _groups(tree.roots) if len(group) > 1]
    groups = sorted(given, key=lambda g: (-len(g), g))
    place = {scan: k for k, scan in enumerate(usable)}
    poses = np.full((n, 4, 4), np.nan)
    ends = Refinement(np.empty((0, 4, 4)), float("nan"), float("nan"), ())
    reference = 0
    if groups:
        reference = groups[0][0]
        members = [place[i] for i in groups[0]]
        # In their own order too: which scan stays decides the last digits.
        members.sort()
        frame = scans[members[0]].T_world_local
        start = np.stack([inverse(frame) @ tree.poses[k] @ scans[k].T_world_local for k in members])
        start = inverse(start[0]) @ start
        ends = refined_together([scans[k] for k in members], start, size)
        world = {k: pose @ inverse(scans[k].T_world_local) for k, pose in zip(members, ends.poses, strict=True)}
        back = inverse(world[place[reference]])
        for k, pose in world.items():
            poses[usable[k]] = back @ pose
        poses[reference] = np.eye(4)
    judged = tuple(_judged(i, j, ready, place, likes, trials, tree, poses) for i, j in combinations(range(n), 2))
    apart = tuple(i for i in range(n) if not np.isfinite(poses[i]).all())
    reasons = tuple(_why_apart(i, ready, groups, judged) if i in apart else "" for i in range(n))
    return JointRegistration(
        read_only(poses), reference, tuple(map(tuple, groups)), apart, reasons, judged, ends.before, ends.after
    )


def _judged(
    i: int, j: int, ready: list[Any], place: dict[int, int], likes: dict[_Pair, Likeness],
    trials: dict[_Pair, Trial], tree: PoseTree, poses: NDArray[np.float64],
) -> JudgedPair:  # fmt: skip
    """Say what became of a pair."""
    nothing = read_only(np.full((4, 4), np.nan))
    if i not in place or j not in place:
        why = ready[i] if i not in place else ready[j]
        return JudgedPair(i, j, "not tried", why, "", float("nan"), 0.0, "", nothing)
    key = min(place[i], place[j]), max(place[i], place[j])
    like = likes[key].value if key in likes else 0.0
    trial = trials.get(key)
    if trial is None:
        return JudgedPair(i, j, "not tried", "others look more alike", "", float("nan"), like, "", nothing)
    motion = trial.motion if place[i] < place[j] else inverse(trial.motion)
    use, reason = _use_of(key, trial, trials, tree)
    if use == "contradicts" and np.isfinite(poses[[i, j]]).all():
        off = rotation_angle_deg(inverse(poses[j]) @ poses[i], motion)
        reason += f", {off:.0f} degrees away"
    return JudgedPair(
        i, j, use, reason, trial.verdict, trial.probability, like, trial.led_by, read_only(motion.copy())
    )


def _use_of(key: _Pair, trial: Trial, trials: dict[_Pair, Trial], tree: PoseTree) -> tuple[Use, str]:
    said = f"probability {trial.probability:.2f}"
    if trial.verdict == "no match":
        return "refused", f"no match ({said})" if trial.led_by else "no match: nothing to lay on each other was found"
    numbers = {k: e for e, k in enumerate(k for k in sorted(trials) if trials[k].verdict != "no match")}
    if numbers[key] in tree.tree:
        return "tree", ""
    if numbers[key] in tree.loops:
        return "loop", ""
    if tree.roots[key[0]] == tree.roots[key[1]]:
        return "contradicts", "other pairs, which weigh more, say another motion"
    if trial.verdict == "uncertain":
        return "refused", f"uncertain, and no other pair agrees: {trial.doubt or said}"
    return "refused", "right by itself, but other pairs contradict it"


def _why_apart(i: int, ready: list[Any], groups: list[list[int]], judged: tuple[JudgedPair, ...]) -> str:
    if isinstance(ready[i], str):
        return ready[i]
    for group in groups[1:]:
        if i in group:
            others = ", ".join(str(k) for k in group if k != i)
            return f"fits only {others}, a group of its own"
    tried_pairs = [p for p in judged if i in (p.source, p.target) and p.use != "not tried"]
    if not tried_pairs:
        return "there is nothing to register it to"
    best = max(tried_pairs, key=lambda p: p.probability)
    other = best.target if best.source == i else best.source
    return f"belongs to nothing: the best of {len(tried_pairs)} pairs, with {other}, is refused ({best.reason})"
