"""Meshes of a data set that are a thousand times smaller or larger than the others: mostly metres among millimetres."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

__all__ = ["size_notes"]

_OTHER_SCALE = 1000.0


def size_notes(diagonals: Sequence[float | None]) -> dict[int, str]:
    """Say which of these sizes are far from their median, by position; nothing is said of fewer than three."""
    sizes = [size for size in diagonals if size and math.isfinite(size)]
    middle = statistics.median(sizes) if len(sizes) > 2 else 0.0
    found: dict[int, str] = {}
    for k, size in enumerate(diagonals):
        share = size / middle if size and math.isfinite(size) and middle else 1.0
        if not 1.0 / _OTHER_SCALE < share < _OTHER_SCALE:
            times = max(share, 1.0 / share)
            words = f"{times:,.0f}" if times < 1e6 else f"{times:.3g}"
            how = "as large as" if share > 1.0 else "smaller than"
            found[k] = f"{words} times {how} the median of {len(sizes):,} meshes: other units?"
    return found
