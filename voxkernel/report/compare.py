"""Two runs side by side: verdicts that changed, regressions, and how far the scores moved."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.report.charts import CLASS_OF, Axis, Chart
from voxkernel.report.columns import Texts, cross_counts
from voxkernel.report.rows import ALL_SCORES, OUTCOMES, ReportRows
from voxkernel.report.text import count, number

__all__ = ["comparison", "comparison_charts", "matched", "with_changes"]

_MOST = 200  # rows listed of each sort
_DOTS = 2000
_BOX: dict[str, Any] = {"width": 316.0, "height": 286.0, "left": 66.0, "bottom": 242.0, "right": 302.0}

Pairs = NDArray[np.int64]


def matched(now: ReportRows, before: ReportRows) -> tuple[Pairs, str]:
    """Match rows of two runs by file, cell and object: (k, 2) row numbers, and by what.

    Where no name is in both runs, names count without the folder that all files of a run share.
    """
    for by in ("name", "name below the common folder"):
        cut = [0, 0] if by == "name" else [_shared(run) for run in (now, before)]
        pairs = _pairs(now, before, *_shared_files(now.texts["file"], before.texts["file"], cut))
        if len(pairs):
            return pairs, by
    return np.zeros((0, 2), dtype=np.int64), "name"


def _shared_files(now: Texts, before: Texts, cut: list[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number the files of both runs alike, without the first letters of each: for each row, -1 where only now."""
    compute = optional("pyarrow.compute")
    words: list[Any] = []
    places: list[NDArray[np.int64]] = []
    for texts, n in zip((now, before), cut, strict=True):
        used = np.flatnonzero(np.bincount(texts.codes, minlength=len(texts.words)))
        place = np.full(len(texts.words), -1, np.int64)
        place[used] = np.arange(len(used))
        own = texts.words.take(optional("pyarrow").array(used)).cast("large_string")
        words.append(compute.utf8_slice_codeunits(own, n) if n else own)
        places.append(place[texts.codes])
    found = compute.index_in(words[0], value_set=words[1]).fill_null(-1).to_numpy(zero_copy_only=False)
    return found.astype(np.int64)[places[0]], places[1]


def _pairs(now: ReportRows, before: ReportRows, files: NDArray[np.int64], others: NDArray[np.int64]) -> Pairs:
    """Rows of the same file, cell and object; the last one where the other run has several."""
    own = np.flatnonzero(files >= 0)
    keys = [np.concatenate([files[own], others])]
    for name in ("cell", "object"):
        given = np.concatenate([now.numbers[name][own], before.numbers[name]])
        keys.append(np.nan_to_num(given, nan=-1.0).astype(np.int64))
    order = np.lexsort(keys[::-1])
    is_new = np.zeros(len(order), bool)
    for key in keys:
        is_new[1:] |= key[order[1:]] != key[order[:-1]]
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(is_new)
    place = np.full(len(order), -1, np.int64)
    np.maximum.at(place, group[len(own) :], np.arange(before.n))
    found = place[group[: len(own)]]
    return np.stack([own[found >= 0], found[found >= 0]], axis=1)


def with_changes(now: ReportRows, before: ReportRows, pairs: Pairs) -> ReportRows:
    """Give each row its verdict in the other run and how far its ratio and defect moved."""
    codes = np.full(now.n, len(before.outcome.words), dtype=np.int32)
    codes[pairs[:, 0]] = before.outcome.codes[pairs[:, 1]]
    words = Texts.of_words(codes, [*before.outcome.words.to_pylist(), "not in the other run"])
    moved: dict[str, NDArray[np.float64]] = {}
    for name, column in (("ratio_change", "ratio"), ("defect_change", "violation_upper")):
        moved[name] = np.full(now.n, np.nan)
        moved[name][pairs[:, 0]] = now.numbers[column][pairs[:, 0]] - before.numbers[column][pairs[:, 1]]
    return now.with_columns({"before": words}, moved)


def comparison(
    now: ReportRows, before: ReportRows, pairs: Pairs, *, matched_by: str, names: tuple[str, str]
) -> dict[str, Any]:
    """Say what became of each row of the other run; worse means less star-shaped, failed, or without its proof."""
    was, is_now = before.outcome.taken(pairs[:, 1]), now.outcome.taken(pairs[:, 0])
    step = is_now.places(OUTCOMES).astype(np.int64) - was.places(OUTCOMES)
    proof = now.numbers["certificate_verified"][pairs[:, 0]], before.numbers["certificate_verified"][pairs[:, 1]]
    lost = (proof[0] != 1.0) & (proof[1] == 1.0) & (step <= 0)
    regressions = pairs[(step > 0) | lost]
    better = pairs[step < 0]
    alone_now = np.setdiff1d(np.arange(now.n), pairs[:, 0])
    alone_before = np.setdiff1d(np.arange(before.n), pairs[:, 1])
    return {
        "now": names[0], "before": names[1], "matched_by": matched_by,
        "n_now": now.n, "n_before": before.n, "n_both": len(pairs),
        "only_now": {"n": len(alone_now), "rows": [now.name(i) for i in alone_now[:_MOST].tolist()]},
        "only_before": {"n": len(alone_before), "rows": [before.name(j) for j in alone_before[:_MOST].tolist()]},
        "outcomes": list(OUTCOMES), "counts": cross_counts(was, is_now, OUTCOMES, OUTCOMES).tolist(),
        "n_changed": int((step != 0).sum()),
        "regressions": _listed(now, before, regressions, np.abs(step[(step > 0) | lost])),
        "improvements": _listed(now, before, better, np.abs(step[step < 0])),
        "n_proofs_lost": int(lost.sum()),
        "scores": {score.name: found for score in ALL_SCORES
                   if (found := _moved(now, before, pairs, score.column, score.sign)) is not None},
        "seconds": _seconds(now, before, pairs),
        "same_settings": set(now.texts["settings"].used()) == set(before.texts["settings"].used()),
        "same_versions": set(now.texts["versions"].used()) == set(before.texts["versions"].used()),
    }  # fmt: skip


def comparison_charts(now: ReportRows, before: ReportRows, pairs: Pairs) -> list[Chart]:
    """A dot for each row, its score before to the right and its score now upwards; on the line nothing moved."""
    charts: list[Chart] = []
    for score in ALL_SCORES:
        new, old = now.numbers[score.column][pairs[:, 0]], before.numbers[score.column][pairs[:, 1]]
        known = np.flatnonzero(np.isfinite(new) & np.isfinite(old))
        if not len(known):
            continue
        is_log = score.name == "defect"
        both = np.concatenate([new[known], old[known]])
        across = Axis.over(both, _BOX["left"], _BOX["right"], is_log=is_log)
        up = Axis.over(both, _BOX["bottom"], 10.0, is_log=is_log)
        up = up if not is_log else _Upwards(across)
        shapes: list[dict[str, Any]] = [
            {"kind": "line", "css": "other", "points": [(across.start, _BOX["bottom"]), (across.end, 10.0)]}
        ]
        order = known[np.argsort(-np.abs(new[known] - old[known]), kind="stable")][:_DOTS]
        for k in order[::-1].tolist():
            i = int(pairs[k, 0])
            shapes.append({
                "kind": "rect", "css": CLASS_OF[now.outcome[i]], "w": 5.0, "h": 5.0,
                "x": across.place(float(old[k])) - 2.5, "y": up.place(float(new[k])) - 2.5,
                "title": f"row {i + 1}: {number(float(old[k]))} before, {number(float(new[k]))} now",
            })  # fmt: skip
        moved = int((new[known] != old[known]).sum())
        caption = f"{count(moved)} of {count(len(known))} rows moved." + (
            f" The {count(_DOTS)} that moved most are drawn." if len(known) > _DOTS else "")
        charts.append(Chart(
            title=score.title, subtitle=score.meaning, x_label="before", y_label="now", shapes=shapes,
            x_ticks=across.ticks(), y_ticks=up.ticks(), caption=caption,
            alt=f"{score.title} before and now. {caption}", **_BOX,
        ))  # fmt: skip
    return charts


class _Upwards:
    """A logarithmic axis turned upwards: its place for zero is at the bottom."""

    def __init__(self, across: Axis) -> None:
        self._across = across
        self._scale = (_BOX["bottom"] - 10.0) / (across.end - across.start)

    def place(self, value: float) -> float:
        return _BOX["bottom"] - (self._across.place(value) - self._across.start) * self._scale

    def ticks(self) -> list[tuple[float, str]]:
        return [
            (_BOX["bottom"] - (x - self._across.start) * self._scale, words) for x, words in self._across.ticks()
        ]


def _shared(rows: ReportRows) -> int:
    """Letters of the folder that all files are in, with its slash."""
    ends = rows.texts["file"].extent()
    if ends is None:
        return 0
    low, high = ends  # in order: what these share is what all share
    same = next((k for k, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), min(len(low), len(high)))
    return low[:same].rfind("/") + 1


def _listed(now: ReportRows, before: ReportRows, pairs: Pairs, steps: NDArray[np.int64]) -> dict[str, Any]:
    """The rows of these pairs, the largest step first, then the largest change of the defect."""
    moved = np.abs(
        np.nan_to_num(now.numbers["violation_upper"][pairs[:, 0]])
        - np.nan_to_num(before.numbers["violation_upper"][pairs[:, 1]])
    )
    order = np.lexsort((np.arange(len(pairs)), -moved, -steps))
    entries: list[dict[str, Any]] = []
    for i, j in pairs[order[:_MOST]].tolist():
        scores = {
            score.name: (_or_none(before.numbers[score.column][j]), _or_none(now.numbers[score.column][i]))
            for score in ALL_SCORES
            if np.isfinite(before.numbers[score.column][j]) or np.isfinite(now.numbers[score.column][i])
        }
        entries.append({
            "name": now.name(i), "before": before.outcome[j], "now": now.outcome[i], "scores": scores,
            "reason": now.cause(i) if now.outcome[i] == "failed" else "",
            "proof_lost": before.numbers["certificate_verified"][j] == 1.0
            and now.numbers["certificate_verified"][i] != 1.0,
        })  # fmt: skip
    return {"n": len(pairs), "rows": entries}


def _moved(now: ReportRows, before: ReportRows, pairs: Pairs, column: str, sign: int) -> dict[str, Any] | None:
    new, old = now.numbers[column][pairs[:, 0]], before.numbers[column][pairs[:, 1]]
    known = np.isfinite(new) & np.isfinite(old)
    if not known.any():
        return None
    gain = sign * (new[known] - old[known])  # larger: more star-shaped now
    size = np.abs(gain)
    most = int(pairs[np.flatnonzero(known)[int(size.argmax())], 0])
    return {
        "n": len(gain), "n_equal": int((gain == 0.0).sum()), "n_better": int((gain > 0.0).sum()),
        "n_worse": int((gain < 0.0).sum()), "median_change": float(np.median(sign * gain)),
        "largest_change": float(size.max()), "largest": now.name(most) if size.max() > 0.0 else "",
    }  # fmt: skip


def _seconds(now: ReportRows, before: ReportRows, pairs: Pairs) -> dict[str, float] | None:
    new, old = now.numbers["seconds"][pairs[:, 0]], before.numbers["seconds"][pairs[:, 1]]
    known = np.isfinite(new) & np.isfinite(old)
    return {"before": float(old[known].sum()), "now": float(new[known].sum())} if known.any() else None


def _or_none(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None
