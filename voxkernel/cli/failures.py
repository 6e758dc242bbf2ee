"""Why rows of a run failed: a line each, of the first ones."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from voxkernel.cli.messages import spoken
from voxkernel.cli.output import display, report_error

__all__ = ["show_failures"]

_LINES = 10


def show_failures(rows: Sequence[tuple[str, int | None, str]], n: int, names: Mapping[str, str]) -> None:
    """Say of the first of `n` rows (file, object, reason) why they failed, in the words of the command line.

    Parameters
    ----------
    rows : sequence of (str, int or None, str)
        File, number of an object, and reason.
    n : int
        How many rows failed; `rows` may be the first of them.
    names : mapping of str to str
        What `option_names` gives for the command.
    """
    for file, number, reason in rows[:_LINES]:
        own = re.sub("^(Value|Type)Error: (?=[`'])", "", reason)  # our own words
        own = spoken(own, names).removeprefix(f"'{file}' ").removeprefix(f"'{file}': ")
        report_error(f"{display(file)}{'' if number is None else f', object {number}'}: {display(own)}")
    if n > _LINES:
        report_error(f"{n - _LINES:,} more rows failed: see `voxkernel report`")
