"""`voxkernel score`: how star-shaped each mesh is."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from voxkernel._sizes import size_notes
from voxkernel.cli.messages import option_names, spoken
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
        with args.stage(f"scoring {display(path)}"):
            entry = _score(path, args, option_names(args.parser))
        entries.append(entry)
        if not args.json:
            print(table_row(_cells(entry), widths), flush=True)
    _note_sizes(entries, args.json, args.quiet)
    if args.json:
        print_json(entries)
    failed = sum(entry["status"] == "failed" for entry in entries)
    if failed:
        say(f"{failed} of {len(entries)} meshes failed", quiet=args.quiet)
    return 1 if failed else 0


def _score(path: str, args: argparse.Namespace, names: dict[str, str]) -> dict[str, Any]:
    from voxkernel.measures import starshapeness
    from voxkernel.mesh import as_mesh
    from voxkernel.mesh.surface_notes import surface_notes

    try:
        if args.stream:
            surface = opened(path, quiet=args.quiet)
            return {"file": path, "status": "ok", **starshapeness(surface, domain=args.domain).to_dict()}
        mesh = as_mesh(path)
        score = starshapeness(mesh, domain=args.domain).to_dict()
        known = "facets point inwards" if any("inwards" in note for note in score["notes"]) else "\0"
        score["notes"] += [note for note in surface_notes(mesh) if known not in note]
        return {"file": path, "status": "ok", **score, "diagonal": mesh.facts().diagonal}
    except (VoxKernelError, OSError, ValueError, MemoryError) as error:
        reason = " ".join(spoken(str(error), names).split()) or type(error).__name__
        return {"file": path, "status": "failed", "reason": reason}


def _note_sizes(entries: list[dict[str, Any]], as_json: bool, quiet: bool) -> None:
    """Note meshes of another scale, which cannot be seen before all are read."""
    for k, note in size_notes([entry.get("diagonal") for entry in entries]).items():
        entries[k]["notes"] = [*entries[k]["notes"], note]
        if not as_json:
            say(f"{display(entries[k]['file'])}: {note}", quiet=quiet)


def _cells(entry: dict[str, Any]) -> list[str]:
    name = display(entry["file"])
    if entry["status"] == "failed":
        return [name, "failed", "-", "-", "-", display(entry["reason"])]
    reason = spoken("; ".join([entry["reason"], *entry["notes"]] if entry["reason"] else entry["notes"]), {})
    return [name, entry["verdict"], number(entry["ratio"]), number(entry["volume"]), entry["reference"], reason]
