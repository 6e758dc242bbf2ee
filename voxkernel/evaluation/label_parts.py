"""Label images are shared out: some objects of one at a time, so that workers are busy and limits count per part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

from voxkernel.errors import VoxKernelError
from voxkernel.evaluation.file_stamp import stamp_of
from voxkernel.evaluation.inputs import Item, content_hash, is_private
from voxkernel.evaluation.settings import EvaluateSettings
from voxkernel.labels import find_objects, is_label_file, read_labels

__all__ = ["in_parts"]

_OBJECTS = 200  # of a part


def in_parts(items: Sequence[Item], settings: EvaluateSettings) -> list[Item]:
    """Divide large label images on this machine; what cannot be read stays whole, and its row says why."""
    parts: list[Item] = []
    for item in items:
        if not is_label_file(item.url) or item.data is not None or is_private(item.url) or "://" in item.url:
            parts.append(item)
            continue
        try:
            n = len(find_objects(read_labels(item.url, spacing=settings.spacing)))
        except (VoxKernelError, ValueError, TypeError, OSError):
            n = 0
        if n <= _OBJECTS:
            parts.append(item)
            continue
        stamp = stamp_of(item.url)  # before it is hashed
        finished = datetime.now(UTC).isoformat(timespec="milliseconds")
        whole = replace(item, known_hash=content_hash(item), finished=finished, known_stamp=stamp)
        parts += [replace(whole, part=(k, min(n, k + _OBJECTS))) for k in range(0, n, _OBJECTS)]
    return parts
