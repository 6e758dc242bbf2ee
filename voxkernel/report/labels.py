"""What a run says about its labels: confusion with the verdicts, ROC of the scores, distributions per class."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.report.columns import cross_counts
from voxkernel.report.rows import CELL_SCORES, OUTCOMES, SCORES, ReportRows
from voxkernel.report.statistics import quantiles, roc_curve

__all__ = ["MAX_LABELS", "label_summary", "labels_of", "star_truth"]

MAX_LABELS = 24
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_STAR = {"star", "star-shaped", "star shaped", "starshaped", "positive", "true", "yes", "1"}
_NOT = {"not", "not star-shaped", "not star", "not star shaped", "non-star", "non star", "nonstar", "non-star-shaped",
        "non star shaped", "negative", "false", "no", "0"}  # fmt: skip


def labels_of(rows: ReportRows) -> list[str]:
    """List the labels in use, the most frequent first when there are too many, else by name."""
    counts = rows.texts["label"].counts()
    counts.pop("", None)
    if len(counts) <= MAX_LABELS:
        return sorted(counts)
    return [label for label, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))[:MAX_LABELS]]


def star_truth(rows: ReportRows, star_labels: Sequence[str] | None) -> tuple[list[str], list[str]] | None:
    """Give the labels that mean star-shaped and those that do not; None when that is not known.

    Without `star_labels`, labels such as "star" and "not star-shaped" are understood if there are no others.
    """
    used = sorted(label for label in rows.texts["label"].used() if label)
    if star_labels is not None:
        missing = sorted(set(star_labels) - set(used))
        if missing:
            raise ValueError(f"`star_labels` must be labels of the run; got {missing}, labels are {used[:MAX_LABELS]}")
        return [u for u in used if u in set(star_labels)], [u for u in used if u not in set(star_labels)]
    kinds = {label: label.strip().lower().replace("_", " ") for label in used}
    star = [u for u in used if kinds[u] in _STAR]
    other = [u for u in used if kinds[u] in _NOT]
    return (star, other) if star and other and len(star) + len(other) == len(used) else None


def label_summary(rows: ReportRows, star_labels: Sequence[str] | None) -> dict[str, Any] | None:
    """Summarise labels against verdicts and scores; None when no row has a label."""
    labels = labels_of(rows)
    if not labels:
        return None
    truth = star_truth(rows, star_labels)
    return {
        "n_labels": sum(bool(label) for label in rows.texts["label"].used()),
        "n_unlabelled": rows.texts["label"].counts()[""],
        "names": labels,
        "outcomes": list(OUTCOMES),
        "counts": cross_counts(rows.texts["label"], rows.outcome, labels, OUTCOMES).tolist(),
        "truth": None if truth is None else _binary(rows, *truth),
        "roc": _curves(rows, labels, truth),
        "distributions": _distributions(rows, labels),
    }


def wrong_ids(rows: ReportRows, truth: tuple[list[str], list[str]] | None) -> list[int]:
    """Give the rows whose verdict is not what their label says; failed rows are not among them."""
    if truth is None:
        return []
    missed = rows.texts["label"].among(truth[0]) & rows.outcome.among(["not star-shaped"])
    false = rows.texts["label"].among(truth[1]) & rows.outcome.among(["star-shaped", "degenerate"])
    return np.flatnonzero(missed | false).tolist()


def _binary(rows: ReportRows, star: list[str], other: list[str]) -> dict[str, Any]:
    """A degenerate kernel is not empty: its surface counts as star-shaped."""
    each = cross_counts(rows.texts["label"], rows.outcome, [*star, *other], OUTCOMES)
    counts = [each[: len(star)].sum(axis=0).tolist(), each[len(star) :].sum(axis=0).tolist()]
    (hit, flat, missed, _), (false, false_flat, right, _) = counts
    positive, negative = hit + flat + missed, false + false_flat + right
    good = hit + flat + right
    return {
        "star_labels": star,
        "other_labels": other,
        "counts": counts,
        "n": positive + negative,
        "n_failed": counts[0][3] + counts[1][3],
        "n_right": good,
        "accuracy": good / (positive + negative) if positive + negative else None,
        "sensitivity": (hit + flat) / positive if positive else None,
        "specificity": right / negative if negative else None,
        "wrong": _entries(rows, np.array(wrong_ids(rows, (star, other)), np.int64)),
    }


def _entries(rows: ReportRows, ids: NDArray[np.int64]) -> list[dict[str, Any]]:
    cells = rows.numbers["cell"][ids].tolist()
    files, labels, verdicts = (texts.taken(ids) for texts in (rows.texts["file"], rows.texts["label"], rows.outcome))
    return [
        {"file": file, "cell": None if cell != cell else int(cell), "label": label, "verdict": verdict}
        for file, cell, label, verdict in zip(files, cells, labels, verdicts, strict=True)
    ]


def _curves(rows: ReportRows, labels: list[str], truth: tuple[list[str], list[str]] | None) -> list[dict[str, Any]]:
    """One curve per score: star-shaped against not where the labels say so, else each label against the others."""
    names = rows.texts["label"]
    labelled = ~names.among([""])
    if truth is not None:
        groups = [("star-shaped", truth[0])]
    elif len(labels) > 1:
        groups = [(label, [label]) for label in labels]
    else:
        return []
    curves: list[dict[str, Any]] = []
    for name, words in groups:
        chosen = names.among(words)
        scores: dict[str, Any] = {}
        for score in (*SCORES, *CELL_SCORES):
            values = score.sign * rows.numbers[score.column][labelled]
            curve = roc_curve(values, chosen[labelled])
            if curve.n_positive and curve.n_negative:
                scores[score.name] = {
                    "auc": curve.area,
                    "n_positive": curve.n_positive,
                    "n_negative": curve.n_negative,
                    "curve": curve,
                }
        if scores:
            curves.append({"label": name, "scores": scores})
    return curves


def _distributions(rows: ReportRows, labels: list[str]) -> dict[str, list[dict[str, Any]]]:
    names = rows.texts["label"].places(labels)
    found: dict[str, list[dict[str, Any]]] = {}
    for score in (*SCORES, *CELL_SCORES):
        if not rows.has(score.column):
            continue
        values = rows.numbers[score.column]
        found[score.name] = []
        for k, label in enumerate(labels):
            own = values[(names == k) & np.isfinite(values)]
            found[score.name].append({
                "label": label, "n": len(own),
                "min": float(own.min()) if len(own) else None, "max": float(own.max()) if len(own) else None,
                "quantiles": dict(zip((f"{q:g}" for q in QUANTILES), quantiles(own, QUANTILES), strict=True)),
            })  # fmt: skip
    return found
