"""Objects of a label image: rows of the table, and pictures of those that fall short."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._plain import plain
from voxkernel.evaluation.settings import FEW, EvaluateSettings
from voxkernel.labels import LabelImage, LabelObjects, LabelStars, find_objects, label_stars, read_labels
from voxkernel.labels.label_image import give_back
from voxkernel.labels.reasons import best_overlap, causes_in

__all__ = ["drawn_rows", "label_rows", "most_pictures", "worst_first"]

_PICTURES = 30  # of so many objects:
_OF = 200
_AT_MOST = 1000  # of one image; a page has no room for more


def label_rows(
    path: str, settings: EvaluateSettings, *, name: str, ids: NDArray[np.int64] | None
) -> tuple[tuple[Mapping[str, Any], ...], dict[str, bytes]]:
    """Give one row per object and the pictures that the rows name; those of `ids` are drawn when all have rows."""
    begin = perf_counter()
    image = read_labels(path, spacing=settings.spacing) if ids is None else _image_of(path, settings.spacing, name)
    objects = find_objects(image) if ids is None else _objects_of(path, settings.spacing, name)
    read = perf_counter()
    stars = label_stars(
        image, n_rays=settings.n_rays, surface=settings.surface and not image.is_flat,
        ids=None if ids is None else ids.tolist(),
        objects=objects, threads=settings.threads,
    )  # fmt: skip
    done = perf_counter()
    rows = [_row(stars, i, len(objects)) for i in range(len(stars))]
    for row in rows:
        row |= {"seconds_read": (read - begin) / len(rows), "seconds_exact": (done - read) / len(rows)}
    files: dict[str, bytes] = {}
    if settings.thumbnails or (settings.thumbnails is None and len(objects) <= FEW):
        short = [row for row in rows if row["shortfall"]]
        if ids is not None:
            for row in short:
                row["thumbnail"] = None  # not known yet
        else:
            order = worst_first([row["voxels_seen"] for row in short], [row["iou"][-1] for row in short])
            _draw(image, [short[i] for i in order[: most_pictures(len(objects))].tolist()], files, name)
    return tuple(rows), files


def drawn_rows(
    path: str, settings: EvaluateSettings, *, name: str, rows: Sequence[Mapping[str, Any]]
) -> tuple[tuple[Mapping[str, Any], ...], dict[str, bytes]]:
    """Give rows of objects with their pictures."""
    files: dict[str, bytes] = {}
    drawn: list[dict[str, Any]] = [{**row, "thumbnail": "", "notes": list(row["notes"] or ())} for row in rows]
    _draw(_image_of(path, settings.spacing, name), drawn, files, name)
    return tuple(drawn), files


def worst_first(seen: Sequence[float], overlap: Sequence[float]) -> NDArray[np.int64]:
    """Order objects that fall short: those least seen, then those that most rays describe worst."""
    return np.lexsort((overlap, seen))


def most_pictures(n_objects: int) -> int:
    """How many objects of an image are drawn; more would be shown by no report."""
    return min(_AT_MOST, _PICTURES * -(-n_objects // _OF))


@lru_cache(maxsize=1)
def _image_of(path: str, spacing: tuple[float, ...] | None, _name: str) -> LabelImage:
    """A file is opened once for all of its objects that come to a worker; the name tells its content."""
    return read_labels(path, spacing=spacing)


@lru_cache(maxsize=1)
def _objects_of(path: str, spacing: tuple[float, ...] | None, name: str) -> LabelObjects:
    return find_objects(_image_of(path, spacing, name))


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


def _draw(image: LabelImage, rows: Sequence[dict[str, Any]], files: dict[str, bytes], name: str) -> None:
    """Draw objects and name the pictures in their rows."""
    from voxkernel.pictures.label_picture import object_picture

    for row in rows:
        box = {"low": np.array([row["box_low"]]), "high": np.array([row["box_high"]])}
        own = LabelObjects(label=np.array([row["object"]]), voxels=np.array([row["voxels"]]), **box)
        try:
            data = object_picture(image, own, np.array([row["center_index"]]), 0)
        except Exception as error:  # a drawing library that fails must not cost the numbers
            row["notes"].append(f"no picture: {type(error).__name__}: {error}")
            continue
        finally:
            give_back(image)
        row["thumbnail"] = file = f"thumbnails/{name}-{row['object']}.png"
        files[file] = data
