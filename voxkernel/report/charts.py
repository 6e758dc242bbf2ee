"""Charts of a report as geometry: the template draws the shapes, so no text from a file ever becomes markup here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.report.rows import ALL_SCORES, OUTCOMES, ReportRows, Score
from voxkernel.report.text import count, number, percent, readable, shorten

__all__ = ["Axis", "Chart", "boxes", "histogram", "profile_charts", "roc_charts", "score_charts"]

WIDTH, HEIGHT = 400.0, 236.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 14.0, 10.0, 38.0
_BINS = 30
_TICK_WIDTH = 46.0  # of "0.0001", with what keeps it apart from the next
_ZERO, _GAP = 32.0, 18.0  # width of the place for zero on a logarithmic axis, and what follows it
CLASS_OF: dict[str, str] = dict(zip(OUTCOMES, ("star", "flat", "not", "failed"), strict=True))
_TITLES = {score.name: score for score in ALL_SCORES}


@dataclass(frozen=True, slots=True)
class Chart:
    """Shapes in a box of `width` x `height`: each a dict with `kind`, `css` and its own numbers."""

    title: str
    alt: str
    x_ticks: list[tuple[float, str]]
    y_ticks: list[tuple[float, str]]
    shapes: list[dict[str, Any]]
    x_label: str = ""
    y_label: str = ""
    subtitle: str = ""
    caption: str = ""
    legend: list[tuple[str, str]] = field(default_factory=list)
    width: float = WIDTH
    height: float = HEIGHT
    left: float = _LEFT
    bottom: float = HEIGHT - _BOTTOM
    top: float = _TOP
    right: float = WIDTH - _RIGHT


@dataclass(frozen=True, slots=True)
class Axis:
    """Numbers to positions: linear, or logarithmic with a place of its own for zero."""

    low: float
    high: float
    start: float
    end: float
    is_log: bool = False

    @classmethod
    def over(cls, values: NDArray[np.float64], start: float, end: float, *, is_log: bool) -> Axis:
        """Choose limits: whole decades, or round numbers near 0 and 1."""
        top, bottom = float(values.max()), float(values.min())
        if is_log:
            positive = values[values > 0.0]
            if not len(positive):
                return cls(1e-4, 1.0, start, end, True)
            low = max(-12, math.floor(math.log10(positive.min())))
            high = max(low + 1, math.ceil(math.log10(positive.max())))
            return cls(10.0**low, 10.0**high, start, end, True)
        low = 0.0 if bottom < 0.5 or top > 1.0 else min(math.floor(bottom * 20.0) / 20.0, 0.95)
        high = 1.0 if 0.3 < top <= 1.0 else _round_up(top)
        return cls(min(low, bottom), max(high, low + 1e-12), start, end)

    def place(self, value: float) -> float:
        """Position of a number; those beyond the limits are drawn at them."""
        if self.is_log:
            if value <= 0.0:
                return self.start + _ZERO / 2.0
            share = math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)
            first = self.start + _ZERO + _GAP
            return first + min(share, 1.0) * (self.end - first)
        share = (value - self.low) / (self.high - self.low)
        return self.start + min(max(share, 0.0), 1.0) * (self.end - self.start)

    def ticks(self) -> list[tuple[float, str]]:
        """Positions and words of some five ticks."""
        if not self.is_log:
            return [(self.place(v), _tick(v)) for v in _round_numbers(self.low, self.high)]
        low, high = round(math.log10(self.low)), round(math.log10(self.high))
        room = max(1.0, min(5.0, (abs(self.end - self.start) - _ZERO - _GAP) / _TICK_WIDTH))
        step = max(1, math.ceil((high - low) / room))
        tens = [10.0**k for k in range(high, low - 1, -step)]
        return [(self.place(0.0), "0"), *((self.place(v), number(v)) for v in reversed(tens))]

    def edges(self) -> NDArray[np.float64]:
        """Edges of histogram bins, without the place for zero."""
        if not self.is_log:
            return np.linspace(self.low, self.high, _BINS + 1)
        decades = max(1, round(math.log10(self.high / self.low)))
        return np.geomspace(self.low, self.high, decades * max(1, min(6, _BINS // decades)) + 1)


def score_charts(rows: ReportRows, scores: Sequence[Score]) -> list[Chart]:
    """Histograms of the scores that rows of one kind have."""
    return [histogram(rows, score) for score in scores if rows.has(score.column)]


def histogram(rows: ReportRows, score: Score) -> Chart:
    """Count rows by a score, stacked by outcome."""
    values = rows.numbers[score.column]
    known = np.isfinite(values)
    axis = Axis.over(values[known], _LEFT, WIDTH - _RIGHT, is_log=score.name == "defect")
    edges = axis.edges()
    outcome = rows.outcome.places(OUTCOMES)
    stacks = {name: _binned(values[known & (outcome == k)], edges, axis.is_log) for k, name in enumerate(OUTCOMES)}
    total = int(np.sum(list(stacks.values())))
    tallest = max(1, int(np.sum(list(stacks.values()), axis=0).max()))
    up = Axis(0.0, _round_up(tallest), HEIGHT - _BOTTOM, _TOP)
    shapes: list[dict[str, Any]] = []
    base = np.zeros(len(edges) - 1 + axis.is_log, dtype=np.int64)
    for name, bins in stacks.items():
        for j in np.flatnonzero(bins):
            left, right, words = _bin_place(axis, edges, int(j))
            y0, y1 = up.place(float(base[j])), up.place(float(base[j] + bins[j]))
            shapes.append({
                "kind": "rect", "css": CLASS_OF[name], "x": left + 0.5, "y": y1, "w": max(right - left - 1.0, 1.0),
                "h": max(y0 - y1, 0.75), "title": f"{words}: {count(int(bins[j]))} {name}",
            })  # fmt: skip
        base += bins
    q = np.quantile(values[known], [0.25, 0.5, 0.75])
    caption = (
        f"Median {number(float(q[1]))}, middle half {number(float(q[0]))} to {number(float(q[2]))}; "
        f"{count(int((values[known] == 0.0).sum()))} exactly 0; {count(rows.n - int(known.sum()))} rows without it."
    )
    return Chart(
        title=score.title, subtitle=score.meaning, shapes=shapes, caption=caption,
        alt=f"Histogram of {score.title.lower()}, {count(total)} rows. {caption}", x_ticks=axis.ticks(),
        y_ticks=up.ticks(), legend=[(CLASS_OF[n], n) for n in OUTCOMES if stacks[n].sum()],
    )  # fmt: skip


def profile_charts(profile: dict[str, Any] | None) -> list[Chart]:
    """One chart per label: median, middle half and 10 to 90 % of the defect profiles."""
    if profile is None:
        return []
    tolerances = profile["tolerances"]
    top = _round_up(max(float(group["q90"].max()) for group in profile["groups"]) or 1.0)
    width = WIDTH if len(profile["groups"]) < 4 else 290.0
    across = Axis(0.0, max(tolerances[-1], 1e-12), _LEFT, width - _RIGHT)
    up = Axis(0.0, top, HEIGHT - _BOTTOM, _TOP)

    def line(values: NDArray[np.float64]) -> list[tuple[float, float]]:
        return [(across.place(t), up.place(float(v))) for t, v in zip(tolerances, values, strict=True)]

    medians = [line(group["median"]) for group in profile["groups"]]
    charts: list[Chart] = []
    for k, group in enumerate(profile["groups"]):
        shapes: list[dict[str, Any]] = [
            {"kind": "line", "css": "other", "points": points} for j, points in enumerate(medians) if j != k
        ]
        for low, high, css in (("q10", "q90", "band"), ("q25", "q75", "band")):
            shapes.append({"kind": "area", "css": css, "points": line(group[low]) + line(group[high])[::-1]})
        shapes.append({"kind": "line", "css": "main", "points": medians[k]})
        name = f"{shorten(readable(group['label']), 40)} ({count(group['n'])})" if group["label"] else "All rows"
        half = int(np.searchsorted(tolerances, tolerances[-1] / 2.0))
        charts.append(Chart(
            title=name, x_label="share of the area left out", y_label="share of the domain", shapes=shapes,
            alt=f"Defect profile, {name}: median {number(float(group['median'][0]))} at tolerance 0, "
            f"{number(float(group['median'][half]))} at {number(tolerances[half])}.",
            x_ticks=across.ticks(), y_ticks=up.ticks(), width=width, right=width - _RIGHT,
        ))  # fmt: skip
    return charts


def roc_charts(labels: dict[str, Any] | None) -> list[Chart]:
    """One chart per class with a curve for each score."""
    charts: list[Chart] = []
    size = 250.0
    box: dict[str, Any] = {
        "width": size,
        "height": size,
        "left": _LEFT,
        "bottom": size - _BOTTOM,
        "right": size - _RIGHT,
    }
    across, up = Axis(0.0, 1.0, _LEFT, size - _RIGHT), Axis(0.0, 1.0, size - _BOTTOM, _TOP)
    halves = [0.0, 0.5, 1.0]
    for entry in labels["roc"] if labels else []:
        diagonal = {"kind": "line", "css": "other", "points": [(across.start, up.start), (across.end, up.end)]}
        shapes: list[dict[str, Any]] = [diagonal]
        legend: list[tuple[str, str]] = []
        for k, (name, found) in enumerate(entry["scores"].items()):
            x, y = _thinned(found["curve"].false_positive_rate, found["curve"].true_positive_rate)
            points = [(across.place(float(a)), up.place(float(b))) for a, b in zip(x, y, strict=True)]
            shapes.append({"kind": "line", "css": f"score{k}", "points": points})
            legend.append((f"score{k}", f"{_TITLES[name].title} {found['auc']:.3f}"))
        name = shorten(readable(entry["label"]), 40)
        charts.append(Chart(
            title=name, x_label="share of the others", y_label="share of this class", shapes=shapes, legend=legend,
            alt=f"ROC of {name}; area under the curve: " + ", ".join(words for _, words in legend),
            x_ticks=[(across.place(v), number(v)) for v in halves], y_ticks=[(up.place(v), number(v)) for v in halves],
            **box,
        ))  # fmt: skip
    return charts


def boxes(labels: dict[str, Any] | None) -> list[Chart]:
    """One chart per score: 5 to 95 %, the middle half and the median of each class."""
    charts: list[Chart] = []
    for name, groups in labels["distributions"].items() if labels else []:
        used = [group for group in groups if group["n"]]
        if not used:
            continue
        ends = np.array([v for g in used for v in (g["min"], g["max"], *g["quantiles"].values())])
        left, step, low = 122.0, 24.0, len(used) * 24.0 + _TOP
        axis = Axis.over(ends, left, WIDTH - _RIGHT, is_log=name == "defect")
        shapes: list[dict[str, Any]] = []
        y_ticks: list[tuple[float, str]] = []
        for k, group in enumerate(used):
            y = _TOP + (k + 0.5) * step
            label = readable(group["label"])
            y_ticks.append((y, shorten(label, 18)))
            q5, q25, q50, q75, q95 = (
                axis.place(group["quantiles"][q]) for q in ("0.05", "0.25", "0.5", "0.75", "0.95")
            )
            words = f"{label}: median {number(group['quantiles']['0.5'])}, {count(group['n'])} rows"
            shapes.append({"kind": "line", "css": "whisker", "points": [(q5, y), (q95, y)]})
            shapes.append({"kind": "rect", "css": "box", "x": q25, "y": y - 7, "w": max(q75 - q25, 1.5), "h": 14,
                           "title": words})  # fmt: skip
            shapes.append({"kind": "line", "css": "median", "points": [(q50, y - 9), (q50, y + 9)]})
        score = _TITLES[name]
        charts.append(Chart(
            title=score.title, subtitle=score.meaning, shapes=shapes, y_ticks=y_ticks,
            x_ticks=axis.ticks(), height=low + _BOTTOM, left=left, bottom=low,
            alt=f"{score.title} by class: " + "; ".join(
                f"{readable(g['label'])} median {number(g['quantiles']['0.5'])}" for g in used),
        ))  # fmt: skip
    return charts


def outcome_bar(counts: dict[str, int]) -> list[dict[str, Any]]:
    """Shares of the outcomes, for one bar across the page."""
    total = sum(counts.values())
    return [
        {"name": name, "css": CLASS_OF[name], "n": n, "count": count(n), "share": percent(n, total),
         "width": 100.0 * n / total if total else 0.0}
        for name, n in counts.items()
    ]  # fmt: skip


def _binned(values: NDArray[np.float64], edges: NDArray[np.float64], zero_first: bool) -> NDArray[np.int64]:
    """Count values per bin, those beyond the ends in the last bin there."""
    if not zero_first:
        return np.histogram(np.clip(values, edges[0], edges[-1]), edges)[0]
    positive = np.clip(values[values > 0.0], edges[0], edges[-1])
    return np.concatenate([[int((values <= 0.0).sum())], np.histogram(positive, edges)[0]])


def _bin_place(axis: Axis, edges: NDArray[np.float64], j: int) -> tuple[float, float, str]:
    if axis.is_log:
        if j == 0:
            return axis.start + 4.0, axis.start + _ZERO - 4.0, "0"
        j -= 1
    low, high = float(edges[j]), float(edges[j + 1])
    return axis.place(low), axis.place(high), f"{number(low)} to {number(high)}"


def _thinned(x: NDArray[np.float64], y: NDArray[np.float64], most: int = 400) -> tuple[Any, Any]:
    """Keep a drawing small: points of a curve at even steps, both ends included."""
    if len(x) <= most:
        return x, y
    keep = np.unique(np.round(np.linspace(0, len(x) - 1, most)).astype(np.int64))
    return x[keep], y[keep]


def _tick(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000.0 else number(value)


def _round_numbers(low: float, high: float, n: int = 5) -> Sequence[float]:
    raw = (high - low) / n
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _round_up(value: float) -> float:
    if value <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0) if m * power >= value * (1 - 1e-12))
