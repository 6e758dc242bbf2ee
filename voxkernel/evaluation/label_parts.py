"""Label images are shared out by object, so that workers are busy and an object that fails costs its own row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from voxkernel.errors import VoxKernelError
from voxkernel.evaluation.file_stamp import stamp_of
from voxkernel.evaluation.inputs import Item, content_hash, is_private
from voxkernel.evaluation.object_group import ObjectGroup
from voxkernel.evaluation.settings import EvaluateSettings
from voxkernel.labels import find_objects, is_label_file, read_labels

__all__ = ["in_parts", "n_units"]

_OF_ONE = 500.0  # voxels that take as long as what is done once for each object


def in_parts(items: Sequence[Item], settings: EvaluateSettings) -> list[Item]:
    """List the objects of label images on this machine that have no rows yet, in the order of their place.

    What cannot be read stays whole, and its row says why; so does an image without objects.
    """
    parts: list[Item] = []
    for item in items:
        whole = replace(item, known_hash="", finished="", known_stamp=None, done=None)
        if not is_label_file(item.url) or item.data is not None or is_private(item.url) or "://" in item.url:
            parts.append(whole)
            continue
        try:
            image = read_labels(item.url, spacing=settings.spacing)
            objects = find_objects(image)
        except (VoxKernelError, ValueError, TypeError, OSError):
            parts.append(whole)
            continue
        if not len(objects):
            parts.append(whole)
            continue
        is_done = np.isin(objects.label, np.fromiter(item.done or (), np.int64))
        if is_done.all() or item.done is None:
            stamp = stamp_of(item.url)  # before it is hashed
            finished = datetime.now(UTC).isoformat(timespec="milliseconds")
            item = replace(whole, known_hash=content_hash(item), finished=finished, known_stamp=stamp)
        places = objects.low // np.array(image.chunks)  # a chunk of a file is unpacked once for all objects in it
        order = np.lexsort(places.T[::-1])
        if not is_done.all():  # else rows are there for objects that are not: all anew
            order = order[~is_done[order]]
        work = objects.voxels[order].astype(np.float64) + _OF_ONE
        group = ObjectGroup(objects.label[order], work, len(objects))
        parts.append(replace(item, done=None, group=group))
    return parts


def n_units(items: Sequence[Item]) -> int:
    """Count meshes, and objects of the images that are shared out."""
    return sum(1 if item.group is None else len(item.group) for item in items)
