"""`voxkernel score`: how star-shaped each mesh is."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from voxkernel.cli.output import display, number, print_json, say, table_row
from voxkernel.cli.streaming import add_stream, opened
from voxkernel.errors import VoxKernelError

HELP = "verdict, kernel volume and ratio of meshes"
DESCRIPTION = (
    "Say of each mesh whether it is star-shaped (some point sees its whole surface), and how much:\n"
    "kernel volume over enclosed volume, or over the domain's volume for an open surface.\n"
    "One row per mesh: file, verdict, ratio, volume, reference, reason."
)
EXAMPLES = (
    "voxkernel score bust.ply",
    "voxkernel score scans/*.ply --json > scores.json",
    "voxkernel score face.obj --domain hull",
    "voxkernel score scan.ply --stream",
)
_COLUMNS = ("file", "verdict", "ratio", "volume", "reference", "reason")
_WIDTHS = (16, 11, 12, 15)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("meshes", nargs="+", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    add_stream(parser)
    parser.add_argument("--domain", choices=("ball", "hull", "box"), help="where the kernel's volume is measured")
    parser.add_argument("--json", action="store_true", help="one JSON document: a list with one entry per mesh")


def run(args: argparse.Namespace) -> int:
    """Score every mesh; a mesh that fails gets a row and does not stop the others."""
    widths = (max(4, min(60, max(len(display(m)) for m in args.meshes))), *_WIDTHS)
    if not args.json and not args.quiet and sys.stderr.isatty():
        print(table_row(_COLUMNS, widths), file=sys.stderr)
    entries: list[dict[str, Any]] = []
    for path in args.meshes:
        entry = _score(path, args)
        entries.append(entry)
        if not args.json:
            print(table_row(_cells(entry), widths), flush=True)
    if args.json:
        print_json(entries)
    failed = sum(entry["status"] == "failed" for entry in entries)
    if failed:
        say(f"{failed} of {len(entries)} meshes failed", quiet=args.quiet)
    return 1 if failed else 0


def _score(path: str, args: argparse.Namespace) -> dict[str, Any]:
    from voxkernel.measures import starshapeness

    try:
        surface = opened(path, quiet=args.quiet) if args.stream else path
        return {"file": path, "status": "ok", **starshapeness(surface, domain=args.domain).to_dict()}
    except (VoxKernelError, OSError, ValueError, MemoryError) as error:
        return {"file": path, "status": "failed", "reason": " ".join(str(error).split()) or type(error).__name__}


def _cells(entry: dict[str, Any]) -> list[str]:
    name = display(entry["file"])
    if entry["status"] == "failed":
        return [name, "failed", "-", "-", "-", display(entry["reason"])]
    reason = "; ".join([entry["reason"], *entry["notes"]] if entry["reason"] else entry["notes"])
    return [name, entry["verdict"], number(entry["ratio"]), number(entry["volume"]), entry["reference"], reason]
