"""A label image, read in blocks -> where every object is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth
from voxkernel._core import StopFlag, label_boxes
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.labels.label_image import MOST_HELD, LabelImage, block_boxes, give_back, layers_of, pages_of, slow_axis

__all__ = ["LabelObjects", "check_crop", "check_objects", "crop_of", "crops_of", "find_objects"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LabelObjects(Frozen):
    """The objects of a label image, sorted by label.

    Attributes
    ----------
    label : (n,) int64
        Their numbers in the image, > 0.
    voxels : (n,) int64
        How many each has.
    low, high : (n, axes) int64
        The first voxel along each axis, and one behind the last.
    """

    label: NDArray[np.int64]
    voxels: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.label)


def find_objects(image: LabelImage, *, threads: int = 1) -> LabelObjects:
    """Find every object of a label image, block by block, so that the image is never held whole.

    Parameters
    ----------
    image : LabelImage
        From `read_labels` or `LabelImage.from_array`.
    threads : int
        Threads, at least 1; the result does not depend on it.

    Returns
    -------
    LabelObjects
        None where all is background.

    Raises
    ------
    ValueError
        If a label is negative, not an integer, or above 2**63 - 1, or `threads` cannot be used.

    Examples
    --------
    >>> image = LabelImage.from_array([[0, 7, 7], [0, 0, 7], [3, 0, 0]], spacing=(1, 1))
    >>> objects = find_objects(image)
    >>> objects.label.tolist(), objects.voxels.tolist(), objects.high.tolist()
    ([3, 7], [1, 3], [[3, 1], [2, 3]])
    """

    def scan(box: tuple[list[int], list[int]], stop: StopFlag) -> tuple[NDArray[np.int64], ...]:
        low, high = box
        block = image._box(low, high)
        if not block.any():
            give_back(image)
            return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 6), np.int64)
        block = block[None] if image.is_flat else block
        labels, sizes, boxes = label_boxes(block, stop)
        give_back(image)
        return labels, sizes, boxes + np.array([0, *low, 0, *low] if image.is_flat else [*low, *low])

    parts = run_parts(scan, block_boxes(image), as_depth("threads", threads, 1, 256))
    labels, sizes, boxes = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(labels, kind="stable")
    labels, sizes, boxes = labels[order], sizes[order], boxes[order]
    first = np.flatnonzero(np.diff(labels, prepend=-1))
    axes = slice(1, 3) if image.is_flat else slice(0, 3)
    if not len(first):
        empty = np.zeros((0, len(image.shape)), np.int64)
        return LabelObjects(label=labels, voxels=sizes, low=empty, high=empty)
    return LabelObjects(
        label=labels[first],
        voxels=np.add.reduceat(sizes, first),
        low=np.ascontiguousarray(np.minimum.reduceat(boxes[:, :3], first)[:, axes]),
        high=np.ascontiguousarray(np.maximum.reduceat(boxes[:, 3:], first)[:, axes]),
    )


def crop_of(image: LabelImage, objects: LabelObjects, i: int) -> NDArray[np.uint8]:
    """Cut one object out: 1 for its voxels, with a layer of 0 around; three axes also for a flat image."""
    low, high, label = objects.low[i].tolist(), objects.high[i].tolist(), objects.label[i]
    layers = layers_of(image, low, high)
    if len(layers) == 1:
        block = image._box(low, high)
        block = block[None] if image.is_flat else block
        crop = np.zeros([n + 2 for n in block.shape], np.uint8)
        np.equal(block, block.dtype.type(label), out=crop[1:-1, 1:-1, 1:-1].view(np.bool_))
        return crop
    shape = [b - a + 2 for a, b in zip(low, high, strict=True)]
    crop = np.zeros([3, *shape] if image.is_flat else shape, np.uint8)
    inner = (crop[1, 1:-1, 1:-1] if image.is_flat else crop[1:-1, 1:-1, 1:-1]).view(np.bool_)
    axis = slow_axis(image)
    for first, last in layers:
        begin, end = list(low), list(high)
        begin[axis], end[axis] = first, last
        block = image._box(begin, end)
        own = tuple(slice(a - b, c - b) for a, b, c in zip(begin, low, end, strict=True))
        np.equal(block, block.dtype.type(label), out=inner[own])
        give_back(image)
    return crop


def crops_of(image: LabelImage, objects: LabelObjects, some: Sequence[int]) -> Iterator[NDArray[np.uint8]]:
    """Cut some objects out, one after the other; what is mapped of a file is given back in between."""
    held = 0
    try:
        for i in some:
            held += pages_of(image, objects.low[i].tolist(), objects.high[i].tolist())
            yield crop_of(image, objects, i)
            if held > MOST_HELD:
                give_back(image)
                held = 0
    finally:
        if held:
            give_back(image)


def check_objects(image: LabelImage, objects: object) -> LabelObjects:
    """Refuse objects whose boxes are not in an image."""
    if not isinstance(objects, LabelObjects):
        raise TypeError(f"`objects` must be LabelObjects, from `find_objects`; got {type(objects).__name__}")
    if objects.low.shape[1] != len(image.shape) or (objects.high > np.array(image.shape)).any():
        raise ValueError(f"`objects` must be of this image; got boxes outside its shape {image.shape}")
    return objects


def check_crop(name: str, crop: NDArray[np.uint8], objects: LabelObjects, i: int) -> None:
    """Refuse an object that has another number of voxels in the image, as when that is another one or was changed."""
    n = int(np.count_nonzero(crop))
    if n != int(objects.voxels[i]):
        raise ValueError(
            f"`{name}` must be of this image; got {objects.voxels[i]} voxels of label {objects.label[i]}, which has {n}"
        )
