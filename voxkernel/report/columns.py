"""Columns of a run's table, as compact as the table stores them, read when they are first needed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional

__all__ = ["Columns", "Lists", "Texts", "cross_counts", "numbers_of"]

T = TypeVar("T")
_AT_ONCE = 20_000  # values that are Python objects at a time


class Texts(Sequence[str]):
    """A text column: each word once, "" for null."""

    __slots__ = ("codes", "words")

    def __init__(self, codes: NDArray[np.int32], words: Any) -> None:
        self.codes, self.words = codes, words

    @classmethod
    def of_column(cls, column: Any) -> Texts:
        """Take an Arrow column."""
        pa = optional("pyarrow")
        whole = pa.chunked_array(column.chunks, pa.string()).fill_null("").combine_chunks()
        coded = whole.dictionary_encode()
        return cls(coded.indices.to_numpy().astype(np.int32, copy=False), coded.dictionary)

    @classmethod
    def of_words(cls, codes: NDArray[np.integer[Any]], words: Sequence[str]) -> Texts:
        """Take the place of each text among some words."""
        pa = optional("pyarrow")
        return cls(np.asarray(codes, np.int32), pa.array(words, pa.large_string()))

    def __len__(self) -> int:
        """How many there are."""
        return len(self.codes)

    @overload
    def __getitem__(self, i: int) -> str: ...
    @overload
    def __getitem__(self, i: slice) -> list[str]: ...
    def __getitem__(self, i: int | slice) -> str | list[str]:
        """One text, or a list of some."""
        if isinstance(i, slice):
            return list(self.taken(np.arange(len(self))[i]))
        return str(self.words[int(self.codes[i])].as_py())

    def __iter__(self) -> Iterator[str]:
        """Every text, some thousand of which are Python's at a time, unless there are few words."""
        few = self.words.to_pylist() if len(self.words) <= _AT_ONCE else None
        for k in range(0, len(self.codes), _AT_ONCE):
            codes = self.codes[k : k + _AT_ONCE]
            if few is not None:
                yield from (few[c] for c in codes.tolist())
            else:
                yield from self.words.take(optional("pyarrow").array(codes)).to_pylist()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """All texts as an array of objects, equal ones the same object."""
        used, codes = np.unique(self.codes, return_inverse=True)
        words = self.words.take(optional("pyarrow").array(used)).to_numpy(zero_copy_only=False)
        return np.asarray(words, dtype=object)[codes.reshape(-1)].astype(dtype or object, copy=False)

    def __eq__(self, other: object) -> bool:
        """Whether another sequence has the same texts."""
        return isinstance(other, Sequence) and len(self) == len(other) and all(map(str.__eq__, self, other))

    __hash__ = None  # type: ignore[assignment]

    def taken(self, ids: NDArray[np.int64]) -> Texts:
        """Give some of the texts."""
        return Texts(self.codes[ids], self.words)

    def places(self, words: Sequence[str]) -> NDArray[np.int32]:
        """Give the place of each text among some words, -1 where it is none of them."""
        pa, compute = optional("pyarrow"), optional("pyarrow.compute")
        found = compute.index_in(self.words, value_set=pa.array(words, self.words.type)).fill_null(-1)
        return found.to_numpy(zero_copy_only=False)[self.codes].astype(np.int32, copy=False)

    def among(self, words: Sequence[str]) -> NDArray[np.bool_]:
        """Say of each text whether it is one of some words."""
        return self.places(words) >= 0

    def used(self) -> list[str]:
        """Give the words in use, in the order of the words."""
        return self._used_words(self._use()).to_pylist()

    def n_used(self) -> int:
        """How many different words are in use."""
        return int(np.count_nonzero(self._use()))

    def counts(self) -> Counter[str]:
        """Count how often each word is used."""
        n = self._use()
        return Counter(dict(zip(self._used_words(n).to_pylist(), n[n > 0].tolist(), strict=True)))

    def extent(self) -> tuple[str, str] | None:
        """Give the first and the last text in order that are not ""; None where there is none."""
        compute = optional("pyarrow.compute")
        words = self._used_words(self._use())
        found = compute.min_max(words.filter(compute.not_equal(words, ""))).as_py()
        return None if found["min"] is None else (found["min"], found["max"])

    def _use(self) -> NDArray[np.int64]:
        return np.bincount(self.codes, minlength=len(self.words)).astype(np.int64, copy=False)

    def _used_words(self, n: NDArray[np.int64]) -> Any:
        return self.words if n.all() else self.words.take(optional("pyarrow").array(np.flatnonzero(n)))


class Lists(Sequence[Any]):
    """A list column; None for null."""

    __slots__ = ("values",)

    def __init__(self, values: Any) -> None:
        self.values = values

    def __len__(self) -> int:
        """How many there are."""
        return len(self.values)

    def __getitem__(self, i: Any) -> Any:
        """One list, or a list of some."""
        return self.values[i].to_pylist() if isinstance(i, slice) else self.values[int(i)].as_py()

    def __iter__(self) -> Iterator[Any]:
        """Every list, some thousand of which are Python's at a time."""
        for k in range(0, len(self.values), _AT_ONCE):
            yield from self.values[k : k + _AT_ONCE].to_pylist()

    def taken(self, ids: NDArray[np.int64]) -> Lists:
        """Give some of the lists."""
        return Lists(self.values.take(optional("pyarrow").array(ids)))

    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Give the length of each list, 0 for null, and all their numbers behind each other, NaN for null."""
        column = self.values.combine_chunks() if hasattr(self.values, "combine_chunks") else self.values
        lengths = optional("pyarrow.compute").list_value_length(column).fill_null(0).to_numpy(zero_copy_only=False)
        numbers = column.flatten().to_numpy(zero_copy_only=False)
        return lengths.astype(np.int64), np.asarray(numbers, np.float64)


class Columns(Generic[T]):
    """Columns by name, each read when it is first asked for, and held until it is forgotten.

    `source` are the columns that `read` takes them from, if it does.
    """

    def __init__(self, names: Sequence[str], read: Callable[[str], T], source: Columns[T] | None = None) -> None:
        self._names, self._read, self._source = tuple(names), read, source
        self._held: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        """Give a column."""
        if name not in self._held:
            if name not in self._names:
                raise KeyError(name)
            self._held[name] = self._read(name)
        return self._held[name]

    def forget(self, keep: Sequence[str] = ()) -> None:
        """Free the memory of all columns but some; they are read again when they are asked for."""
        self._held = {name: self._held[name] for name in keep if name in self._held}
        if self._source is not None:
            self._source.forget(keep)

    def __iter__(self) -> Iterator[str]:
        """The names."""
        return iter(self._names)

    def __contains__(self, name: object) -> bool:
        """Whether there is such a column."""
        return name in self._names

    def __len__(self) -> int:
        """How many columns there are."""
        return len(self._names)


def numbers_of(column: Any) -> NDArray[np.float64]:
    """Take a column of numbers or truths out of Arrow; NaN for null."""
    pa = optional("pyarrow")
    if column.null_count == len(column):
        return np.broadcast_to(np.array(np.nan), len(column))
    return column.cast(pa.float64(), safe=False).fill_null(np.nan).to_numpy()


def cross_counts(
    truths: Texts, answers: Texts, rows: Sequence[str], columns: Sequence[str]
) -> NDArray[np.int64]:
    """Count how often each answer was given to each truth, as `confusion_counts` does, by codes."""
    truth, answer = truths.places(rows), answers.places(columns)
    counted = (truth >= 0) & (answer >= 0)
    cells = truth[counted].astype(np.int64) * len(columns) + answer[counted]
    return np.bincount(cells, minlength=len(rows) * len(columns)).reshape(len(rows), len(columns)).astype(np.int64)
