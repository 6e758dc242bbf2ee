"""What the commands share: messages on stderr, data on stdout, files checked before long work."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from voxkernel._extras import check_installed
from voxkernel._plain import json_text

__all__ = [
    "UsageError", "check_folder", "check_output", "check_picture", "display", "number", "print_json",
    "print_table", "report_error", "say", "table_row", "write_json",
]  # fmt: skip


class UsageError(Exception):
    """Arguments that parse but cannot be meant."""


def say(text: str, *, quiet: bool) -> None:
    """Put one message on stderr."""
    if not quiet:
        print(f"voxkernel: {text}", file=sys.stderr, flush=True)


def report_error(text: str) -> None:
    """Put one line about an error on stderr."""
    print(f"voxkernel: error: {' '.join(text.split())}", file=sys.stderr, flush=True)


def display(text: str | os.PathLike[str]) -> str:
    """Make a file name printable on one line: control characters and stray bytes become escapes."""
    name = os.fsdecode(text)
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in name)


def number(value: float | None, digits: int = 6) -> str:
    """Format a number for a table; "-" where there is none."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def table_row(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Pad all cells but the last."""
    padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
    return "  ".join([*padded, *cells[len(widths) :]]).rstrip()


def print_table(rows: Mapping[str, Any]) -> None:
    """Print names and values, one a line."""
    width = max(len(name) for name in rows)
    for name, value in rows.items():
        print(f"{name.ljust(width)}  {value}")


def print_json(document: Any) -> None:
    """Print one JSON document; NaN and infinity become null."""
    print(to_json(document))


def to_json(document: Any) -> str:
    """Write JSON that any parser accepts."""
    return json_text(document, indent=2)


def write_json(path: Path, document: Any) -> None:
    """Write one JSON document to a file, as `print_json` prints it."""
    path.write_text(to_json(document) + "\n", encoding="utf-8")


def check_output(path: str, suffixes: Sequence[str]) -> Path:
    """Refuse an output that cannot be written, before anything is computed."""
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise UsageError(f"output must end in {', '.join(suffixes)}; got '{display(path)}'")
    if target.is_dir():
        raise UsageError(f"output must be a file; got the folder '{display(path)}'")
    if not target.parent.is_dir():
        raise UsageError(f"output must be in an existing folder; got '{display(path)}'")
    if not os.access(target if target.exists() else target.parent, os.W_OK):
        raise UsageError(f"output must be writable; got '{display(path)}'")
    return target


def check_picture(path: str) -> Path:
    """Refuse a picture that cannot be written, or that nothing installed can draw, before anything is computed."""
    target = check_output(path, (".png", ".html"))
    check_installed("pyvista" if target.suffix.lower() == ".png" else "plotly")
    return target


def check_folder(path: str) -> Path:
    """Make a folder for outputs; its parent must exist."""
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"output must be a folder; got the file '{display(path)}'")
    if not folder.absolute().parent.is_dir():
        raise UsageError(f"output must be in an existing folder; got '{display(path)}'")
    folder.mkdir(exist_ok=True)
    return folder
