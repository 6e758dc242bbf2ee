"""`voxkernel report`: a run as a page, as Markdown, as JSON or as LaTeX."""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path
from typing import Any

from voxkernel.cli.output import UsageError, check_output, display, say

HELP = "one offline HTML page about a run of `evaluate`; or Markdown, JSON or LaTeX"
DESCRIPTION = (
    "Read the table that `voxkernel evaluate` wrote and report it: failures first, counts, scores, defect\n"
    "profiles, labels against verdicts, a table to sort and filter, and shapes to turn. The page is one file\n"
    "and needs no network; printed, it is one sheet. Without -o, Markdown, JSON or LaTeX goes to standard output."
)
EXAMPLES = (
    "voxkernel report run/ -o report.html",
    "voxkernel report run/ -o report.html --views 40 --star-label convex --star-label star",
    "voxkernel report run/ -o report.html --compare run_of_last_week/",
    "voxkernel report run/ -o report.html --classes 'nearly:defect<0.01;far:defect>=0.1'",
    "voxkernel report run/ -o paper/results.tex",
    "voxkernel report run/ --markdown > summary.md",
    "voxkernel report run/ --json > summary.json",
)
_SUFFIXES = (".html", ".htm", ".md", ".json", ".tex")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("run", metavar="RUN", help="folder or URL that `voxkernel evaluate` wrote")
    parser.add_argument("-o", "--output", metavar="FILE", help="report to write: .html, .md, .json or .tex")
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--markdown", action="store_true", help="a short Markdown text, for a pull request")
    kind.add_argument("--json", action="store_true", help="the summary as one JSON document")
    kind.add_argument("--latex", action="store_true", help="booktabs tables; with -o also figures as PDF and SVG")
    parser.add_argument("--title", metavar="TEXT", help="words above the report (default: the name of the run)")
    parser.add_argument(
        "--star-label", action="append", metavar="LABEL",
        help="a label that means star-shaped, so that all others mean it is not; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--classes", action="append", metavar="RULES",
        help="classes by thresholds, 'NAME: defect<0.01 ratio>0', several between semicolons; may be repeated",
    )  # fmt: skip
    parser.add_argument("--compare", metavar="RUN", help="an earlier run: what changed since, regressions first")
    parser.add_argument("--views", type=_whole, default=12, metavar="N", help="shapes to turn in 3D (default: 12)")
    parser.add_argument("--worst", type=_whole, default=10, metavar="N", help="rows in the list of the worst (10)")
    parser.add_argument(
        "--max-megabytes", type=_size, default=40.0, metavar="MB", help="bound on pictures and views in the page (40)"
    )


def run(args: argparse.Namespace) -> int:
    """Write the report; a run with failed rows is reported with exit code 0, for the report itself worked."""
    form = "markdown" if args.markdown else "json" if args.json else "latex" if args.latex else None
    if args.output is None and form is None:
        raise UsageError("-o FILE must be given, or --markdown, --json or --latex to print")
    from voxkernel.report import write_report

    if args.classes is not None:
        from voxkernel.report.classes import class_rules

        try:
            class_rules(args.classes)
        except ValueError as error:
            raise UsageError(str(error).replace("`classes`", "--classes")) from error
    options: dict[str, Any] = {
        "title": args.title, "star_labels": args.star_label, "n_views": args.views, "n_worst": args.worst,
        "max_megabytes": args.max_megabytes, "classes": args.classes, "compare": args.compare,
    }  # fmt: skip
    if args.output is None:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "report"
            with args.stage(f"reporting {display(args.run)}"):
                write_report(file, args.run, format=form, **options)
            print(file.read_text(encoding="utf-8"), end="")
        return 0
    target = check_output(args.output, _SUFFIXES if form is None else (".md", ".json", ".tex", ""))
    with args.stage(f"reporting {display(args.run)}"):
        summary = write_report(target, args.run, format=form, **options)
    counts = ", ".join(f"{n:,} {name}" for name, n in summary["counts"].items())
    size = target.stat().st_size / 1e6
    say(f"{display(target)}: {summary['n_rows']:,} rows ({counts}), {size:.1f} MB", quiet=args.quiet)
    return 0


def _whole(text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise argparse.ArgumentTypeError(f"must be a whole number, 0 or more; got {display(text)}")
    return int(text)


def _size(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number of megabytes, 0 or more; got {display(text)}")
    return value
