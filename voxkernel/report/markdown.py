"""The report as a short Markdown text, for a pull request."""

from __future__ import annotations

from typing import Any

from voxkernel.report.rows import CELL_SCORES, OUTCOMES, SCORES
from voxkernel.report.text import code_span, count, left_out_text, number, percent

__all__ = ["render_markdown"]

_MOST_REASONS = 10
_MOST_FILES = 20


def render_markdown(summary: dict[str, Any], *, title: str) -> str:
    """Write summary, failures, labels and the worst rows; every name and reason as code."""
    parts = [f"## voxkernel report: {code_span(title)}", _counts(summary)]
    sections = (
        _left_out, _failures, _proofs, _comparison, _classes, _objects, _labels, _scores, _worst, _worst_cells,
    )  # fmt: skip
    for section in sections:
        text = section(summary)
        if text:
            parts.append(text)
    parts.append(f"voxkernel {summary['version']}")
    return "\n\n".join(parts) + "\n"


def _counts(summary: dict[str, Any]) -> str:
    kinds: dict[str, Any] = summary["kinds"] or {"surface": {"n": 0, "counts": summary["counts"]}}
    body: list[tuple[str, ...]] = []
    for kind, own in kinds.items():
        shares = [f"{count(own['counts'][name])} ({percent(own['counts'][name], own['n'])})" for name in OUTCOMES]
        body.append((*([f"{kind}s"] if len(kinds) > 1 else []), count(own["n"]), *shares))
    return _table((*(["kind"] if len(kinds) > 1 else []), "rows", *OUTCOMES), body, right=5)


def _left_out(summary: dict[str, Any]) -> str:
    text = left_out_text([(group["suffix"], group["n"]) for group in summary["left_out"] or ()], code_span)
    return f"{text}." if text else ""


def _failures(summary: dict[str, Any]) -> str:
    failures = summary["failures"]
    if not failures["n"]:
        return "No row failed."
    lines = [f"### {count(failures['n'])} failed"]
    reasons, rows = failures["reasons"], failures["rows"]
    if len(rows) <= _MOST_FILES:
        lines += [f"- {_name(row)}: {code_span(' '.join(row['reason'].split()), 200)}" for row in rows]
        return "\n".join(lines)
    lines += [f"- {count(group['n'])} × {code_span(' '.join(group['reason'].split()), 200)}"
              for group in reasons[:_MOST_REASONS]]  # fmt: skip
    if len(reasons) > _MOST_REASONS:
        lines.append(f"- and {count(len(reasons) - _MOST_REASONS)} more reasons")
    lines.append(f"\nThe first {_MOST_FILES} files: " + ", ".join(_name(row) for row in rows[:_MOST_FILES]))
    return "\n".join(lines)


def _proofs(summary: dict[str, Any]) -> str:
    n = summary["certificates"]["n_not_verified"]
    return f"**{count(n)} answers whose proof was not confirmed.**" if n else ""


def _comparison(summary: dict[str, Any]) -> str:
    found = summary["comparison"]
    if found is None:
        return ""
    lines = [
        f"### Compared with {code_span(found['before'])}", "",
        f"Of {count(found['n_both'])} rows in both runs {count(found['n_changed'])} verdicts changed: "
        f"**{count(found['regressions']['n'])} regressions**, {count(found['improvements']['n'])} improvements. "
        f"{count(found['only_now']['n'])} rows are only in this run, {count(found['only_before']['n'])} only in the "
        "other.",
    ]  # fmt: skip
    rows = found["regressions"]["rows"][:_MOST_FILES]
    if rows:
        body = [
            (code_span(row["name"]), row["before"], row["now"] + (", proof lost" if row["proof_lost"] else ""),
             *(f"{number(pair[0])} → {number(pair[1])}" for pair in (row["scores"].get("defect", (None, None)),)))
            for row in rows
        ]  # fmt: skip
        lines += ["", _table(("regression", "before", "now", "defect"), body, right=1)]
    if found["scores"]:
        body = [
            (name, *(count(m[key]) for key in ("n", "n_equal", "n_better", "n_worse")), number(m["largest_change"]))
            for name, m in found["scores"].items()
        ]
        heads = ("score", "rows", "equal", "better", "worse", "largest change")
        lines += ["", _table(heads, body, right=5)]
    return "\n".join(lines)


def _classes(summary: dict[str, Any]) -> str:
    classes = summary["classes"]
    if classes is None:
        return ""
    heads = tuple(code_span(name, 60) for name in classes["names"])
    lines = ["### Classes", "", "; ".join(code_span(rule["text"]) for rule in classes["rules"]) + ".", ""]
    body = [(f"{kind}s", *map(count, counts)) for kind, counts in classes["kinds"].items()]
    lines.append(_table(("", *heads), body, right=len(heads)))
    labels = classes["labels"]
    if labels is not None:
        body = [(code_span(name, 60), *map(count, row))
                for name, row in zip(labels["names"], labels["counts"], strict=True)]  # fmt: skip
        lines += ["", _table(("label", *heads), body, right=len(heads))]
        if labels["agreement"]:
            judged = labels["agreement"]
            lines += ["", f"The class is the label of {count(judged['n_right'])} of {count(judged['n'])} labelled "
                      f"rows: accuracy {number(judged['accuracy'])}."]  # fmt: skip
    return "\n".join(lines)


def _objects(summary: dict[str, Any]) -> str:
    objects = summary["objects"]
    if objects is None:
        return ""
    body = [(code_span(reason, 60), count(n), percent(n, objects["n"])) for reason, n in objects["shortfalls"].items()]
    rays = objects["recommended_rays"]
    return "\n".join([
        f"### {count(objects['n'])} objects of label images", "",
        f"{count(objects['n_star'])} are seen whole from one voxel, {count(objects['n_not_star'])} certainly from none"
        + (f"; {rays} rays bring 90 % of them to an overlap of 0.8." if rays else "."),
        "", _table(("falls short by", "objects", "share"), body, right=2),
    ])  # fmt: skip


def _labels(summary: dict[str, Any]) -> str:
    labels = summary["labels"]
    if labels is None:
        return ""
    table = [(code_span(name, 60), *map(count, row)) for name, row in zip(labels["names"], labels["counts"],
                                                                         strict=True)]  # fmt: skip
    lines = ["### Labels", "", _table(("label", *OUTCOMES), table, right=4)]
    truth = labels["truth"]
    if truth:
        lines += ["", f"{count(truth['n_right'])} of {count(truth['n'])} verdicts agree with the label: accuracy "
                  f"{number(truth['accuracy'])}, sensitivity {number(truth['sensitivity'])}, specificity "
                  f"{number(truth['specificity'])}."]  # fmt: skip
    if labels["roc"]:
        names = [s.name for s in (*SCORES, *CELL_SCORES) if any(s.name in entry["scores"] for entry in labels["roc"])]
        body = [
            (code_span(entry["label"], 60), *(number(entry["scores"].get(n, {}).get("auc")) for n in names))
            for entry in labels["roc"]
        ]
        heading = "class" if truth else "label against the others"
        lines += ["", "Area under the ROC curve:", "", _table((heading, *names), body, right=len(names))]
    return "\n".join(lines)


def _scores(summary: dict[str, Any]) -> str:
    if not summary["scores"]:
        return ""
    body = [
        (name, count(s["n"]), *(number(s["quantiles"][q]) for q in ("0.05", "0.5", "0.95")), number(s["max"]))
        for name, s in summary["scores"].items()
    ]
    return "### Scores\n\n" + _table(("score", "rows", "5 %", "median", "95 %", "max"), body, right=5)


def _worst(summary: dict[str, Any]) -> str:
    return _listed(summary["worst"], "least star-shaped")


def _worst_cells(summary: dict[str, Any]) -> str:
    return _listed(summary["worst_cells"], "least star-shaped cells")


def _listed(worst: list[dict[str, Any]], words: str) -> str:
    if not worst:
        return ""
    names = [s.name for s in (*SCORES, *CELL_SCORES) if s.name in worst[0]]
    labelled = any(row["label"] for row in worst)
    body = [
        (_name(row), *([code_span(row["label"], 60) if row["label"] else ""] if labelled else []), row["verdict"],
         *(number(row[name]) for name in names))
        for row in worst
    ]  # fmt: skip
    heads = ("file", *(["label"] if labelled else []), "verdict", *names)
    return f"### The {len(worst)} {words}\n\n" + _table(heads, body, right=len(names))


def _name(row: dict[str, Any]) -> str:
    name = code_span(row["file"])
    return name if row["cell"] is None else f"{name} cell {row['cell']}"


def _table(heads: tuple[str, ...], body: list[tuple[str, ...]], *, right: int) -> str:
    rules = ["---"] * (len(heads) - right) + ["--:"] * right
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (heads, rules, *body))
