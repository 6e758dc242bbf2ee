#!/usr/bin/env python3
"""List meshes of Thingi10K in a manifest, through the package `thingi10k` (pip install thingi10k).

Thingi10K (Zhou and Jacobson, 2016) is a set of 10,000 models from Thingiverse. The package downloads an archive
of several gigabytes at the first use and keeps it in its cache. Every model has its own licence, which the
manifest names: look at it before you pass a model on.
The manifest has the columns file, label, file_id, thing_id, name, author, license, category, subcategory, vertices,
facets, components, boundary_edges, euler, closed, oriented, manifold, self_intersecting, solid. `label` is the
category. The facts are those of the data set, not computed here. `file` is the path in the package's cache or, with
--ply, that of the converted mesh; models that cannot be converted are then left out and named on stderr, and the
exit code is 1.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tool

EXAMPLES = (
    "prepare_thingi10k.py -o thingi10k.csv",
    "prepare_thingi10k.py -o solids.csv --solid --components 1 --facets 100:20000 --limit 1000 --ply solids/",
    "prepare_thingi10k.py -o free.csv --license 'creative commons' --closed --oriented",
)
COLUMNS = (
    "file", "label", "file_id", "thing_id", "name", "author", "license", "category", "subcategory", "vertices",
    "facets", "components", "boundary_edges", "euler", "closed", "oriented", "manifold", "self_intersecting", "solid",
)  # fmt: skip
_FLAGS = ("closed", "oriented", "manifold", "solid")


def load(variant: str, cache: str | None) -> Any:
    """Import `thingi10k` and make its data set ready; the first time this downloads it."""
    try:
        import thingi10k
    except ImportError as error:
        raise ImportError("`thingi10k` must be installed (pip install thingi10k); it is not") from error
    thingi10k.init(variant=variant, cache_dir=cache)
    return thingi10k


def describe(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Make a row of the manifest of an entry of the data set."""
    both = (entry["vertex_manifold"], entry["edge_manifold"])
    return {
        "file": entry["file_path"], "label": entry["category"], "file_id": entry["file_id"],
        "thing_id": entry["thing_id"], "name": entry["name"], "author": entry["author"], "license": entry["license"],
        "category": entry["category"], "subcategory": entry["subcategory"], "vertices": entry["num_vertices"],
        "facets": entry["num_facets"], "components": entry["num_components"],
        "boundary_edges": entry["num_boundary_edges"], "euler": entry["euler"], "closed": entry["closed"],
        "oriented": entry["oriented"], "manifold": None if None in both else all(both),
        "self_intersecting": entry["self_intersecting"], "solid": entry["solid"],
    }  # fmt: skip


def convert(package: Any, rows: Iterable[dict[str, Any]], target: Path, *, quiet: bool = True) -> list[str]:
    """Write each model as `<file_id>.ply` and point its row there; a row without `file` could not be converted.

    Returns
    -------
    list of str
        Why some could not be converted.
    """
    from voxkernel import VoxKernelError, as_mesh

    rows, failed = list(rows), []
    for n, row in enumerate(rows):
        file = target / f"{row['file_id']}.ply"
        try:
            as_mesh(package.load_file(row["file"])).write(file)
            row["file"] = file.as_posix()
        except (VoxKernelError, OSError, ValueError) as error:
            failed.append(f"{row['file']}: {error}")
            row["file"] = None
        tool.progress(n + 1, len(rows), "converted", quiet=quiet)
    return failed


def between(text: str) -> tuple[int | None, int | None]:
    """Parse N, LOW:HIGH, LOW: or :HIGH."""
    low, colon, high = text.partition(":")
    try:
        first = int(low) if low else None
        last = (int(high) if high else None) if colon else first
    except ValueError:
        first = last = None
    if first is None and last is None:
        raise argparse.ArgumentTypeError(f"must be N, LOW:HIGH, LOW: or :HIGH; got '{text}'")
    return first, last


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and write the manifest."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("-o", "--output", required=True, metavar="CSV", help="the manifest")
    parser.add_argument("--ply", metavar="FOLDER", help="also write the meshes as .ply in this folder")
    parser.add_argument("--variant", choices=("npz", "raw", "tetwild"), default="npz", help="of the archive (npz)")
    parser.add_argument("--cache", metavar="FOLDER", help="where the package keeps its files")
    parser.add_argument("--limit", type=tool.positive, metavar="N", help="the first N of the models chosen")
    chosen = parser.add_argument_group("which models; all by default")
    for flag in _FLAGS:
        chosen.add_argument(f"--{flag}", action=argparse.BooleanOptionalAction, help=f"{flag} or not")
    chosen.add_argument("--facets", type=between, metavar="LOW:HIGH", help="number of triangles")
    chosen.add_argument("--components", type=between, metavar="LOW:HIGH", help="number of connected parts")
    chosen.add_argument("--license", metavar="TEXT", help="licences that contain this")
    chosen.add_argument("--category", metavar="TEXT", help="categories that contain this")
    chosen.add_argument("--ids", metavar="N,N,...", help="these file ids")
    return tool.run(_run, parser.parse_args(argv))


def _filters(args: argparse.Namespace) -> dict[str, Any]:
    found = {flag: getattr(args, flag) for flag in _FLAGS}
    found |= {"num_facets": args.facets, "num_components": args.components}
    found |= {k: re.escape(v) for k in ("license", "category") if (v := getattr(args, k))}  # patterns there
    if args.ids:
        if not all(part.strip().isdigit() for part in args.ids.split(",")):
            raise tool.UsageError(f"--ids must be whole numbers; got '{args.ids}'")
        found["file_id"] = [int(part) for part in args.ids.split(",")]
    return {name: value for name, value in found.items() if value is not None}


def _run(args: argparse.Namespace) -> int:
    filters = _filters(args)
    target = tool.output_folder(args.ply) if args.ply else None
    package = load(args.variant, args.cache)
    entries = package.dataset(**filters)
    rows = [describe(entry) for _, entry in zip(range(args.limit or len(entries)), entries, strict=False)]
    rows.sort(key=lambda row: row["file_id"])
    failed = convert(package, rows, target, quiet=args.quiet) if target else []
    rows = [row for row in rows if row["file"]]
    tool.write_csv(args.output, COLUMNS, rows)
    for problem in failed:
        tool.report_error(problem)
    tool.say(f"{len(rows)} models", quiet=args.quiet)
    return tool.FAILED if failed else tool.OK


if __name__ == "__main__":
    sys.exit(main())
