"""Figures for a paper beside a LaTeX report: histograms of scores and ROC curves, as PDF and SVG, by Matplotlib."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel._output_file import whole_file
from voxkernel.report.rows import ALL_SCORES, CELL_SCORES, LABEL_SCORES, OUTCOMES, SCORES, ReportRows, Score

__all__ = ["write_figures"]

# Of the page, apart for every kind of colour vision and in grey.
_COLORS = dict(zip(OUTCOMES, ("#2678a8", "#e0a92e", "#b3372c", "#3f4650"), strict=True))
_LINES = (("#2678a8", "-"), ("#b3372c", "--"), ("#8a6d00", ":"), ("#4d8b31", "-."), ("#7a4fa3", (0, (5, 1, 1, 1))))
_LINE = 6.6  # inches of a figure over the whole line
_TITLES = {score.name: score.title for score in ALL_SCORES}
_STYLE = {
    "font.size": 8, "axes.titlesize": 8, "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6,
    "legend.fontsize": 7, "legend.frameon": False, "pdf.fonttype": 42, "svg.fonttype": "none",
    "svg.hashsalt": "voxkernel", "text.usetex": False, "text.parse_math": False,
}  # fmt: skip


def write_figures(report: Path, rows: ReportRows, summary: dict[str, Any]) -> list[tuple[str, str, float]]:
    """Write each figure as `.pdf` and `.svg` beside the report; gives each PDF, its caption and its width."""
    matplotlib = optional("matplotlib")
    Figure = optional("matplotlib.figure").Figure
    stem = re.sub(r"[^A-Za-z0-9.-]", "-", report.stem)  # a name that LaTeX takes as it is
    made: list[tuple[str, str, float]] = []

    def add(name: str, caption: str, width: float, draw: Callable[[Any], None]) -> None:
        with matplotlib.rc_context(_STYLE):
            figure = Figure(figsize=(width, 2.3), layout="constrained")
            draw(figure)
            for suffix, when in (("pdf", {"CreationDate": None}), ("svg", {"Date": None})):
                stream = io.BytesIO()
                figure.savefig(stream, format=suffix, metadata=when)
                with whole_file(report.parent / f"{stem}-{name}.{suffix}") as file:
                    file.write(stream.getvalue())
        made.append((f"{stem}-{name}.pdf", caption, min(1.0, width / _LINE)))

    for kind, scores in (("surface", SCORES), ("cell", CELL_SCORES), ("object", LABEL_SCORES)):
        own = rows.only(kind)
        used = [score for score in scores if own.has(score.column)]
        if used:
            words = "; ".join(f"{score.title.lower()}: {score.meaning}" for score in used)
            caption = f"Scores of {kind}s, by verdict. {words[:1].upper()}{words[1:]}."
            add(f"{kind}s", caption, 2.2 * max(len(used), 1.6),
                lambda figure, own=own, used=used: _histograms(figure, own, used))  # fmt: skip
    roc = summary["labels"]["roc"] if summary["labels"] else []
    if roc:
        add("roc", "Receiver operating characteristic of the scores.", 2.2 * min(len(roc), 3),
            lambda figure: _curves(figure, roc[:3]))  # fmt: skip
    return made


def _histograms(figure: Any, rows: ReportRows, scores: list[Score]) -> None:
    outcome = np.array(rows.outcome, dtype=object)
    shown = [name for name in OUTCOMES if name != "failed" and (outcome == name).any()]
    axes = figure.subplots(1, len(scores), squeeze=False)[0]
    for axis, score in zip(axes, scores, strict=True):
        values = rows.numbers[score.column]
        known = np.isfinite(values)
        if score.name == "defect" and (values[known] > 0.0).any():
            _logarithmic(axis, values[known])
        else:
            top = float(values[known].max())
            axis.set_xlim(0.0, 1.0 if 0.3 < top <= 1.0 else top * 1.05 or 1.0)
        low, high = axis.get_xlim()
        edges = np.geomspace(low, high, 25) if axis.get_xscale() == "log" else np.linspace(low, high, 25)
        groups = [np.clip(values[known & (outcome == name)], edges[0], edges[-1]) for name in shown]
        axis.hist(groups, bins=edges, stacked=True, color=[_COLORS[name] for name in shown], label=shown)
        axis.set_xlabel(score.title.lower())
    axes[0].set_ylabel("rows")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(shown))


def _logarithmic(axis: Any, values: Any) -> None:
    """Decades, and before them one column for zero."""
    positive = values[values > 0.0]
    low = 10.0 ** max(-12, int(np.floor(np.log10(positive.min()))) - 1)
    high = 10.0 ** int(np.ceil(np.log10(positive.max()) + 1e-9))
    axis.set_xscale("log")
    axis.set_xlim(low, high)
    ticks = 10.0 ** np.arange(round(np.log10(low)), round(np.log10(high)) + 1)
    if len(ticks) > 6:
        ticks = np.unique(np.r_[ticks[0], ticks[2 :: len(ticks) // 4], ticks[-1]])
    words = ["0" if k == 0 else rf"{tick:.0e}".replace("e-0", "e-").replace("e+00", "") for k, tick in enumerate(ticks)]
    axis.set_xticks(ticks, words)
    axis.minorticks_off()


def _curves(figure: Any, entries: list[dict[str, Any]]) -> None:
    axes = figure.subplots(1, len(entries), squeeze=False)[0]
    for axis, entry in zip(axes, entries, strict=True):
        axis.plot([0, 1], [0, 1], color="#9aa5b1", linewidth=0.6)
        for (name, found), (color, dash) in zip(entry["scores"].items(), _LINES, strict=False):
            curve = found["curve"]
            axis.plot(curve.false_positive_rate, curve.true_positive_rate, color=color, linestyle=dash, linewidth=1.2,
                      label=f"{_TITLES[name].lower()} {found['auc']:.3f}")  # fmt: skip
        axis.set(xlim=(0, 1), ylim=(0, 1.01), xlabel="share of the others", title=entry["label"][:40])
        axis.set_aspect("equal")
        axis.legend(loc="lower right")
    axes[0].set_ylabel("share of the class")
