"""Objects of a label image: rows of the table, and pictures of those that fall short."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from time import perf_counter
from typing import Any

import numpy as np

from voxkernel._plain import plain
from voxkernel.evaluation.settings import FEW, EvaluateSettings
from voxkernel.labels import LabelImage, LabelObjects, LabelStars, find_objects, label_stars, read_labels
from voxkernel.labels.reasons import best_overlap, causes_in

__all__ = ["label_rows"]

_PICTURES = 30  # of one part; more would be shown by no report


def label_rows(
    path: str, settings: EvaluateSettings, *, name: str, part: tuple[int, int] | None
) -> tuple[tuple[Mapping[str, Any], ...], dict[str, bytes]]:
    """Give one row per object, or per object of a part, and the pictures that the rows name."""
    begin = perf_counter()
    image = read_labels(path, spacing=settings.spacing)
    objects = _objects_of(path, settings.spacing) if part else find_objects(image)
    ids = objects.label if part is None else objects.label[part[0] : part[1]]
    read = perf_counter()
    stars = label_stars(
        image, n_rays=settings.n_rays, surface=settings.surface and not image.is_flat, ids=ids.tolist(),
        objects=objects, threads=settings.threads,
    )  # fmt: skip
    done = perf_counter()
    rows = [_row(stars, i, len(objects)) for i in range(len(stars))]
    for row in rows:
        row |= {"seconds_read": (read - begin) / len(rows), "seconds_exact": (done - read) / len(rows)}
    files: dict[str, bytes] = {}
    if settings.thumbnails or (settings.thumbnails is None and len(objects) <= FEW):
        _draw(image, stars, rows, files, name)
    return tuple(rows), files


@lru_cache(maxsize=1)
def _objects_of(path: str, spacing: tuple[float, ...] | None) -> LabelObjects:
    """The objects of a file are found once for all parts that come to a worker."""
    return find_objects(read_labels(path, spacing=spacing))


def _row(stars: LabelStars, i: int, n_objects: int) -> dict[str, Any]:
    seen, upper = float(stars.visible[i]), float(stars.visible_upper[i])
    hidden = f"{1 - seen:.2%}" if seen < 0.99995 else "less than 0.01%"
    words = f"{hidden} of its voxels are hidden from the best one" if seen < 1.0 else ""
    if seen < 1.0 and upper == 1.0:
        words += "; not certified: no voxel that was looked at sees all"
    return {
        "kind": "label", "object": int(stars.label[i]), "status": "ok", "reason": "",
        "verdict": "star-shaped" if seen == 1.0 else "not star-shaped", "verdict_reason": words,
        "n_objects": n_objects, "voxels": int(stars.voxels[i]), "spacing": list(stars.spacing),
        "box_low": stars.low[i].tolist(), "box_high": stars.high[i].tolist(),
        "n_fragments": int(stars.fragments[i]), "n_holes": int(stars.holes[i]),
        "hole_voxels": int(stars.hole_voxels[i]), "touches_border": bool(stars.touches_border[i]),
        "elongation": float(stars.elongation[i]), "voxels_seen": seen, "voxels_seen_upper": upper,
        "center_index": stars.center[i].tolist(), "center_world": stars.center_world[i].tolist(),
        "seen_deepest": float(stars.visible_deepest[i]), "seen_centroid": float(stars.visible_centroid[i]),
        "n_rays": list(stars.n_rays), "iou": stars.iou[i].tolist(), "iou_stepped": stars.iou_stepped[i].tolist(),
        "rays_for_80": int(stars.rays_for_80[i]), "rays_for_90": int(stars.rays_for_90[i]),
        "shortfall": stars.reason[i], "shortfall_detail": stars.detail[i], "causes": causes_in(stars.detail[i]),
        "overlap": best_overlap(stars.n_rays, stars.iou[i].tolist())[1],
        "ratio": plain(float(stars.kernel_ratio[i])),
        "violation_lower": plain(float(stars.defect_lower[i])), "violation_upper": plain(float(stars.defect_upper[i])),
        "notes": [f"surface: {stars.verdict[i]}"] if stars.verdict[i] else [], "thumbnail": "", "view": "",
    }  # fmt: skip


def _draw(
    image: LabelImage, stars: LabelStars, rows: list[dict[str, Any]], files: dict[str, bytes], name: str
) -> None:
    """Draw the worst objects: those least seen, then those that most rays describe worst."""
    from voxkernel.pictures.label_picture import label_picture

    order = np.lexsort((stars.iou[:, -1], stars.visible))
    for i in [i for i in order.tolist() if stars.reason[i]][:_PICTURES]:
        try:
            data = label_picture(image, stars, i)
        except Exception as error:  # a drawing library that fails must not cost the numbers
            rows[i]["notes"].append(f"no picture: {type(error).__name__}: {error}")
            return
        rows[i]["thumbnail"] = file = f"thumbnails/{name}-{stars.label[i]}.png"
        files[file] = data
