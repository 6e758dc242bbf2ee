"""Answers painted back into the image: what the best centre sees, and a number of every object in its voxels."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_choice
from voxkernel._core import visible_voxels
from voxkernel.labels.label_image import LabelImage
from voxkernel.labels.label_stars import as_image
from voxkernel.labels.label_table import LabelStars
from voxkernel.labels.objects import LabelObjects, check_crop, crops_of

__all__ = ["paint_labels", "paint_seen", "seen_from"]

HIDDEN, SEEN, CENTER = 1, 2, 3


def paint_labels(
    labels: Any, stars: LabelStars, *, what: str = "seen", spacing: Sequence[float] | None = None
) -> NDArray[Any]:
    """Paint the answers of `label_stars` into an image of the same shape, to be laid over it.

    Parameters
    ----------
    labels : LabelImage, array of int with 2 or 3 axes, or a path
        As given to `label_stars`.
    stars : LabelStars
        Its result; objects that are not in it stay 0.
    what : {"seen", "visible"}
        "seen": 1 for voxels that are hidden from the best voxel of their object, 2 for those it sees, 3 for itself,
        uint8. "visible": V* in all voxels of an object, float32.
    spacing : sequence of float, optional
        As for `label_stars`; the answer does not depend on it.

    Returns
    -------
    array of uint8 or float32
        In the shape of the image; 0 for background. `write_labels` writes it.

    Raises
    ------
    TypeError, ValueError, VoxKernelError
        If the image cannot be used, or is not the one that `stars` was made of.

    Examples
    --------
    >>> from voxkernel import label_stars
    >>> image = np.array([[1, 1, 1], [1, 0, 0], [1, 0, 2]], dtype=np.uint8)
    >>> paint_labels(image, label_stars(image, spacing=(1, 1)), spacing=(1, 1)).tolist()
    [[3, 2, 2], [2, 0, 0], [2, 0, 3]]
    """
    as_choice("what", what, ("seen", "visible"))
    if not isinstance(stars, LabelStars):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"`stars` must be LabelStars, from `label_stars`; got {type(stars).__name__}")
    image = as_image(labels, stars.spacing if spacing is None else spacing)
    objects = LabelObjects(label=stars.label, voxels=stars.voxels, low=stars.low, high=stars.high)
    if what == "seen":
        return paint_seen(image, objects, stars.center)
    painted = np.zeros(image.shape, np.float32)
    for i, box, crop in _crops(image, objects):
        painted[box][crop[1:-1, 1:-1, 1:-1].reshape(painted[box].shape) != 0] = stars.visible[i]
    return painted


def paint_seen(image: LabelImage, objects: LabelObjects, centers: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Paint what the voxel `centers[i]` sees of each object."""
    painted = np.zeros(image.shape, np.uint8)
    for i, box, crop in _crops(image, objects):
        seen = seen_from(crop, centers[i], objects.low[i], is_flat=image.is_flat)
        painted[box] += seen[1:-1, 1:-1, 1:-1].reshape(painted[box].shape)
    return painted


def _crops(image: LabelImage, objects: LabelObjects) -> Generator[tuple[int, tuple[slice, ...], NDArray[np.uint8]]]:
    """Each object: its number, its box in the image, and its crop, which has a layer around."""
    if objects.low.shape[1] != len(image.shape) or (objects.high > np.array(image.shape)).any():
        raise ValueError(f"`stars` must be of this image; got boxes outside its shape {image.shape}")
    for i, crop in enumerate(crops_of(image, objects, range(len(objects)))):
        check_crop("stars", crop, objects, i)
        yield i, tuple(map(slice, objects.low[i].tolist(), objects.high[i].tolist())), crop


def seen_from(
    crop: NDArray[np.uint8], center: NDArray[np.int64], low: NDArray[np.int64], *, is_flat: bool
) -> NDArray[np.uint8]:
    """Paint one crop: hidden, seen, and the centre itself."""
    inside = np.ones(3, dtype=np.int64)
    inside[3 - len(center) :] += center - low
    seen = np.empty_like(crop)
    visible_voxels(crop, is_flat, inside, seen)
    seen += crop
    seen[tuple(inside)] = CENTER
    return seen
