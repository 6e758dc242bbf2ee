"""A run in numbers: counts, failures, scores, profiles, times. Every form of the report says the same."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._npz import is_shallow, read_json
from voxkernel._sizes import size_notes
from voxkernel.report.kinds import kind_summary, volume_meshes
from voxkernel.report.labels import label_summary, labels_of
from voxkernel.report.objects import object_summary
from voxkernel.report.rows import (
    ALL_SCORES,
    CELL_SCORES,
    LABEL_SCORES,
    OUTCOMES,
    SCORES,
    ReportRows,
    Score,
    worst_first,
)
from voxkernel.report.statistics import quantiles, spearman

__all__ = ["read_left_out", "summarize"]

_LEVELS = 8  # of nested lists and mappings in settings and versions
_SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
_BAND = (0.1, 0.25, 0.5, 0.75, 0.9)


def read_left_out(run: str) -> list[tuple[str, int]] | None:
    """Read which suffixes the last evaluation left out, the most frequent first; None if it does not tell."""
    from voxkernel.run_table import read_settings

    found = read_settings(run).get("left_out")
    if found is None:
        return None
    if not isinstance(found, dict) or not all(type(n) is int and n > 0 for n in found.values()):
        wrong = f"`left_out` in the settings of '{run}' must be a number of files for each suffix"
        raise ValueError(f"{wrong}; got {repr(found)[:80]}")
    return sorted(found.items(), key=lambda item: (-item[1], item[0]))


def summarize(
    rows: ReportRows, *, run: str, left_out: Sequence[tuple[str, int]] | None, n_worst: int,
    star_labels: Sequence[str] | None,
) -> dict[str, Any]:  # fmt: skip
    """Say everything about a run that does not need its pictures."""
    from voxkernel._version import __version__

    counts = rows.outcome.counts()
    by_kind = {"surface": SCORES, "cell": CELL_SCORES, "object": LABEL_SCORES}
    own = {kind: rows.only(kind) for kind in by_kind}
    no_cells = rows.only("surface", "object")
    cells = np.isfinite(rows.numbers["cell"])

    def alone(found: Any) -> Any:
        """Hold no columns of the others with those that are large."""
        for some in (rows, no_cells, *own.values()):
            some.forget()
        return found

    return {
        "run": run,
        "version": __version__,
        "n_rows": rows.n,
        "n_files": rows.texts["file"].n_used(),
        "n_cells": int(cells.sum()),
        "n_objects": int(np.isfinite(rows.numbers["object"]).sum()),
        "kinds": kind_summary(rows),
        "volume_meshes": volume_meshes(rows),
        "objects": alone(object_summary(rows)),
        "left_out": None if left_out is None else [{"suffix": suffix, "n": n} for suffix, n in left_out],
        "counts": {name: counts.get(name, 0) for name in OUTCOMES},
        "failures": _failures(rows),
        "certificates": _certificates(rows),
        "other_scale": alone(_other_scale(own["surface"])),
        "scores": {
            s.name: _score(own[kind], s.column)
            for kind, scores in by_kind.items() for s in scores if own[kind].has(s.column)
        },
        "spearman": alone([pair for kind, scores in by_kind.items() for pair in _agreement(own[kind], scores)]),
        "profile": alone(_profile(rows)),
        "labels": alone(label_summary(no_cells if no_cells.n else rows, star_labels)),
        "worst": [_shape(no_cells, i) for i in _worst(no_cells)[:n_worst]],
        "worst_cells": [_shape(own["cell"], i) for i in _worst(own["cell"])[:n_worst]],
        "seconds": alone(_seconds(rows)),
        "settings": _distinct(rows, "settings"),
        "versions": _distinct(rows, "versions"),
        "finished": alone(_finished(rows)),
    }


def _failures(rows: ReportRows) -> dict[str, Any]:
    failed = rows.ids("failed")
    reasons = [rows.cause(i) for i in failed]
    groups = Counter(reasons)
    return {
        "n": len(failed),
        "reasons": [{"reason": r, "n": n} for r, n in sorted(groups.items(), key=lambda item: (-item[1], item[0]))],
        "rows": [{**_name(rows, i), "reason": reason} for i, reason in zip(failed, reasons, strict=True)],
    }


def _certificates(rows: ReportRows) -> dict[str, Any]:
    """An answer without a checked proof is no reason to fail, but a reader must know."""
    checked = rows.numbers["certificate_verified"]
    done = np.ones(rows.n, bool)
    done[rows.ids("failed")] = False
    return {
        "n_verified": int((done & (checked == 1.0)).sum()),
        "n_not_verified": int((done & (checked == 0.0)).sum()),
        "n_unknown": int((done & np.isnan(checked)).sum()),
        "not_verified": [_name(rows, i) for i in np.flatnonzero(done & (checked == 0.0)).tolist()],
    }


def _other_scale(rows: ReportRows) -> list[dict[str, Any]]:
    """Surfaces that may be in other units than the rest."""
    notes = size_notes([None if np.isnan(size) else float(size) for size in rows.numbers["diagonal"]])
    return [{**_name(rows, k), "note": note} for k, note in notes.items()]


def _score(rows: ReportRows, column: str) -> dict[str, Any]:
    values = rows.numbers[column]
    values = values[np.isfinite(values)]
    q = quantiles(values, _SHARES)
    return {
        "n": len(values), "n_zero": int((values == 0.0).sum()), "min": float(values.min()), "max": float(values.max()),
        "mean": float(values.mean()), "quantiles": dict(zip((f"{s:g}" for s in _SHARES), q, strict=True)),
    }  # fmt: skip


def _agreement(rows: ReportRows, scores: Sequence[Score]) -> list[dict[str, Any]]:
    """Rank correlation of the scores, each turned so that larger means more star-shaped."""
    found: list[dict[str, Any]] = []
    used = [s for s in scores if rows.has(s.column)]
    for a, b in combinations(used, 2):
        rho, n = spearman(a.sign * rows.numbers[a.column], b.sign * rows.numbers[b.column])
        found.append({"a": a.name, "b": b.name, "rho": rho, "n": n})
    return found


def _profile(rows: ReportRows) -> dict[str, Any] | None:
    """Median and spread of the defect profiles, over rows with the most frequent tolerances."""
    known = _usual_profiles(rows)
    if known is None:
        return None
    ids, tolerances, shares, n_known = known
    # A run with labels may have none where there is a profile: those rows are one group then.
    named = rows.texts["label"].taken(ids)
    labels = [label for label in labels_of(rows) if named.among([label]).any()]
    groups: list[dict[str, Any]] = []
    for label in labels or [""]:
        own = named.among([label]) if labels else np.ones(len(ids), bool)
        bands = np.stack([np.quantile(column[own], list(_BAND)) for column in shares.T], axis=1)
        groups.append({
            "label": label, "n": int(own.sum()),
            **dict(zip(("q10", "q25", "median", "q75", "q90"), bands, strict=True)),
        })  # fmt: skip
    return {"tolerances": tolerances, "n": len(ids), "n_other_tolerances": n_known - len(ids), "groups": groups}


def _usual_profiles(
    rows: ReportRows,
) -> tuple[NDArray[np.int64], list[float], NDArray[np.float64], int] | None:
    """Rows with the most frequent tolerances, these, the shares at them, and how many rows have a profile at all."""
    lengths, given = rows.lists["profile_tolerances"].arrays()
    other_lengths, shares = rows.lists["profile_shares"].arrays()
    starts, other_starts = np.cumsum(lengths) - lengths, np.cumsum(other_lengths) - other_lengths
    found: Counter[tuple[float, ...]] = Counter()
    members: dict[tuple[float, ...], tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
    for n in np.unique(lengths[(lengths > 0) & (lengths == other_lengths)]).tolist():
        ids = np.flatnonzero((lengths == n) & (other_lengths == n))
        own, its = given[starts[ids][:, None] + np.arange(n)], shares[other_starts[ids][:, None] + np.arange(n)]
        whole = np.isfinite(own).all(axis=1) & np.isfinite(its).all(axis=1)
        ids, own, its = ids[whole], own[whole], its[whole]
        if (own == own[:1]).all():  # as in nearly every run; sorting takes its time
            distinct, group = own[:1], np.zeros(len(own), np.int64)
        else:
            distinct, group = np.unique(own, axis=0, return_inverse=True)
        for k, tolerances in enumerate(map(tuple, distinct.tolist())):
            in_group = group.reshape(-1) == k
            found[tolerances] += int(in_group.sum())
            members[tolerances] = ids[in_group], its[in_group]
    if not found:
        return None
    first = {tolerances: int(members[tolerances][0][0]) for tolerances in found}
    usual = min(found, key=lambda tolerances: (-found[tolerances], first[tolerances]))
    return members[usual][0], list(usual), members[usual][1], sum(found.values())


def _worst(rows: ReportRows) -> list[int]:
    done = np.ones(rows.n, bool)
    done[rows.ids("failed")] = False
    return worst_first(rows, np.flatnonzero(done))


def _shape(rows: ReportRows, i: int) -> dict[str, Any]:
    scores = {s.name: float(rows.numbers[s.column][i]) for s in ALL_SCORES if rows.has(s.column)}
    return {
        **_name(rows, i), "label": rows.texts["label"][i], "verdict": rows.outcome[i], **scores,
        "n_facets": None if np.isnan(rows.numbers["n_facets"][i]) else int(rows.numbers["n_facets"][i]),
    }  # fmt: skip


def _name(rows: ReportRows, i: int) -> dict[str, Any]:
    cell, number = rows.numbers["cell"][i], rows.numbers["object"][i]
    found = {"file": rows.texts["file"][i], "cell": None if np.isnan(cell) else int(cell)}
    return found if np.isnan(number) else {**found, "object": int(number)}


def _seconds(rows: ReportRows) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in ("seconds", "seconds_read", "seconds_exact", "seconds_relaxed", "seconds_pictures"):
        values = rows.numbers[name]
        values = values[np.isfinite(values)]
        if len(values):
            median, late = quantiles(values, (0.5, 0.95))
            key = "all" if name == "seconds" else name.removeprefix("seconds_")
            found[key] = {"sum": float(values.sum()), "median": median, "q95": late, "max": float(values.max())}
    return found


def _distinct(rows: ReportRows, column: str) -> list[dict[str, Any]]:
    """Settings or versions in use, with the number of rows made with each."""
    groups = rows.texts[column].counts()
    groups.pop("", None)
    found: list[dict[str, Any]] = []
    for text, n in sorted(groups.items(), key=lambda item: (-item[1], item[0])):
        try:
            value = read_json(text)
        except ValueError:
            value = text
        if not is_shallow(value, _LEVELS):  # no settings of ours: shown as text
            value = text
        found.append({"n": n, "value": value})
    return found


def _finished(rows: ReportRows) -> dict[str, str] | None:
    times = rows.texts["finished"].extent()
    return {"first": times[0], "last": times[1]} if times else None
