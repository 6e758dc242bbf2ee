"""Facets and parts of facets that a guard provably sees as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import certify_sight
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.guarding.clock import Clock
from voxkernel.guarding.sight import Sight, Spots

__all__ = ["CertifiedParts", "Proven", "certified_parts", "middles_of"]

_SURE_DEPTH, _MAX_DEPTH = 3, 8
_PART = 1e-6  # share of the area down to which parts are cut
_AT_ONCE = 2048  # facets between two looks at the clock


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CertifiedParts(Frozen):
    """Parts of facets, each seen as a whole by a guard; no two overlap.

    Attributes
    ----------
    faces : (p,) int64
        Row of `mesh.faces` that the part belongs to.
    guards : (p,) int64
        The guard that sees it.
    depths : (p,) int64
        How often the facet was cut 1:4; 0 is a whole facet.
    weights : (p, 3, 3) int64
        Corner c of the part is the sum of ``weights[:, c, k] / 2**depth`` times corner k of the facet, exactly.
    corners : (p, 3, 3) float64
        World coordinates of the corners, rounded.
    """

    faces: NDArray[np.int64]
    guards: NDArray[np.int64]
    depths: NDArray[np.int64]
    weights: NDArray[np.int64]
    corners: NDArray[np.float64]

    def __len__(self) -> int:
        """Count the parts."""
        return len(self.faces)


class Proven(NamedTuple):
    """What is certified: parts, their share of the area, rounded down, and how many facets were not looked at."""

    parts: CertifiedParts
    share: float
    n_left: int


def certified_parts(
    sight: Sight,
    points: NDArray[np.float64],
    middles: NDArray[np.int64],
    clock: Clock | None = None,
    max_depth: int = _MAX_DEPTH,
) -> Proven:
    """Assign facets to points that see all of them; cut the others while a part is more than a millionth of the area.

    `middles` is the first point that sees the middle of each face, -1 for none: it is asked first.
    """
    n, n_faces = len(points), len(sight.faces)
    depths = np.minimum(_depths(sight.areas), max_depth)
    places = np.ascontiguousarray(points)
    n_chunks = max(4 * sight.threads, -(-n_faces // _AT_ONCE))
    chunks = np.array_split(np.arange(n_faces), min(n_chunks, n_faces))

    def work(ids: NDArray[np.int64], stop: Any) -> tuple[NDArray[Any], ...] | int:
        if clock is not None and clock.is_over:
            return len(ids)
        order = _order(middles[ids], n)
        return certify_sight(sight.tree, places, np.ascontiguousarray(ids), order, depths[ids], stop)

    found = run_parts(work, chunks, sight.threads) if n else []
    columns = [one for one in found if not isinstance(one, int)]
    n_left = sum(one for one in found if isinstance(one, int))
    if not columns:
        none = np.zeros(0, np.int64)
        parts = CertifiedParts(none, none, none, np.zeros((0, 3, 3), np.int64), np.zeros((0, 3, 3)))
        return Proven(parts, 0.0, n_left)
    faces, guards, levels, weights, corners = (np.concatenate(column) for column in zip(*columns, strict=True))
    # The areas of parts are those of facets over a power of 4. Sums of m numbers >= 0 are off by less than m roundings.
    whole = np.bincount(faces, 0.25**levels, n_faces)
    certified, total = float((whole * sight.areas).sum()), float(sight.areas.sum())
    share = 1.0 if (whole == 1.0).all() else max(0.0, certified / total * (1.0 - 4.0 * n_faces * 2.0**-53))
    parts = CertifiedParts(
        sight.face_ids[faces], guards, levels, weights.reshape(-1, 3, 3), sight.to_world(corners.reshape(-1, 3, 3))
    )
    return Proven(parts, min(share, 1.0), n_left)


def _order(middles: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Rows of the points 0 .. n - 1, the one that sees the middle first."""
    order = np.tile(np.arange(n), (len(middles), 1))
    ahead = np.flatnonzero(middles > 0)
    for i in np.unique(middles[ahead]).tolist():
        rows = ahead[middles[ahead] == i]
        order[rows, 1 : i + 1] = np.arange(i)
        order[rows, 0] = i
    return order.reshape(-1)


def _depths(areas: NDArray[np.float64]) -> NDArray[np.int64]:
    """How often each facet may be cut."""
    shares = np.maximum(areas / (_PART * areas.sum()), 1.0)
    return np.clip(np.ceil(0.5 * np.log2(shares)), _SURE_DEPTH, _MAX_DEPTH).astype(np.int64)


def middles_of(sight: Sight) -> Spots:
    """The middle of every face."""
    corners = sight.vertices[sight.faces]
    return Spots(np.ascontiguousarray(corners.mean(axis=1)), np.arange(len(sight.faces)))
