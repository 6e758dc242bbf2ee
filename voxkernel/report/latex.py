"""The report as LaTeX for a paper: tables for the package booktabs, and the figures beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from voxkernel.report.rows import ALL_SCORES, OUTCOMES
from voxkernel.report.text import number, readable, shorten

__all__ = ["escaped", "render_latex"]

_SPECIAL = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': r"\textquotedbl{}", "'": r"\textquotesingle{}", "`": r"\textasciigrave{}", "-": "{-}",
}  # fmt: skip
_TITLES = {score.name: score.title for score in ALL_SCORES}
_HEAD = r"""% {title}: made by voxkernel {version}.
% Needs \usepackage{{booktabs}}{graphics} and, for letters beyond ASCII, LuaLaTeX or XeLaTeX with a font that has them.
% Quotation marks in names need \usepackage[T1]{{fontenc}} and \usepackage{{textcomp}}."""


def escaped(text: str, length: int = 60) -> str:
    """Write text of a file so that LaTeX prints it, whatever it contains."""
    return "".join(_SPECIAL.get(letter, letter) for letter in shorten(readable(text), length))


def render_latex(summary: dict[str, Any], *, title: str, figures: Sequence[tuple[str, str, float]] = ()) -> str:
    """Write verdicts, scores, labels, classes and a comparison as tables; `figures` are (file, caption, width)."""
    name = readable(title).encode("ascii", "backslashreplace").decode()
    head = _HEAD.format(title=name, version=summary["version"], graphics=r", \usepackage{graphicx}" if figures else "")
    parts = [head]
    for section in (_verdicts, _scores, _labels, _classes, _comparison):
        parts += section(summary)
    parts += [_figure(*figure) for figure in figures]
    return "\n\n".join(parts) + "\n"


def _verdicts(summary: dict[str, Any]) -> list[str]:
    kinds: dict[str, Any] = summary["kinds"] or {"surface": {"n": 0, "counts": summary["counts"]}}
    body = [[f"{kind}s", _whole(own["n"]), *(_whole(own["counts"][o]) for o in OUTCOMES)]
            for kind, own in kinds.items()]  # fmt: skip
    return [_table("Verdicts", "verdicts", ["", "rows", *OUTCOMES], body)]


def _scores(summary: dict[str, Any]) -> list[str]:
    body = [
        [_TITLES[name].lower(), _whole(s["n"]), *(_real(s["quantiles"][q]) for q in ("0.05", "0.25", "0.5", "0.75",
         "0.95")), _real(s["max"])]
        for name, s in summary["scores"].items()
    ]  # fmt: skip
    heads = ["score", "rows", r"5\,\%", r"25\,\%", "median", r"75\,\%", r"95\,\%", "largest"]
    return [_table("Scores: quantiles over the rows that have them", "scores", heads, body)] if body else []


def _labels(summary: dict[str, Any]) -> list[str]:
    labels = summary["labels"]
    if labels is None:
        return []
    body = [[escaped(name), *map(_whole, row)] for name, row in zip(labels["names"], labels["counts"], strict=True)]
    parts = [_table("Labels against verdicts", "labels", ["label", *OUTCOMES], body)]
    names = [score.name for score in ALL_SCORES if any(score.name in entry["scores"] for entry in labels["roc"])]
    if names:
        areas = [[escaped(entry["label"]), *(_real(entry["scores"].get(n, {}).get("auc")) for n in names)]
                 for entry in labels["roc"]]  # fmt: skip
        parts.append(_table("Area under the ROC curve", "roc", ["class", *(_TITLES[n].lower() for n in names)], areas))
    return parts


def _classes(summary: dict[str, Any]) -> list[str]:
    classes = summary["classes"]
    if classes is None:
        return []
    heads = [escaped(name, 40) for name in classes["names"]]
    rules = "; ".join(escaped(rule["text"], 120) for rule in classes["rules"])
    body = [[f"{kind}s", *map(_whole, counts)] for kind, counts in classes["kinds"].items()]
    parts = [_table(f"Classes, by the first that holds of {rules}", "classes", ["", *heads], body)]
    labels = classes["labels"]
    if labels is not None:
        judged = labels["agreement"]
        more = ["recall", "precision"] if judged else []
        body = [
            [escaped(name), *map(_whole, row), *(_real(judged["each"][name][key]) for key in more)]
            for name, row in zip(labels["names"], labels["counts"], strict=True)
        ]
        words = "Labels against classes" + (f"; accuracy {_real(judged['accuracy'])}" if judged else "")
        parts.append(_table(words, "confusion", ["label", *heads, *more], body))
    return parts


def _comparison(summary: dict[str, Any]) -> list[str]:
    found = summary["comparison"]
    if found is None:
        return []
    names = escaped(found["before"], 40), escaped(found["now"], 40)
    body = [[o, *map(_whole, row)] for o, row in zip(OUTCOMES, found["counts"], strict=True)]
    moved = [
        [_TITLES[name].lower(), *(_whole(m[key]) for key in ("n", "n_equal", "n_better", "n_worse")),
         _real(m["largest_change"])]
        for name, m in found["scores"].items()
    ]  # fmt: skip
    return [
        _table(f"Verdicts of {names[0]} (rows) and of {names[1]} (columns)", "changes", ["before", *OUTCOMES], body),
        *([_table(f"Scores from {names[0]} to {names[1]}", "moved",
                  ["score", "rows", "equal", "better", "worse", "largest change"], moved)] if moved else []),
    ]  # fmt: skip


def _table(caption: str, label: str, heads: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """A table with rules of booktabs; the first column is words, the others numbers."""
    lines = [" & ".join(cells) + r" \\" for cells in (heads, *body)]
    return "\n".join([
        r"\begin{table}", r"  \centering\small\setlength{\tabcolsep}{4pt}",
        rf"  \caption{{{caption}.}}", rf"  \label{{tab:voxkernel-{label}}}",
        rf"  \begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}", r"    \toprule", f"    {lines[0]}", r"    \midrule",
        *(f"    {line}" for line in lines[1:]), r"    \bottomrule", r"  \end{tabular}", r"\end{table}",
    ])  # fmt: skip


def _figure(file: str, caption: str, width: float) -> str:
    return "\n".join([
        r"\begin{figure}", r"  \centering", rf"  \includegraphics[width={width:.2f}\linewidth]{{{file}}}",
        rf"  \caption{{{caption}}}", r"\end{figure}",
    ])  # fmt: skip


def _whole(value: int) -> str:
    return f"{value:,}".replace(",", r"\,")


def _real(value: float | None) -> str:
    """A number as LaTeX sets it: powers of ten, not the letter e."""
    if value is None or not math.isfinite(value):
        return "--"
    digits, _, power = number(value, 3).partition("e")
    return f"${digits}\\times 10^{{{int(power)}}}$" if power else f"${digits}$"
