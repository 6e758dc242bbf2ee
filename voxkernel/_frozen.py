"""`Frozen`: what every class with arrays has in common: read-only, compared by identity, one line as text."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import Field, fields
from fractions import Fraction
from functools import cache
from operator import attrgetter, is_
from types import MappingProxyType
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from voxkernel._notebook import InNotebooks, short

__all__ = ["Frozen"]

# Words of types of fields that hold no array.
_NUMBERS = frozenset({"bool", "int", "float", "str", "None", "class", "tuple", "Fraction"})
_PLAIN = frozenset({bool, int, float, str, type(None), Fraction, np.float64, np.int64})  # hold no array


class Frozen(InNotebooks):
    """Base of the frozen dataclasses that hold arrays, themselves or in a part.

    Arrays are read-only after construction, `dataclasses.replace`, `copy.copy`, `copy.deepcopy` and a pickle, so also
    when they come from a worker process; mappings are read-only views of a copy. Give ``eq=False`` to the dataclass,
    so that ``==`` and ``hash`` go by identity (arrays have no truth value), and ``repr=False`` for the repr of this
    class. What is computed later and kept is a field with ``init=False``: `dataclasses.replace` leaves it behind.
    """

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # for type checkers

    def __post_init__(self) -> None:
        """Make arrays read-only: a view where the array may be the caller's."""
        is_writeable, every, other = _given(type(self))
        try:
            names, values_of = every if any(is_writeable(self)) else other
        except AttributeError:  # something else where an array belongs
            names, values_of = every
        views: dict[int, NDArray[Any]] = {}
        for name, value in zip(names, values_of(self), strict=True):
            if _is_settled(type(value)):
                continue
            held = _held(value, views)
            if held is not value:
                object.__setattr__(self, name, held)

    def __reduce__(self) -> tuple[Any, ...]:
        """All fields by name; NumPy forgets that an array was read-only, and no mapping proxy has a pickle."""
        return _restored, (type(self), {part.name: _portable(getattr(self, part.name)) for part in fields(self)})

    def __repr__(self) -> str:
        """Name the fields; of arrays their type and shape."""
        shown = [f"{p.name}={short(getattr(self, p.name))}" for p in fields(self) if p.repr and p.name[0] != "_"]
        return f"{type(self).__name__}({', '.join(shown)})"


_Reader = Callable[[Any], tuple[Any, ...]]
_Fields = tuple[tuple[str, ...], _Reader]


@cache
def _given(cls: type[Frozen]) -> tuple[_Reader, _Fields, _Fields]:
    """What reads whether arrays can be written; the fields that can hold an array and what reads them; no arrays."""
    types = {part.name: str(part.type) for part in fields(cls) if part.init}
    every = tuple(name for name, kind in types.items() if not _NUMBERS.issuperset(re.findall(r"\w+", kind)))
    arrays = tuple(name for name in every if re.fullmatch(r"NDArray\[[\w.]+\]", types[name]))
    other = tuple(name for name in every if name not in arrays)
    flags = _reader(tuple(f"{name}.flags.writeable" for name in arrays))
    return flags, (every, _reader(every)), (other, _reader(other))


def _reader(names: tuple[str, ...]) -> _Reader:
    """What reads all of some attributes at once."""
    if len(names) > 1:
        return attrgetter(*names)
    one = attrgetter(*names) if names else None
    return lambda thing: () if one is None else (one(thing),)


@cache
def _is_settled(kind: type) -> bool:
    """Whether what is of this type holds no array, or none that can be written."""
    return kind in _PLAIN or issubclass(kind, Frozen)


def _restored(cls: type, values: dict[str, Any]) -> Any:
    """Put an object together from its own copies of all fields."""
    thing = object.__new__(cls)
    for name, value in values.items():
        object.__setattr__(thing, name, _held(value, None))
    return thing


def _held(value: Any, views: dict[int, NDArray[Any]] | None) -> Any:
    """A value as it is kept; arrays are frozen in place without `views`, otherwise one view for each."""
    if isinstance(value, np.ndarray):
        if not value.flags.writeable:
            return value
        if views is None:
            value.setflags(write=False)
            return value
        view = views.get(id(value))
        if view is None:
            view = views[id(value)] = value.view()
            view.setflags(write=False)
        return view
    if isinstance(value, dict):
        return MappingProxyType({key: _held(item, views) for key, item in cast("dict[Any, Any]", value).items()})
    if isinstance(value, tuple):
        items = cast("tuple[Any, ...]", value)
        if _PLAIN.issuperset(map(type, items)):
            return items
        held = [item if type(item) in _PLAIN else _held(item, views) for item in items]
        if not all(map(is_, held, items)):
            return tuple(held) if type(items) is tuple else cast(Any, items)._make(held)
    return value


def _portable(value: Any) -> Any:
    """A value that has a pickle."""
    if isinstance(value, MappingProxyType):
        return {key: _portable(item) for key, item in cast("Mapping[Any, Any]", value).items()}
    if type(value) is tuple:
        items = cast("tuple[Any, ...]", value)
        portable = [_portable(item) for item in items]
        if any(one is not two for one, two in zip(portable, items, strict=True)):
            return tuple(portable)
    return value
