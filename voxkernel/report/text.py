"""Text from files, made safe to show: file names and reasons are data, never markup."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

from voxkernel._plain import json_text

__all__ = [
    "code_span", "count", "json_block", "left_out_text", "number", "one_line", "percent", "readable", "shorten",
]  # fmt: skip

_SUFFIXES = 8  # named
_TAME = re.compile(r"[A-Za-z0-9._/ -]+")


def readable(text: str) -> str:
    """Make text printable on one line: control, direction and line characters and stray bytes become escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def one_line(text: str) -> str:
    """Make a message readable: white space, with its line ends, becomes single spaces."""
    return readable(" ".join(text.split()))


def shorten(text: str, length: int) -> str:
    """Cut the middle out of long text; the end of a file name says most."""
    if len(text) <= length:
        return text
    tail = (length - 1) * 2 // 3
    return f"{text[: length - 1 - tail]}…{text[len(text) - tail :]}"


def code_span(text: str, length: int = 120) -> str:
    """Write text as code in Markdown, also inside a table.

    Anything but letters, digits and ``._/ -`` turns it into an HTML code element whose punctuation is numeric
    character references: those cannot end a cell, open a tag, link, or mention somebody.
    """
    shown = shorten(readable(text), length)
    is_link = "www." in shown.lower()
    if _TAME.fullmatch(shown) and shown == shown.strip() and not is_link:
        return f"`{shown}`"
    kept = " /-" if is_link else " /-."
    safe = "".join(c if c.isalnum() or c in kept or not c.isascii() else f"&#{ord(c)};" for c in shown)
    return f"<code>{safe}</code>"


def json_block(document: Any) -> str:
    """Write JSON that can stand in an HTML script element: ASCII, and no `<`, `>` or `&`."""
    text = json_text(document, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def number(value: float | None, digits: int = 4) -> str:
    """Format a number; a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def left_out_text(counts: Sequence[tuple[str, int]], show: Callable[[str], str] = readable) -> str:
    """Say how many files were no meshes by their suffix; "" if none were."""
    if not counts:
        return ""
    named = [f"{count(n)} {show(suffix) if suffix else 'without suffix'}" for suffix, n in counts[:_SUFFIXES]]
    rest = sum(n for _, n in counts[_SUFFIXES:])
    if rest:
        named.append(f"{count(rest)} others")
    total = sum(n for _, n in counts)
    return f"{count(total)} {'file' if total == 1 else 'files'} left out by suffix: {', '.join(named)}"


def count(value: int) -> str:
    """Format a whole number with thousands."""
    return f"{value:,}"


def percent(part: float, whole: float) -> str:
    """Format a share; never 0 % or 100 % where it is not so."""
    if not whole:
        return "–"
    share = 100.0 * part / whole
    if 0.0 < share < 0.1:
        return "< 0.1 %"
    if 99.9 < share < 100.0:
        return "> 99.9 %"
    return f"{share:.3g} %"
