"""Objects of a label image that a worker gets together: as many as make about a second of work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["ObjectGroup", "Pace"]

_SECONDS = 1.0  # that a worker is busy with what it is sent
_GROWTH = 4.0  # at most, from one sending to the next


class ObjectGroup:
    """Labels of some objects, how much work each may be, how many the image has; what is known of those to draw."""

    __slots__ = ("ids", "n_objects", "rows", "work")

    def __init__(
        self,
        ids: NDArray[np.int64],
        work: NDArray[np.float64],
        n_objects: int,
        rows: tuple[Mapping[str, Any], ...] = (),
    ) -> None:
        self.ids, self.work, self.n_objects, self.rows = ids, work, n_objects, rows

    def __len__(self) -> int:
        """How many objects."""
        return len(self.ids)

    def cut(self, first: int, last: int) -> ObjectGroup:
        """Some neighbours of them."""
        return ObjectGroup(self.ids[first:last], self.work[first:last], self.n_objects, self.rows[first:last])


class Pace:
    """How much work makes a second, from what has come back."""

    def __init__(self) -> None:
        self._seconds, self._most = 0.0, 0.0  # of a unit of work; the most that was sent and came back

    def budget(self) -> float:
        """How much to send; 0 at first."""
        return min(_SECONDS / self._seconds, _GROWTH * self._most) if self._seconds > 0.0 else _GROWTH * self._most

    def note(self, work: float, seconds: float) -> None:
        """Take in how long some work has taken."""
        mean = seconds / work
        self._seconds += (0.5 if self._seconds else 1.0) * (mean - self._seconds)
        self._most = max(self._most, work)
