"""Which rows of a run's parts count, known from keys and hashes alone, so that a run may have a million of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel import run_table
from voxkernel._extras import optional

__all__ = ["RunIndex", "open_index"]

KEYS = ("file", "cell", "object", "content_hash", "settings_hash", "finished", "n_objects")


class RunIndex:
    """The rows of a run that count, in the order of the table: by file, cell and object.

    Rows that only mark a label image without objects are left out unless `with_marks`. Parts are held open, so that
    those on this machine can be read to the end though a run that goes on deletes them.

    Attributes
    ----------
    names : list of str
        The parts, oldest first.
    n_stale : int
        Rows of the parts that later ones have replaced.
    keys : pyarrow.Table
        The columns of `KEYS` and those asked for, of the rows that count.
    """

    def __init__(self, fs: Any, names: Sequence[str], columns: Sequence[str], *, with_marks: bool = False) -> None:
        self.names = list(names)
        self._parts = [run_table.open_part(fs, name) for name in names]
        self._starts = np.concatenate([[0], np.cumsum([part.num_rows for part in self._parts])]).astype(np.int64)
        wanted = list(dict.fromkeys([*KEYS, *columns]))
        whole = self._whole(wanted)
        self._order = run_table.current_rows(whole)
        self.n_stale = whole.num_rows - len(self._order)
        if not with_marks:
            is_mark = whole.column("n_objects").fill_null(-1).to_numpy() == 0
            self._order = self._order[~is_mark[self._order]]
        self.keys = self._sorted(whole)
        del whole
        optional("pyarrow").default_memory_pool().release_unused()

    def __len__(self) -> int:
        """How many rows count."""
        return len(self._order)

    def close(self) -> None:
        """Let go of the parts and of the keys."""
        for part in self._parts:
            part.close()
        self.forget_keys()

    def part_sizes(self) -> list[tuple[int, int]]:
        """Rows of each part, and how many of them count."""
        counted = np.histogram(self._order, self._starts)[0] if len(self._starts) > 1 else np.zeros(0, np.int64)
        return list(zip(np.diff(self._starts).tolist(), counted.tolist(), strict=True))

    def table(self, columns: Sequence[str]) -> Any:
        """Read columns of all rows, in the order of the table."""
        return self._sorted(self._whole(list(columns)))

    def words(self, column: str) -> tuple[NDArray[np.int32], Any]:
        """Read a text column of all rows, in the order of the table, as places in an Arrow array of words.

        Null is "". A text that every row repeats is never in memory for more than a part.
        """
        pa = optional("pyarrow")
        coded = [pa.array([], pa.string()).dictionary_encode()]
        for part in self._parts:
            texts = run_table.read_part(part, [column]).column(0).fill_null("")
            coded += [chunk.dictionary_encode() for chunk in texts.chunks]
        unified = pa.chunked_array(coded).unify_dictionaries().chunks
        codes = np.concatenate([chunk.indices.to_numpy() for chunk in unified]).astype(np.int32, copy=False)
        return codes[self._order], unified[0].dictionary

    def forget_keys(self) -> None:
        """Free the memory of the keys, when they have been used."""
        self.keys = self.keys.slice(0, 0).combine_chunks()
        optional("pyarrow").default_memory_pool().release_unused()

    def rows(self, places: NDArray[np.int64]) -> Any:
        """Read some rows whole, by their places in the table; some thousand others are in memory at a time."""
        pa = optional("pyarrow")
        wanted = self._order[places]
        by_place = np.argsort(wanted, kind="stable")
        pieces = [run_table.schema().empty_table()]
        ordered = wanted[by_place]
        for k, (begin, end) in enumerate(zip(self._starts[:-1], self._starts[1:], strict=True)):
            low, high = np.searchsorted(ordered, [begin, end])
            for batch in run_table.read_batches(self._parts[k]) if high > low else ():
                low, high = np.searchsorted(ordered, [begin, begin + batch.num_rows])
                if high > low:
                    pieces.append(_taken(batch, ordered[low:high] - begin))
                begin += batch.num_rows
        back = np.empty(len(places), np.int64)
        back[by_place] = np.arange(len(places))
        return _taken(pa.concat_tables(pieces), back)

    def places_of(self, parts: Sequence[int]) -> NDArray[np.int64]:
        """Places in the table of the rows of some parts."""
        return np.flatnonzero(np.isin(np.searchsorted(self._starts, self._order, side="right") - 1, parts))

    def parts(self) -> Iterator[Any]:
        """Read what counts of one part after the other, in the order of the table within each."""
        for k in range(len(self.names)):
            yield self.rows(self.places_of([k]))

    def _whole(self, columns: list[str]) -> Any:
        pa = optional("pyarrow")
        wanted = pa.schema([run_table.schema().field(name) for name in columns])
        return pa.concat_tables([wanted.empty_table(), *(run_table.read_part(p, columns) for p in self._parts)])

    def _sorted(self, whole: Any) -> Any:
        return _taken(whole, self._order)


def _taken(table: Any, ids: NDArray[np.int64]) -> Any:
    """Take rows of a table; all of them in their order are no copy."""
    if len(ids) == table.num_rows and bool((ids == np.arange(len(ids))).all()):
        return table
    return table.take(optional("pyarrow").array(ids))


def open_index(fs: Any, run_path: str, columns: Sequence[str] = (), *, with_marks: bool = False) -> RunIndex:
    """Index the parts of a run, with more columns than the keys; a run that goes on may just be merging some."""
    return run_table.while_parts_move(
        lambda: RunIndex(fs, run_table.part_names(fs, run_path), columns, with_marks=with_marks)
    )
