"""Objects of label images in a report: counted apart, why they fall short, and how many rays they want."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.report.charts import Axis, Chart
from voxkernel.report.rows import ReportRows
from voxkernel.report.text import count, number

__all__ = ["object_charts", "object_summary", "worst_objects"]

_ENOUGH, _SHARE = 0.8, 0.9  # of the overlap, and of the objects that are to reach it
_QUARTILES = (0.25, 0.5, 0.75)
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 400.0, 236.0, 46.0, 14.0, 10.0, 38.0


def object_summary(rows: ReportRows) -> dict[str, Any] | None:
    """Say how many objects are seen whole, why the others are not, and what rays reach; None without objects."""
    ids = _objects(rows)
    if not ids:
        return None
    seen, upper = rows.numbers["voxels_seen"][ids], rows.numbers["voxels_seen_upper"][ids]
    reasons = rows.texts["shortfall"].taken(np.array(ids)).counts()
    reasons.pop("", None)
    causes: Counter[str] = Counter(cause for own in rows.lists["causes"].taken(np.array(ids)) for cause in own or [])
    rays, exact, stepped = _overlaps(rows, ids)
    enough = [n for n, column in zip(rays, exact.T, strict=True) if (column >= _ENOUGH).mean() >= _SHARE]
    return {
        "n": len(ids),
        "n_star": int((seen == 1.0).sum()),
        "n_not_star": int((upper < 1.0).sum()),
        "n_undecided": int(((seen < 1.0) & (upper == 1.0)).sum()),
        "n_certified": int((seen == upper).sum()),
        "n_at_border": int((rows.numbers["touches_border"][ids] == 1.0).sum()),
        "shortfalls": {reason: n for reason, n in sorted(reasons.items(), key=lambda pair: (-pair[1], pair[0]))},
        "causes": dict(sorted(causes.items(), key=lambda pair: (-pair[1], pair[0]))),
        "n_fine": len(ids) - sum(reasons.values()),
        "n_rays": list(rays),
        "n_with_rays": len(exact),
        "overlap": _quartiles(exact),
        "overlap_stepped": _quartiles(stepped),
        "share_enough": [float((column >= _ENOUGH).mean()) for column in exact.T],
        "recommended_rays": enough[0] if enough else None,
        "best_over_deepest": float(np.mean(seen - rows.numbers["seen_deepest"][ids])),
        "n_centroid_outside": int((rows.numbers["seen_centroid"][ids] == 0.0).sum()),
    }


def object_charts(summary: dict[str, Any] | None) -> list[Chart]:
    """The overlap against the number of rays, for both ways to end a ray: median and middle half."""
    if summary is None or len(summary["n_rays"]) < 2:
        return []
    rays = summary["n_rays"]
    across = Axis(np.log2(rays[0]), np.log2(rays[-1]), _LEFT, _WIDTH - _RIGHT)
    up = Axis(0.0, 1.0, _HEIGHT - _BOTTOM, _TOP)
    charts: list[Chart] = []
    for key, title, meaning in (
        ("overlap", "Overlap against rays", "rays end where they leave the object"),
        ("overlap_stepped", "The same as StarDist ends rays", "at the first sample outside, one voxel apart"),
    ):
        low, middle, high = (
            [(across.place(float(np.log2(n))), up.place(v)) for n, v in zip(rays, summary[key][q], strict=True)]
            for q in ("q25", "median", "q75")
        )
        shapes: list[dict[str, Any]] = [
            {"kind": "area", "css": "band", "points": low + high[::-1]},
            {"kind": "line", "css": "other",
             "points": [(across.start, up.place(_ENOUGH)), (across.end, up.place(_ENOUGH))]},
            {"kind": "line", "css": "main", "points": middle},
        ]  # fmt: skip
        words = ", ".join(f"{n}: {number(v)}" for n, v in zip(rays, summary[key]["median"], strict=True))
        charts.append(Chart(
            title=title, subtitle=meaning, x_label="rays", y_label="intersection over union", shapes=shapes,
            alt=f"{title}, {count(summary['n_with_rays'])} objects; medians {words}.",
            caption=f"Median and middle half of {count(summary['n_with_rays'])} objects; the thin line is 0.8.",
            x_ticks=[(across.place(float(np.log2(n))), str(n)) for n in rays],
            y_ticks=[(up.place(v), number(v)) for v in (0.0, 0.5, 1.0)],
        ))  # fmt: skip
    return charts


def worst_objects(rows: ReportRows, n: int) -> list[int]:
    """Objects with a picture: those least seen first, then those that most rays describe worst."""
    objects = np.array(_objects(rows), np.int64)
    ids = [i for i, name in zip(objects.tolist(), rows.texts["thumbnail"].taken(objects), strict=True) if name]
    overlaps, seen = rows.lists["iou"], rows.numbers["voxels_seen"]
    last = {i: (overlaps[i] or [1.0])[-1] for i in ids}
    return sorted(ids, key=lambda i: (seen[i], last[i], i))[:n]


def _objects(rows: ReportRows) -> list[int]:
    known = np.isfinite(rows.numbers["object"]) & np.isfinite(rows.numbers["voxels_seen"])
    known[rows.ids("failed")] = False
    return np.flatnonzero(known).tolist()


def _overlaps(
    rows: ReportRows, ids: Sequence[int]
) -> tuple[tuple[int, ...], NDArray[np.float64], NDArray[np.float64]]:
    """Overlaps of the objects that were made with the most frequent numbers of rays."""
    found: dict[tuple[int, ...], list[tuple[list[float], list[float]]]] = {}
    own = (rows.lists[name].taken(np.array(ids)) for name in ("n_rays", "iou", "iou_stepped"))
    for lists in zip(*own, strict=True):
        rays, exact, stepped = (values or [] for values in lists)
        if rays and len(rays) == len(exact) == len(stepped) and None not in (*rays, *exact, *stepped):
            found.setdefault(tuple(rays), []).append((exact, stepped))
    if not found:
        return (), np.zeros((0, 0)), np.zeros((0, 0))
    usual = max(found, key=lambda rays: (len(found[rays]), rays))
    return usual, np.array([a for a, _ in found[usual]]), np.array([b for _, b in found[usual]])


def _quartiles(values: NDArray[np.float64]) -> dict[str, list[float]]:
    bands = np.quantile(values, _QUARTILES, axis=0) if values.size else np.zeros((3, 0))
    return dict(zip(("q25", "median", "q75"), bands.tolist(), strict=True))
