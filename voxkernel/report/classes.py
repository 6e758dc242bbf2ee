"""Classes by thresholds that a user gives: read, given to rows, counted against the labels."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.report.columns import Texts, cross_counts
from voxkernel.report.labels import labels_of
from voxkernel.report.rows import ALL_SCORES, KINDS, ReportRows

__all__ = ["FAILED", "REST", "ClassRule", "class_rules", "class_summary", "with_classes"]

REST, FAILED = "none of these", "failed"

_COMPARE: dict[str, Callable[[Any, float], Any]] = {
    "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt, "=": operator.eq,
}  # fmt: skip
_CONDITION = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\s*(<=|>=|<|>|=)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")


class ClassRule(NamedTuple):
    """A class and what must hold of a row for it: (score or column, comparison, number), all of them."""

    name: str
    conditions: tuple[tuple[str, str, float], ...]

    def __str__(self) -> str:
        """Write it as it is given."""
        return f"{self.name}: {' '.join(f'{column}{sign}{limit:g}' for column, sign, limit in self.conditions)}"


def class_rules(texts: Sequence[str]) -> list[ClassRule]:
    """Read classes such as "nearly star-shaped: defect<0.01"; several in one text stand between semicolons.

    Raises
    ------
    ValueError
        If one has no name or no comparison, or two have one name.
    """
    rules: list[ClassRule] = []
    for text in (part for given in texts for part in given.split(";") if part.strip()):
        name, colon, rest = (part.strip() for part in text.rpartition(":"))
        found = [(m[1], m[2], float(m[3])) for m in _CONDITION.finditer(rest)]
        if not (name and colon and found) or _CONDITION.sub("", rest).strip(" ,"):
            wanted = "a name, a colon and comparisons, such as 'nearly star-shaped: defect<0.01'"
            raise ValueError(f"`classes` must be {wanted}; got '{text.strip()}'")
        if name in (REST, FAILED) or name in [rule.name for rule in rules]:
            raise ValueError(f"`classes` must have names of their own; got '{name}' twice")
        rules.append(ClassRule(name, tuple(found)))
    if not rules:
        raise ValueError("`classes` must hold at least one class; got none")
    return rules


def with_classes(rows: ReportRows, rules: Sequence[ClassRule]) -> ReportRows:
    """Give each row the first class whose comparisons all hold; a number that a row does not have holds none."""
    names = [*(rule.name for rule in rules), REST, FAILED]
    codes = np.full(rows.n, names.index(REST), dtype=np.int32)
    free = np.ones(rows.n, dtype=bool)
    free[rows.ids("failed")] = False
    codes[~free] = names.index(FAILED)
    for k, rule in enumerate(rules):
        holds = free.copy()
        for column, sign, limit in rule.conditions:
            holds &= _COMPARE[sign](_numbers(rows, column), limit)  # NaN compares as false
        codes[holds] = k
        free &= ~holds
    return rows.with_columns({"class": Texts.of_words(codes, names)})


def class_summary(rows: ReportRows, rules: Sequence[ClassRule]) -> dict[str, Any]:
    """Count the classes of each kind of row, and against the labels where there are any."""
    names = [*(rule.name for rule in rules), REST, FAILED]
    kinds: dict[str, list[int]] = {}
    for kind in KINDS:
        own = rows.only(kind)
        if own.n:
            counted = own.texts["class"].counts()
            kinds[kind] = [counted[name] for name in names]
    no_cells = rows.only("surface", "object")
    labelled = no_cells if no_cells.n else rows
    labels = labels_of(labelled)
    counts = cross_counts(labelled.texts["label"], labelled.texts["class"], labels, names)
    return {
        "rules": [{"name": rule.name, "text": str(rule)} for rule in rules],
        "names": names,
        "kinds": kinds,
        "labels": {"names": labels, "counts": counts.tolist(), "agreement": _agreement(labels, names, counts)}
        if labels else None,
    }  # fmt: skip


def _agreement(labels: list[str], names: list[str], counts: NDArray[np.int64]) -> dict[str, Any] | None:
    """How often class and label are one, with recall and precision; None unless every label names a class."""
    place = {name.casefold().replace("_", " "): k for k, name in enumerate(names[:-1])}
    columns = [place.get(label.casefold().replace("_", " ")) for label in labels]
    if None in columns or len(set(columns)) < len(columns):
        return None
    judged = counts[:, :-1]  # those that failed have no class
    n = int(judged.sum())
    each: dict[str, dict[str, float | None]] = {}
    right = 0
    for i, (label, k) in enumerate(zip(labels, columns, strict=True)):
        hits, own, called = int(judged[i, k or 0]), int(judged[i].sum()), int(judged[:, k or 0].sum())
        each[label] = {"recall": hits / own if own else None, "precision": hits / called if called else None}
        right += hits
    return {"n": n, "n_right": right, "accuracy": right / n if n else None, "each": each}


def _numbers(rows: ReportRows, name: str) -> NDArray[np.float64]:
    """Numbers of a score by its name, such as "defect", or of any column of numbers."""
    column = {score.name: score.column for score in ALL_SCORES}.get(name.lower(), name.lower())
    if column not in rows.numbers:
        scores = ", ".join(score.name for score in ALL_SCORES)
        raise ValueError(f"`classes` must compare scores ({scores}) or other columns of numbers; got '{name}'")
    return rows.numbers[column]
