"""A label image -> one row per object: `label_stars`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_integers
from voxkernel._core import StopFlag
from voxkernel._threads import run_parts
from voxkernel.labels.image_files import read_labels
from voxkernel.labels.label_image import LabelImage, as_spacing
from voxkernel.labels.label_surface import SurfaceRow, surface_row
from voxkernel.labels.label_table import LabelStars
from voxkernel.labels.objects import LabelObjects, check_crop, check_objects, crops_of, find_objects
from voxkernel.labels.one_object import ImageFrame, ObjectRow, object_row
from voxkernel.labels.ray_sets import ray_set
from voxkernel.labels.reasons import rays_needed, reason_of

__all__ = ["as_image", "as_ray_counts", "frame_of", "label_stars", "stars_of"]

_PART = 64  # objects that a thread takes at once


def label_stars(
    labels: Any,
    *,
    spacing: Sequence[float] | None = None,
    n_rays: Sequence[int] = (32, 64, 96, 128, 256),
    surface: bool = False,
    ids: Sequence[int] | None = None,
    threads: int = 1,
    most_steps: int = 200_000_000,
    objects: LabelObjects | None = None,
) -> LabelStars:
    """Tell of every object of a label image whether it is star-convex, from where, and what it would take.

    Parameters
    ----------
    labels : LabelImage, array of int with 2 or 3 axes, or a path
        0 is background. Floats with integer values are taken; a path is read by `read_labels`.
    spacing : sequence of float, optional
        Distance of voxel centres along each axis, in the order of the axes, world units, > 0. Needed for an array, and
        for a file that stores none.
    n_rays : sequence of int
        Numbers of rays to try, 4 to 4096 (from 3 for two axes), evenly spread in the world.
    surface : bool
        Also make a smoothed surface of each object of three axes and measure that (`starshapeness`).
    ids : sequence of int, optional
        Labels to look at; all by default.
    threads : int
        Threads, at least 1; the result does not depend on it.
    most_steps : int
        Steps that may be taken to certify the best voxel of an object of more than 6,000 voxels, >= 0; 200 million take
        one to two seconds. Smaller objects are always certified.
    objects : LabelObjects, optional
        What `find_objects` has found in this image, to look at some of its objects at a time.

    Returns
    -------
    LabelStars
        One row per object, sorted by label.

    Raises
    ------
    TypeError, ValueError, VoxKernelError
        If the image cannot be used, or a label of `ids` is not in it.

    Notes
    -----
    A segment between two voxel centres touches the voxels whose open cube it meets; through an edge or a corner it
    goes on diagonally. V(x) is the share of an object's voxels whose segment to voxel x touches only voxels of the
    object: Werghi's Star(x, S), Definition 2, in voxels. The segment rule is evaluated in integers. It does not depend
    on the spacing. The maximum V* is found by a race of tiles of 256 voxels, a bit for each: from all of them the
    segments by one offset touch a tile that moves by the same steps. Probes of a part of the segments bound what is
    hidden from each voxel, then of all, then more probes; where less is hidden than from the best so far, voxels are
    gathered in new tiles in between, and in the end whole segments are walked along, unless what is seen nearer to the
    tile decides. Where few voxels are hidden from the best so far, these are looked from instead, as sight is mutual:
    a voxel that few of them see is out. Objects too large for that are cut into blocks: what is hidden from the
    middle of a block in the object, widened by half the block, is hidden from the whole block.

    Examples
    --------
    >>> image = np.zeros((5, 9, 9), dtype=np.uint8)
    >>> image[1:4, 1:8, 1:8] = 1  # a slab
    >>> image[1:4, 3:8, 3:6] = 2  # cut into a U
    >>> stars = label_stars(image, spacing=(2, 1, 1))
    >>> stars.label.tolist(), stars.voxels.tolist(), stars.visible.round(3).tolist(), stars.reason[0]
    ([1, 2], [102, 45], [0.735, 1.0], 'hidden part')
    """
    if not isinstance(surface, bool | np.bool_):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"`surface` must be True or False; got {type(surface).__name__}")
    image = as_image(labels, spacing)
    counts = as_ray_counts(n_rays, len(image.shape))
    n_threads = as_depth("threads", threads, 1, 256)
    frame = frame_of(image, counts, as_depth("most_steps", most_steps, 0, 2**62))
    found = find_objects(image, threads=n_threads) if objects is None else check_objects(image, objects)
    chosen = np.arange(len(found)) if ids is None else _chosen(found, ids)
    return stars_of(image, found, chosen, frame, counts, surface=bool(surface), threads=n_threads)


def as_image(labels: Any, spacing: Sequence[float] | None) -> LabelImage:
    """Any label image; a spacing that is given counts more than one that a file stores."""
    if isinstance(labels, str | os.PathLike):
        return read_labels(labels, spacing=spacing)
    if isinstance(labels, LabelImage):
        return labels if spacing is None else replace(labels, spacing=as_spacing(spacing, len(labels.shape)))
    if spacing is None:
        raise ValueError("`spacing` must be given for an array, one number for each axis; got None")
    return LabelImage.from_array(labels, spacing=spacing)


def as_ray_counts(n_rays: Sequence[int], n_axes: int) -> tuple[int, ...]:
    """Numbers of rays, each once, growing."""
    fewest = 4 if n_axes == 3 else 3
    try:
        counts = sorted({as_depth("n_rays", n, fewest, 4096) for n in n_rays})
    except TypeError:
        raise TypeError(f"`n_rays` must be a sequence of integers; got {n_rays!r}") from None
    if not counts:
        raise ValueError("`n_rays` must hold at least one number; got none")
    return tuple(counts)


def frame_of(image: LabelImage, counts: tuple[int, ...], most_steps: int) -> ImageFrame:
    """What all objects have in common."""
    shape, spacing = ((1, *image.shape), (1.0, *image.spacing)) if image.is_flat else (image.shape, image.spacing)
    rays = tuple(ray_set(n, image.spacing) for n in counts)
    return ImageFrame(shape, spacing, image.is_flat, rays, most_steps)  # pyright: ignore[reportArgumentType]


def stars_of(
    image: LabelImage, objects: LabelObjects, chosen: NDArray[np.int64], frame: ImageFrame, counts: tuple[int, ...], *,
    surface: bool, threads: int,
) -> LabelStars:  # fmt: skip
    """Work on the chosen objects, in the order of their place, so that a chunk of a file is unpacked once."""
    places = objects.low[chosen] // np.array(image.chunks)
    order = chosen[np.lexsort(places.T[::-1])]
    rows: dict[int, tuple[ObjectRow, SurfaceRow]] = {}
    none = SurfaceRow()

    def work(first: int, stop: StopFlag) -> None:
        some = order[first : first + _PART].tolist()
        for i, crop in zip(some, crops_of(image, objects, some), strict=True):
            low = objects.low[i].tolist()
            check_crop("objects", crop, objects, i)
            row = object_row(crop, [0, *low] if image.is_flat else low, frame, stop)
            rows[i] = row, surface_row(crop, frame.spacing) if surface and not image.is_flat else none

    run_parts(work, range(0, len(order), _PART), threads)
    return _table([rows[i] for i in chosen.tolist()], image, objects, chosen, counts)


def _table(
    rows: list[tuple[ObjectRow, SurfaceRow]], image: LabelImage, objects: LabelObjects, chosen: NDArray[np.int64],
    counts: tuple[int, ...],
) -> LabelStars:  # fmt: skip
    n, axes = len(rows), len(image.shape)
    voxels = objects.voxels[chosen]
    parts = np.array(
        [(r.n_fragments, r.largest_fragment, r.n_holes, r.hole_voxels) for r, _ in rows], dtype=np.int64
    ).reshape(n, 4)
    seen = np.array(
        [(r.n_seen, r.n_seen_upper, r.n_seen_deepest, r.n_seen_centroid) for r, _ in rows], dtype=np.float64
    ).reshape(n, 4)
    seen /= voxels[:, None]
    center = np.array([r.center for r, _ in rows], dtype=np.int64).reshape(n, 3)[:, 3 - axes :]
    needed = np.array([rays_needed(counts, r.iou) for r, _ in rows], dtype=np.int64).reshape(n, 2)
    reasons = [reason_of(r.hidden, r.elongation, counts, r.iou) for r, _ in rows]
    numbers = np.array([(s.defect_lower, s.defect_upper, s.kernel_ratio) for _, s in rows]).reshape(n, 3)
    return LabelStars(
        label=objects.label[chosen], voxels=voxels, low=objects.low[chosen], high=objects.high[chosen],
        fragments=parts[:, 0], largest_fragment=parts[:, 1], holes=parts[:, 2], hole_voxels=parts[:, 3],
        touches_border=np.array([r.touches_border for r, _ in rows], dtype=np.bool_),
        elongation=np.array([r.elongation for r, _ in rows], dtype=np.float64),
        visible=seen[:, 0], visible_upper=seen[:, 1], center=center,
        center_world=center.astype(np.float64) * np.array(image.spacing),
        visible_deepest=seen[:, 2], visible_centroid=seen[:, 3], n_rays=counts,
        iou=np.array([r.iou for r, _ in rows], dtype=np.float64).reshape(n, len(counts)),
        iou_stepped=np.array([r.iou_stepped for r, _ in rows], dtype=np.float64).reshape(n, len(counts)),
        rays_for_80=needed[:, 0], rays_for_90=needed[:, 1],
        reason=tuple(word for word, _ in reasons), detail=tuple(text for _, text in reasons),
        defect_lower=numbers[:, 0], defect_upper=numbers[:, 1], kernel_ratio=numbers[:, 2],
        verdict=tuple(s.verdict for _, s in rows), spacing=image.spacing,
    )  # fmt: skip


def _chosen(objects: LabelObjects, ids: Sequence[int]) -> NDArray[np.int64]:
    """Rows of the labels asked for, each once, sorted."""
    wanted = np.unique(as_integers("ids", ids, shape="(n,)", ndim=1))
    at = np.searchsorted(objects.label, wanted)
    missing = wanted[(at == len(objects)) | (objects.label[np.minimum(at, len(objects) - 1)] != wanted)] if len(
        objects
    ) else wanted
    if len(missing):
        raise ValueError(f"`ids` must be labels of the image; got {missing[0]}, which it does not have")
    return at
