"""Surfaces, cells of volume meshes and objects of label images: never in one count or one picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from voxkernel.report.rows import KINDS, OUTCOMES, ReportRows

__all__ = ["kind_summary", "volume_meshes"]


def kind_summary(rows: ReportRows) -> dict[str, Any]:
    """Count rows and outcomes of each kind that there is."""
    found: dict[str, Any] = {}
    for kind in KINDS:
        own = rows.only(kind)
        if own.n:
            counts = own.outcome.counts()
            found[kind] = {"n": own.n, "counts": {name: counts.get(name, 0) for name in OUTCOMES}}
    return found


def volume_meshes(rows: ReportRows) -> list[dict[str, Any]]:
    """Sum up the cells of each volume mesh in one row, the one with the most cells without a kernel first."""
    own = rows.only("cell")
    places: dict[str, list[int]] = {}
    for i, file in enumerate(own.texts["file"]):
        places.setdefault(file, []).append(i)
    found: list[dict[str, Any]] = []
    for file, ids in places.items():
        counts = own.outcome.taken(np.array(ids)).counts()
        share = own.numbers["volume_share"][ids]
        share = share[np.isfinite(share)]
        found.append({
            "file": file, "cell": None, "n": len(ids), "counts": {name: counts.get(name, 0) for name in OUTCOMES},
            "smallest_share": float(share.min()) if len(share) else None,
            "median_share": float(np.median(share)) if len(share) else None,
        })  # fmt: skip
    return sorted(found, key=lambda m: (m["counts"]["star-shaped"] / m["n"], m["file"]))
