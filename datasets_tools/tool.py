"""What the scripts of this folder share: the parser, exit codes, CSV files."""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, NoReturn, TextIO

OK, FAILED, BAD_USAGE, INTERRUPTED = 0, 1, 2, 130


class UsageError(Exception):
    """Arguments that parse but cannot be meant."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        report_error(f"{message} (see `{self.prog} --help`)")
        sys.exit(BAD_USAGE)


def parser(description: str, examples: Sequence[str]) -> argparse.ArgumentParser:
    """Make a parser that shows the description as it is written, and examples."""
    made = _Parser(
        description=description.strip(),
        epilog="examples:\n" + "\n".join(f"  {line}" for line in examples),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("-q", "--quiet", action="store_true", help="no messages but errors on stderr")
    return made


def run(main: Callable[[argparse.Namespace], int], args: argparse.Namespace) -> int:
    """Run a script's work; known errors become one line. 0 ok, 1 some items failed, 2 bad usage, 130 interrupted."""
    from voxkernel import VoxKernelError

    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = main(args)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except KeyboardInterrupt:
        report_error("interrupted")
        return INTERRUPTED
    except UsageError as error:
        report_error(str(error))
        return BAD_USAGE
    except (VoxKernelError, OSError, ValueError, RuntimeError, ImportError) as error:
        report_error(str(error) or type(error).__name__)
        return FAILED


def report_error(text: str) -> None:
    """Put one line about an error on stderr."""
    print(f"{Path(sys.argv[0]).name}: error: {' '.join(text.split())}", file=sys.stderr, flush=True)


def say(text: str, *, quiet: bool) -> None:
    """Put one message on stderr."""
    if not quiet:
        print(text, file=sys.stderr, flush=True)


def progress(done: int, total: int, what: str, *, quiet: bool) -> None:
    """Count on stderr, on a terminal only."""
    if not quiet and sys.stderr.isatty() and (done % 50 == 0 or done == total):
        print(f"\r{done}/{total} {what}", end="\n" if done == total else "", file=sys.stderr, flush=True)


def positive(text: str) -> int:
    """Parse a whole number > 0."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1; got {value}")
    return value


def output_folder(path: str) -> Path:
    """Make a folder for outputs; its parent must exist."""
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"output must be a folder; got the file '{path}'")
    if not folder.absolute().parent.is_dir():
        raise UsageError(f"output must be in an existing folder; got '{path}'")
    folder.mkdir(exist_ok=True)
    return folder


def input_folder(path: str) -> Path:
    """Refuse a folder that is not there."""
    if not Path(path).is_dir():
        raise UsageError(f"input must be a folder; got '{path}'")
    return Path(path)


def read_csv(path: str | os.PathLike[str]) -> list[dict[str, str]]:
    """Read a CSV file with a header; texts that `write_csv` has defused are as they were."""
    with open(path, newline="", encoding="utf-8", errors="surrogateescape") as lines:
        return [{name: _as_written(text) for name, text in row.items()} for row in csv.DictReader(lines)]


def _as_written(text: Any) -> Any:
    from voxkernel.run_table import defused

    is_defused = isinstance(text, str) and text.startswith("'") and defused(text[1:]) == text
    return text[1:] if is_defused else text


def write_csv(path: str | os.PathLike[str], columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows; None is an empty cell, a bool is yes or no, a dict is JSON, floats keep all digits.

    A text that a spreadsheet would run as a formula gets an apostrophe in front.
    """
    with open(path, "w", newline="", encoding="utf-8", errors="surrogateescape") as lines:
        print_csv(lines, columns, rows)


def print_csv(lines: TextIO, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows to an open file, as `write_csv`."""
    from voxkernel.run_table import csv_line

    lines.write(csv_line(columns))
    lines.writelines(csv_line([cell(row.get(name)) for name in columns]) for row in rows)


def cell(value: Any) -> str | Real:
    """Write one value of a CSV file; numbers stay numbers, which are no formulas."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Real):
        return float(value) if isinstance(value, float) else value
    return json.dumps(value, sort_keys=True) if isinstance(value, dict | list) else str(value)


def to_json(document: Any) -> str:
    """Write JSON that any parser accepts, as the command line does."""
    from voxkernel.cli.output import to_json as written

    return written(document)


def table(rows: Sequence[Sequence[str]]) -> str:
    """Align columns of text; the first row is the header."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def markdown_table(rows: Sequence[Sequence[str]]) -> str:
    """Write a Markdown table; the first row is the header. Cells are text, never markup."""
    lines = ["| " + " | ".join(escaped(c) for c in row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


def escaped(text: str) -> str:
    """Make text that Markdown shows as it is, on one line."""
    return "".join(f"\\{c}" if c in "\\`*_[]<>|#" else c if c.isprintable() else " " for c in text)
