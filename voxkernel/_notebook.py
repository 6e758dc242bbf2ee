"""What notebooks show of a result: a small table, sometimes with a picture; never the numbers of an array."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from html import escape
from typing import Any, cast

import numpy as np

__all__ = ["InNotebooks", "html_of", "short"]

_LONGEST = 60  # characters of one value in a line
_LONGEST_TEXT, _FEW = 200, 4  # characters, and numbers, in a cell of a table


class InNotebooks:
    """Base of results: a table of their fields, and what two hooks add to it."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """A small table for notebooks: fields that hold something, of all but the shortest arrays type and shape."""
        return html_of(self)

    def _more_rows(self) -> Mapping[str, Any]:
        """Rows below the fields: what is not stored but wanted first."""
        return {}

    def _picture(self) -> str:
        """An ``<img>`` or ``<svg>`` above the table; "" where none is cheap."""
        return ""


def html_of(thing: Any) -> str:
    """Write the table of a dataclass or a named tuple."""
    if hasattr(type(thing), "__dataclass_fields__"):
        names = [part.name for part in fields(thing) if part.repr and part.name[0] != "_"]
    else:
        names = list(thing._fields)
    values = {name: getattr(thing, name) for name in names}
    picture = ""
    if isinstance(thing, InNotebooks):
        values |= thing._more_rows()
        picture = thing._picture()
    shown = [(name, _cell(value)) for name, value in values.items()]
    body = "".join(
        f'<tr><th style="text-align:left">{escape(name.replace("_", " "))}</th>'
        f'<td style="text-align:left">{escape(text)}</td></tr>'
        for name, text in shown
        if text
    )
    head = f'<caption style="text-align:left"><b>{type(thing).__name__}</b></caption>'
    return f'{picture}<table class="voxkernel">{head}<tbody>{body}</tbody></table>'


def short(value: Any) -> str:
    """One value within a line."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {tuple(int(n) for n in value.shape)}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple | Mapping) and len(cast("tuple[Any, ...]", value)) > 4:
        return f"{type(cast(object, value)).__name__} of {len(cast('tuple[Any, ...]', value))}"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else f"<{type(value).__name__}>"


def _cell(value: Any) -> str:
    """One value within a table; "" for what says nothing."""
    if value is None:
        return ""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str | InNotebooks):
        text = " ".join(str(value).split())
        return text if len(text) <= _LONGEST_TEXT else text[: _LONGEST_TEXT - 1] + "…"
    if isinstance(value, np.ndarray) and value.ndim == 1 and 0 < value.size <= _FEW and value.dtype.kind in "iuf":
        return ", ".join(f"{v:.6g}" for v in value.tolist())
    if isinstance(value, tuple | list):
        items = cast("tuple[Any, ...]", value)
        if len(items) <= _FEW and all(isinstance(v, int | float | str) for v in items):
            return ", ".join(map(_cell, items))
    return short(value)
