"""Facets and parts of facets that a guard provably sees as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import certify_sight
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.guarding.sight import Sight, Spots

__all__ = ["CertifiedParts", "certified_parts"]

MAX_DEPTH = 3


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


def certified_parts(
    sight: Sight, points: NDArray[np.float64], middles: NDArray[np.int64], max_depth: int = MAX_DEPTH
) -> tuple[CertifiedParts, float]:
    """Assign facets to points that see all of them, and sum their share of the area, rounded down.

    `middles` is the first point that sees the middle of each face, -1 for none: it is asked first.
    """
    n = len(points)
    order = np.tile(np.arange(n), (len(sight.faces), 1))
    ahead = np.flatnonzero(middles > 0)
    for i in range(1, n):
        rows = ahead[middles[ahead] == i]
        order[rows, 1 : i + 1] = np.arange(i)
        order[rows, 0] = i
    places = np.ascontiguousarray(points)
    chunks = np.array_split(np.arange(len(sight.faces)), max(1, min(4 * sight.threads, len(sight.faces))))

    def work(ids: NDArray[np.int64], stop: Any) -> tuple[NDArray[Any], ...]:
        return certify_sight(
            sight.tree, places, np.ascontiguousarray(ids), np.ascontiguousarray(order[ids].reshape(-1)), max_depth, stop
        )

    found = run_parts(work, chunks, sight.threads) if n else []
    columns = [np.concatenate(column) for column in zip(*found, strict=True)] if found else None
    if columns is None:
        none = np.zeros(0, np.int64)
        parts = CertifiedParts(none, none, none, np.zeros((0, 3, 3), np.int64), np.zeros((0, 3, 3)))
        return parts, 0.0
    faces, guards, depths, weights, corners = columns
    # The areas of parts are those of facets over a power of 4. Sums of m numbers >= 0 are off by less than m roundings.
    whole = np.bincount(faces, 0.25**depths, len(sight.faces))
    certified, total = float((whole * sight.areas).sum()), float(sight.areas.sum())
    share = 1.0 if (whole == 1.0).all() else max(0.0, certified / total * (1.0 - 4.0 * len(sight.faces) * 2.0**-53))
    parts = CertifiedParts(
        sight.face_ids[faces], guards, depths, weights.reshape(-1, 3, 3), sight.to_world(corners.reshape(-1, 3, 3))
    )
    return parts, min(share, 1.0)


def middles_of(sight: Sight) -> Spots:
    """The middle of every face."""
    corners = sight.vertices[sight.faces]
    return Spots(np.ascontiguousarray(corners.mean(axis=1)), np.arange(len(sight.faces)))
