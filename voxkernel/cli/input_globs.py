"""Patterns such as ``scans/*.ply`` that no shell has expanded, for every command that reads files."""

from __future__ import annotations

import argparse
import os
from glob import glob
from typing import Any

from voxkernel.cli.output import UsageError, display

__all__ = ["expand_globs"]

_MAGIC = "*?["
_OWN = ("evaluate", "labels")  # they take folders and URLs, too


def expand_globs(args: argparse.Namespace) -> None:
    """Replace patterns among the inputs by the files they match; one that matches none stays, to be reported.

    Raises
    ------
    UsageError
        If a pattern matches several files where one is wanted.
    """
    if args.command in _OWN:
        return
    for action in args.parser._actions:
        if action.option_strings:
            continue
        given: Any = getattr(args, action.dest)
        if isinstance(given, list):
            setattr(args, action.dest, [file for word in given for file in _matches(word)])
        else:
            files = _matches(given)
            if len(files) > 1:
                more = ", ..." if len(files) > 3 else ""
                named = ", ".join(display(f) for f in files[:3]) + more
                raise UsageError(f"{action.metavar} must be one file; got {len(files)}: {named}")
            setattr(args, action.dest, files[0])


def _matches(word: str) -> list[str]:
    """Files that a word means, sorted; the word itself where it is a file or matches nothing."""
    if os.path.lexists(word) or not any(c in word for c in _MAGIC):
        return [word]
    return sorted(glob(word, recursive=True)) or [word]
