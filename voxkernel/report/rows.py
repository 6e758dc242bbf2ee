"""The table of a run as plain columns, and the words and scores a report uses for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._frozen import Frozen

__all__ = [
    "ALL_SCORES", "CELL_SCORES", "KINDS", "LABEL_SCORES", "OUTCOMES", "SCORES", "ReportRows", "Score", "load_rows",
    "worst_first",
]  # fmt: skip

KINDS: tuple[str, ...] = ("surface", "cell", "object")
OUTCOMES: tuple[str, ...] = ("star-shaped", "degenerate", "not star-shaped", "failed")


class Score(NamedTuple):
    """A number that says how star-shaped a surface is."""

    name: str
    title: str
    column: str
    sign: int  # +1: larger means more star-shaped
    meaning: str


SCORES = (
    Score("ratio", "Ratio", "ratio", 1, "kernel volume over enclosed volume (open surfaces: over the domain's)"),
    Score("defect", "Defect", "violation_upper", -1, "share of the area that the best point does not face"),
    Score("visible", "Visible", "visible_fraction", 1, "share of the area really visible from the star centre"),
)
CELL_SCORES = (
    Score("volume_share", "Volume share", "volume_share", 1, "kernel volume over the cell's volume"),
    Score("inradius_over_diameter", "Inradius / diameter", "inradius_over_diameter", 1,
          "radius of the largest ball in the kernel over the cell's diameter"),
)  # fmt: skip


LABEL_SCORES = (
    Score("voxels_seen", "Seen from the best voxel", "voxels_seen", 1,
          "share of the object's voxels whose segment to its best voxel stays in the object (V*)"),
)  # fmt: skip


ALL_SCORES = (*SCORES, *CELL_SCORES, *LABEL_SCORES)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ReportRows(Frozen):
    """Columns of a run's table, in its order.

    Attributes
    ----------
    n : int
        Rows.
    texts : dict of str to list of str
        Text columns; "" where the table has null.
    numbers : dict of str to (n,) float64
        Number and truth columns; NaN where the table has null.
    lists : dict of str to list
        List columns; None where the table has null.
    outcome : list of str
        One of `OUTCOMES` for each row.
    """

    n: int
    texts: dict[str, list[str]]
    numbers: dict[str, NDArray[np.float64]]
    lists: dict[str, list[list[Any] | None]]
    outcome: list[str]

    def __repr__(self) -> str:
        """Name the number of rows."""
        return f"ReportRows(n={self.n})"

    def has(self, column: str) -> bool:
        """Say whether a number column has any number."""
        return bool(np.isfinite(self.numbers[column]).any())

    def kind(self, i: int) -> str:
        """Say what a row is: an "object" of a label image, a "cell" of a volume mesh, or else a "surface"."""
        if not np.isnan(self.numbers["object"][i]):
            return "object"
        return "surface" if np.isnan(self.numbers["cell"][i]) else "cell"

    def only(self, *kinds: str) -> ReportRows:
        """Give the rows of these kinds, in their order; a file that failed counts as a surface."""
        ids = [i for i in range(self.n) if self.kind(i) in kinds]
        if len(ids) == self.n:
            return self
        return ReportRows(
            len(ids),
            {name: [column[i] for i in ids] for name, column in self.texts.items()},
            {name: column[ids] for name, column in self.numbers.items()},
            {name: [column[i] for i in ids] for name, column in self.lists.items()},
            [self.outcome[i] for i in ids],
        )

    def name(self, i: int) -> str:
        """Name a row: its file, and its cell if it is one."""
        cell, number = self.numbers["cell"][i], self.numbers["object"][i]
        if not np.isnan(number):
            return f"{self.texts['file'][i]} object {int(number)}"
        return self.texts["file"][i] if np.isnan(cell) else f"{self.texts['file'][i]} cell {int(cell)}"

    def cause(self, i: int) -> str:
        """Why a row failed, without its own file name in front, so that equal causes are equal text."""
        reason, file = " ".join(self.texts["reason"][i].split()), " ".join(self.texts["file"][i].split())
        for name in (file, file.rpartition("/")[2]):
            if name and reason.startswith(f"'{name}'"):
                reason = reason[len(name) + 2 :].lstrip(" :")
                break
        return reason or "no reason was recorded"

    def ids(self, outcome: str) -> list[int]:
        """Give the rows with an outcome."""
        return [i for i, name in enumerate(self.outcome) if name == outcome]


def load_rows(run: str) -> ReportRows:
    """Read the table of a run.

    Raises
    ------
    FileNotFoundError
        If there is no run at `run`.
    """
    from voxkernel.run_table import open_run, read_rows

    fs, path = open_run(run)
    if not fs.exists(path):
        raise FileNotFoundError(f"`run` must be the output of an evaluation; got '{run}', which does not exist")
    if not fs.exists(f"{path}/rows") and not fs.exists(f"{path}/settings.json"):
        raise FileNotFoundError(f"`run` must be the output of an evaluation; got '{run}', which has no rows")
    return from_table(read_rows(run))


def from_table(table: Any) -> ReportRows:
    """Take the columns out of an Arrow table."""
    pa = optional("pyarrow")
    texts: dict[str, list[str]] = {}
    numbers: dict[str, NDArray[np.float64]] = {}
    lists: dict[str, list[list[Any] | None]] = {}
    for field in table.schema:
        column = table.column(field.name)
        if pa.types.is_string(field.type):
            texts[field.name] = ["" if value is None else value for value in column.to_pylist()]
        elif pa.types.is_list(field.type):
            lists[field.name] = column.to_pylist()
        else:
            numbers[field.name] = np.array(
                [np.nan if value is None else float(value) for value in column.to_pylist()], dtype=np.float64
            )
    outcome = [_outcome(s, v) for s, v in zip(texts["status"], texts["verdict"], strict=True)]
    return ReportRows(len(outcome), texts, numbers, lists, outcome)


def worst_first(rows: ReportRows, ids: Sequence[int]) -> list[int]:
    """Sort rows from the least star-shaped: larger defect or hidden share first, then smaller ratio, then the order."""
    defect = np.nan_to_num(rows.numbers["violation_upper"], nan=0.0)
    ratio = np.nan_to_num(rows.numbers["ratio"], nan=0.0)
    hidden = 1.0 - np.nan_to_num(rows.numbers["voxels_seen"], nan=1.0)
    return sorted(ids, key=lambda i: (-max(defect[i], hidden[i]), ratio[i], i))


def _outcome(status: str, verdict: str) -> str:
    """A row that is not ok, or has no known verdict, counts as failed: nothing is lost from the counts."""
    return verdict if status == "ok" and verdict in OUTCOMES else "failed"
