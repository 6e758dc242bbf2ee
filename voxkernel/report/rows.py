"""The table of a run as plain columns, and the words and scores a report uses for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._frozen import Frozen
from voxkernel.report.columns import Columns, Lists, Texts, numbers_of
from voxkernel.run_index import RunIndex, open_index

__all__ = [
    "ALL_SCORES",
    "CELL_SCORES",
    "KINDS",
    "LABEL_SCORES",
    "OUTCOMES",
    "SCORES",
    "ReportRows",
    "Score",
    "from_index",
    "open_run_index",
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
    texts : Columns of Texts
        Text columns; "" where the table has null.
    numbers : Columns of (n,) float64
        Number and truth columns; NaN where the table has null.
    lists : Columns of Lists
        List columns; None where the table has null.
    outcome : Texts
        One of `OUTCOMES` for each row.
    """

    n: int
    texts: Columns[Texts]
    numbers: Columns[NDArray[np.float64]]
    lists: Columns[Lists]
    outcome: Texts

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
        is_object, is_cell = (np.isfinite(self.numbers[name]) for name in ("object", "cell"))
        own = np.where(is_object, "object" in kinds, np.where(is_cell, "cell" in kinds, "surface" in kinds))
        return self if own.all() else self.taken(np.flatnonzero(own))

    def taken(self, ids: NDArray[np.int64]) -> ReportRows:
        """Give some rows; what is read of them is read of all."""
        return ReportRows(
            len(ids),
            Columns(list(self.texts), lambda name: self.texts[name].taken(ids), self.texts),
            Columns(list(self.numbers), lambda name: self.numbers[name][ids], self.numbers),
            Columns(list(self.lists), lambda name: self.lists[name].taken(ids), self.lists),
            self.outcome.taken(ids),
        )

    def with_columns(
        self, texts: Mapping[str, Texts], numbers: Mapping[str, NDArray[np.float64]] | None = None
    ) -> ReportRows:
        """Give the same rows with more columns."""
        numbers = numbers or {}
        return ReportRows(
            self.n,
            Columns([*self.texts, *texts], lambda name: texts[name] if name in texts else self.texts[name], self.texts),
            Columns(
                [*self.numbers, *numbers],
                lambda name: numbers[name] if name in numbers else self.numbers[name],
                self.numbers,
            ),
            self.lists,
            self.outcome,
        )

    def forget(self) -> None:
        """Free the memory of columns between two uses, but for the texts that nearly every use needs."""
        self.texts.forget(("file", "label"))
        self.numbers.forget()
        self.lists.forget()
        optional("pyarrow").default_memory_pool().release_unused()

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
        codes = [k for k, word in enumerate(self.outcome.words.to_pylist()) if word == outcome]
        return np.flatnonzero(np.isin(self.outcome.codes, codes)).tolist()


def open_run_index(run: str) -> RunIndex:
    """Index the rows of a run that count; columns are read later, when they are asked for.

    Raises
    ------
    FileNotFoundError
        If there is no run at `run`.
    """
    from voxkernel.run_table import open_run

    fs, path = open_run(run)
    if not fs.exists(path):
        raise FileNotFoundError(f"`run` must be the output of an evaluation; got '{run}', which does not exist")
    if not fs.exists(f"{path}/rows") and not fs.exists(f"{path}/settings.json"):
        raise FileNotFoundError(f"`run` must be the output of an evaluation; got '{run}', which has no rows")
    index = open_index(fs, path)
    index.forget_keys()
    return index


def from_index(index: RunIndex) -> ReportRows:
    """Take columns out of a run when they are needed."""
    from voxkernel.run_table import schema

    return _rows(schema(), len(index), index.table, lambda name: Texts(*index.words(name)))


def from_table(table: Any) -> ReportRows:
    """Take the columns out of an Arrow table."""
    return _rows(table.schema, table.num_rows, table.select, lambda name: Texts.of_column(table.column(name)))


def _rows(schema: Any, n: int, read: Callable[[list[str]], Any], text: Callable[[str], Texts]) -> ReportRows:
    types = optional("pyarrow").types
    texts = [field.name for field in schema if types.is_string(field.type)]
    lists = [field.name for field in schema if types.is_list(field.type)]
    numbers = [field.name for field in schema if field.name not in {*texts, *lists}]

    def column(name: str) -> Any:
        return read([name]).column(0)

    return ReportRows(
        n,
        Columns(texts, text),
        Columns(numbers, lambda name: numbers_of(column(name))),
        Columns(lists, lambda name: Lists(column(name))),
        _outcomes(column("status"), column("verdict")),
    )


def worst_first(rows: ReportRows, ids: Sequence[int] | NDArray[np.int64]) -> list[int]:
    """Sort rows from the least star-shaped: larger defect or hidden share first, then smaller ratio, then the order."""
    own = np.asarray(ids, np.int64)
    defect = np.nan_to_num(rows.numbers["violation_upper"][own], nan=0.0)
    ratio = np.nan_to_num(rows.numbers["ratio"][own], nan=0.0)
    hidden = 1.0 - np.nan_to_num(rows.numbers["voxels_seen"][own], nan=1.0)
    return own[np.lexsort((own, ratio, -np.maximum(defect, hidden)))].tolist()


def _outcomes(status: Any, verdict: Any) -> Texts:
    """A row that is not ok, or has no known verdict, counts as failed: nothing is lost from the counts."""
    pa, compute = optional("pyarrow"), optional("pyarrow.compute")
    words = pa.array(OUTCOMES, pa.large_string())
    found = compute.index_in(verdict.cast(pa.large_string()), value_set=words)
    codes = found.fill_null(OUTCOMES.index("failed")).to_numpy()
    is_ok = compute.equal(status, "ok").fill_null(False).to_numpy()
    return Texts(np.where(is_ok, codes, OUTCOMES.index("failed")).astype(np.int32), words)
