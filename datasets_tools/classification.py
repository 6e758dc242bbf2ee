"""What `classify` measures: verdicts against truth, defects against known ones, retrieval by descriptors."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

Row = Mapping[str, Any]
VERDICTS = ("star-shaped", "degenerate", "not star-shaped")
_FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Item:
    """A row of a run and the row of the manifest for the same file."""

    row: Row
    listed: Mapping[str, str]

    @property
    def label(self) -> str:
        """Class of the shape: the manifest's, or the folder it is in."""
        folders = str(self.row["file"]).split("/")[:-1]
        return self.listed.get("label") or (folders[-1] if folders else "-")

    @property
    def kind(self) -> str:
        """Finer class, where the manifest has one."""
        return f"{self.label}/{self.listed['kind']}" if self.listed.get("kind") else self.label

    @property
    def truth(self) -> str:
        """Right verdict, "broken", or "" where it is not known."""
        found = self.listed.get("truth")
        if found is None:
            yes_no = self.listed.get("is_star_shaped") or self.listed.get("kernel_nonempty")
            found = {"yes": "star-shaped", "no": "not star-shaped"}.get(yes_no or "", "")
        return found

    @property
    def answer(self) -> str:
        """Verdict of the run, or "failed"."""
        return str(self.row["verdict"]) if self.row["status"] == "ok" else _FAILED

    @property
    def series(self) -> str | None:
        """Shapes with one base have one name here."""
        parameters = json.loads(self.listed.get("parameters") or "{}")
        return f"{self.kind}/{parameters['series']}" if "series" in parameters else None

    def number(self, column: str) -> float | None:
        """Give a number of the manifest."""
        text = self.listed.get(column)
        return float(text) if text else None


def matched(rows: Sequence[Row], listed: Sequence[Mapping[str, str]]) -> tuple[list[Item], list[str], list[str]]:
    """Pair rows and manifest by the longest ending of the path that they share.

    Returns
    -------
    items : list of Item
        The pairs.
    missing : list of str
        Files of the manifest without a row.
    extra : list of str
        Files of the run that are not in the manifest.
    """
    by_file = {entry["file"]: entry for entry in listed}
    items: dict[str, Item] = {}
    extra = []
    for row in rows:
        parts = str(row["file"]).split("/")
        name = next((n for k in range(len(parts)) if (n := "/".join(parts[k:])) in by_file), None)
        if name is None:
            extra.append(str(row["file"]))
        else:
            items[name] = Item(row, by_file[name])
    return list(items.values()), [name for name in by_file if name not in items], extra


def verdicts(items: Sequence[Item]) -> dict[str, Any]:
    """Confusion of truth and verdict, and how many certificates were verified."""
    counts = Counter((item.truth, item.answer) for item in items if item.truth)
    truths = [t for t in (*VERDICTS, "broken") if any(t == truth for truth, _ in counts)]
    answers = [a for a in (*VERDICTS, _FAILED) if a in VERDICTS or any(a == answer for _, answer in counts)]
    known = sum(counts.values())
    right = sum(n for (t, a), n in counts.items() if t == a or (t, a) == ("broken", _FAILED))
    answered = [item for item in items if item.answer != _FAILED]
    return {
        "known": known,
        "right": right,
        "unknown": Counter(item.answer for item in items if not item.truth),
        "wrong": [item.listed["file"] for item in items if item.truth and not _is_right(item)],
        "confusion": {t: {a: counts[t, a] for a in answers} for t in truths},
        "certificates": len(answered),
        "verified": sum(item.row.get("certificate_verified") is True for item in answered),
        "labels": {
            label: Counter(item.answer for item in items if item.label == label)
            for label in sorted({item.label for item in items})
        },
    }


def _is_right(item: Item) -> bool:
    return item.truth == item.answer or (item.truth, item.answer) == ("broken", _FAILED)


def volumes(items: Sequence[Item]) -> dict[str, Any]:
    """Largest relative difference of kernel volumes from the known ones that are not 0; without a domain only."""
    whole = [item for item in items if item.answer != _FAILED and item.row.get("domain") is None]
    pairs = [(item.number("kernel_volume"), item.row["volume"]) for item in whole]
    errors = [abs(found / known - 1.0) for known, found in pairs if known and found is not None]
    return {"count": len(errors), "largest": max(errors, default=None)}


def defects(items: Sequence[Item]) -> dict[str, Any]:
    """Known smallest violations beside the bounds found: rank correlation, and how many lie between the bounds."""
    groups: dict[str, list[Item]] = {}
    for item in items:
        if item.number("defect") and item.answer != _FAILED:
            groups.setdefault("all", []).append(item)
            groups.setdefault(item.label, []).append(item)
            if item.kind != item.label:
                groups.setdefault(item.kind, []).append(item)
    return {name: _defects(groups[name]) for name in sorted(groups, key=lambda n: (n != "all", n))}


def _defects(items: Sequence[Item]) -> dict[str, Any]:
    known = [item.number("defect") or 0.0 for item in items]
    low = [item.row["violation_lower"] for item in items]
    high = [item.row["violation_upper"] for item in items]
    inside = [a * (1 - 1e-9) <= d <= b * (1 + 1e-9) for a, d, b in zip(low, known, high, strict=True)]
    return {
        "count": len(items),
        "smallest": min(known),
        "largest": max(known),
        "within_bounds": sum(inside),
        "spearman_upper": spearman(known, high),
        "spearman_lower": spearman(known, low),
        "median_gap": median(b - a for a, b in zip(low, high, strict=True)),
    }


def spearman(one: Sequence[float], other: Sequence[float]) -> float | None:
    """Rank correlation; None for fewer than three values or where all are equal."""
    if len(one) < 3 or len(set(one)) == 1 or len(set(other)) == 1:
        return None
    from scipy.stats import spearmanr

    return float(spearmanr(one, other).statistic)


# ---------------------------------------------------------------- retrieval


def profile_of(item: Item) -> list[float] | None:
    """Volume shares of the relaxed kernels."""
    shares = item.row.get("profile_shares")
    return list(shares) if shares else None


def energies_of(item: Item) -> list[float] | None:
    """Amplitudes per degree relative to degree 0, so that size does not count."""
    energies = item.row.get("energies")
    if not energies or any(e is None for e in energies) or not energies[0] > 0:
        return None
    return [(e / energies[0]) ** 0.5 for e in energies[1:]]


DESCRIPTORS: dict[str, tuple[Callable[[Item], list[float] | None], int]] = {
    "defect profile": (profile_of, 1),
    "spherical energies": (energies_of, 2),
}


def retrieval(items: Sequence[Item]) -> dict[str, Any]:
    """Leave-one-out nearest neighbours by each descriptor and by both.

    Shapes with one base never count as neighbours of each other when a class is asked for; of those the question is
    whether the nearest of all shapes has the same base. Only shapes that have all descriptors take part.
    """
    import numpy as np

    usable = [item for item in items if item.answer != _FAILED]
    chosen = [name for name, (get, _) in DESCRIPTORS.items() if any(get(item) for item in usable)]
    usable = [item for item in usable if all(DESCRIPTORS[name][0](item) for name in chosen)]
    if len(usable) < 3 or not chosen:
        return {}
    distances = {}
    for name in chosen:
        get, order = DESCRIPTORS[name]
        values = np.array([get(item) for item in usable])
        distances[name] = np.array([np.linalg.norm(values - v, ord=order, axis=1) for v in values])
    if len(chosen) > 1:
        distances["both"] = sum(d / np.median(d[d > 0]) if (d > 0).any() else d for d in distances.values())
    single = [i for i, item in enumerate(usable) if item.series is None]
    series = [i for i, item in enumerate(usable) if item.series is not None]
    found: dict[str, Any] = {"count": len(usable), "left_out": len(items) - len(usable), "label": {}, "kind": {}}
    for name, distance in distances.items():
        for what in ("label", "kind"):
            names = [getattr(usable[i], what) for i in single]
            found[what][name] = _accuracy(distance[np.ix_(single, single)], names)
        if series:
            own = [usable[i].series or str(i) for i in range(len(usable))]
            nearest = _nearest(distance)
            for label in sorted({usable[i].label for i in series}):
                hits = [own[int(nearest[i])] == own[i] for i in series if usable[i].label == label]
                entry = found.setdefault("series", {}).setdefault(label, {"count": len(hits), "accuracy": {}})
                entry["accuracy"][name] = sum(hits) / len(hits)
    return found


def _nearest(distance: Any) -> Any:
    import numpy as np

    others = distance + np.where(np.eye(len(distance), dtype=bool), np.inf, 0.0)
    return others.argmin(axis=1)


def _accuracy(distance: Any, names: Sequence[str]) -> dict[str, Any]:
    """Share of shapes whose nearest neighbour has the same name; only names with two shapes or more."""
    import numpy as np

    sizes = Counter(names)
    kept = [i for i, name in enumerate(names) if sizes[name] > 1]
    if len(kept) < 2:
        return {"count": 0, "accuracy": None, "chance": None, "classes": {}}
    names = [names[i] for i in kept]
    nearest = _nearest(distance[np.ix_(kept, kept)])
    hits = [names[int(n)] == name for n, name in zip(nearest, names, strict=True)]
    by_class = {c: [hit for hit, name in zip(hits, names, strict=True) if name == c] for c in sorted(set(names))}
    total = len(names)
    return {
        "count": total,
        "accuracy": sum(hits) / total,
        "chance": sum(len(h) * (len(h) - 1) for h in by_class.values()) / (total * (total - 1)),
        "classes": {c: {"count": len(h), "accuracy": sum(h) / len(h)} for c, h in by_class.items()},
    }


def classification(rows: Sequence[Row], listed: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """Measure everything; plain numbers, ready for JSON."""
    items, missing, extra = matched(rows, listed)
    seconds = [item.row["seconds"] for item in items if item.row.get("seconds") is not None]
    return {
        "meshes": len(items),
        "missing": missing,
        "not_in_manifest": extra,
        "verdicts": verdicts(items),
        "volumes": volumes(items),
        "defects": defects(items),
        "retrieval": retrieval(items),
        "seconds": {"sum": sum(seconds), "median": median(seconds) if seconds else None},
    }
