"""One object of a label image: where it is seen best from, how well rays describe it, and why it falls short."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import (
    Depths,
    StarRaster,
    StopFlag,
    best_voxel,
    fill_holes,
    label_parts,
    line_counts,
    ray_lengths,
    visible_voxels,
)
from voxkernel._frozen import Frozen
from voxkernel.labels.ray_sets import RaySet
from voxkernel.labels.reasons import SEEN_WHOLE, Hidden

__all__ = ["ImageFrame", "ObjectRow", "object_row", "position_of"]

ALWAYS = 6000  # voxels of an object whose best voxel is always certified


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImageFrame(Frozen):
    """What all objects of an image have in common; always three axes, the first of length 1 for a flat image."""

    shape: tuple[int, int, int]
    spacing: tuple[float, float, float]
    is_flat: bool
    rays: tuple[RaySet, ...]
    most_steps: int


@dataclass(frozen=True, slots=True)
class ObjectRow:
    """The numbers of one object; positions have three axes and count from the corner of the image."""

    n_fragments: int
    largest_fragment: int
    n_holes: int
    hole_voxels: int
    touches_border: bool
    elongation: float
    n_seen: int
    n_seen_upper: int
    center: tuple[int, int, int]
    n_seen_deepest: int
    n_seen_centroid: int
    iou: tuple[float, ...]
    iou_stepped: tuple[float, ...]
    hidden: Hidden


def object_row(
    crop: NDArray[np.uint8], low: Sequence[int], frame: ImageFrame, stop: StopFlag | None = None
) -> ObjectRow:
    """Work on a crop with a layer of background around; `low` is the first voxel of the object's box."""
    flat, n = frame.is_flat, int(np.count_nonzero(crop))
    centroid, elongation = _moments(crop, frame, stop)
    middle = int(np.ravel_multi_index(tuple(centroid), crop.shape))
    depths = Depths(crop, flat, np.array(frame.spacing), stop)
    best, n_seen, upper, _, n_deepest, n_centroid, _ = best_voxel(
        crop, flat, depths, middle, ALWAYS, frame.most_steps, stop
    )
    del depths
    # From where all is seen, nothing is apart; and no hole: behind the voxel of a hole that is farthest along the axis
    # where it is farthest from the centre, there is a voxel of the object, and the segment to that passes the hole.
    parts = (1, n, 0, 0) if n_seen == n else label_parts(crop, flat, stop)
    center = position_of(best, crop.shape)
    behind = _behind_holes(crop, flat, center, n_seen, parts[1], stop) if parts[2] else 0
    hidden = SEEN_WHOLE
    if n_seen < n:
        hidden = Hidden(n, parts[0], n - parts[1], parts[2], parts[3], behind, parts[1] - n_seen - behind)
    offset = np.array(low) - 1
    high = [a + s - 2 for a, s in zip(low, crop.shape, strict=True)]
    touches = [a == 0 or b == m for a, b, m in zip(low, high, frame.shape, strict=True)]
    iou, stepped = _overlaps(crop, center, offset, n, frame, stop)
    first, second, third = (center + offset).tolist()
    return ObjectRow(
        *parts, any(touches[1:] if flat else touches), elongation, n_seen, upper, (first, second, third), n_deepest,
        n_centroid, iou, stepped, hidden,
    )  # fmt: skip


def position_of(voxel: int, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Position in a crop of a voxel that is given as a single number."""
    return np.array(np.unravel_index(voxel, shape), dtype=np.int64)


def _behind_holes(
    crop: NDArray[np.uint8], flat: bool, center: NDArray[np.int64], n_seen: int, largest: int, stop: StopFlag | None
) -> int:  # fmt: skip
    """Voxels of the object that the centre would see if the holes were filled, and does not.

    A fragment in a hole stays a fragment: no more is counted than what the largest fragment has.
    """
    filled, seen = np.empty_like(crop), np.empty_like(crop)
    fill_holes(crop, flat, filled, stop)
    visible_voxels(filled, flat, center, seen, stop)
    return min(int(np.count_nonzero(seen & crop)), largest) - n_seen


def _moments(crop: NDArray[np.uint8], frame: ImageFrame, stop: StopFlag | None) -> tuple[NDArray[np.int64], float]:
    """The centroid cut to integers, and the ratio of the largest to the smallest standard deviation in the world.

    Voxels count as boxes, so that a flat or a straight row of them has a thickness.
    """
    planes = {(a, b): np.empty((crop.shape[a], crop.shape[b]), np.int64) for a, b in ((0, 1), (0, 2), (1, 2))}
    line_counts(crop, frame.is_flat, planes[0, 1], planes[0, 2], planes[1, 2], stop)
    lines = [planes[0, 1].sum(1), planes[0, 1].sum(0), planes[0, 2].sum(0)]
    places = [np.arange(n, dtype=np.float64) for n in crop.shape]
    n = float(lines[0].sum())
    sums = np.array([int(line @ np.arange(len(line))) for line in lines])
    mean = sums / n
    spread = np.empty((3, 3))
    for a in range(3):
        spread[a, a] = lines[a] @ (places[a] - mean[a]) ** 2 / n + 1.0 / 12.0
        for b in range(a + 1, 3):
            spread[a, b] = (places[a] - mean[a]) @ planes[a, b] @ (places[b] - mean[b]) / n
            spread[b, a] = spread[a, b]
    spread *= np.outer(frame.spacing, frame.spacing)
    sizes = np.linalg.eigvalsh(spread[1:, 1:] if frame.is_flat else spread)
    return sums // int(n), float(np.sqrt(sizes[-1] / sizes[0]))


def _overlaps(
    crop: NDArray[np.uint8], center: NDArray[np.int64], offset: NDArray[np.int64], n: int, frame: ImageFrame,
    stop: StopFlag | None,
) -> tuple[tuple[float, ...], tuple[float, ...]]:  # fmt: skip
    """Overlap of the object with the body that rays from the centre span, for both ways to end a ray."""
    raster = StarRaster(crop, frame.is_flat)
    low, high = -offset, np.array(frame.shape, dtype=np.int64) - 1 - offset
    found: tuple[list[float], list[float]] = [], []
    for rays in frame.rays:
        lengths = np.empty(len(rays.steps))
        for is_stepped in (False, True):
            ray_lengths(crop, frame.is_flat, center, rays.steps, is_stepped, lengths, stop)
            size, common = raster.count(center, lengths[:, None] * rays.steps, rays.faces, low, high, stop)
            found[is_stepped].append(common / (n + size - common))
    return tuple(found[0]), tuple(found[1])
