"""`voxkernel repair`: a mesh with the changes that are asked for, each of them reported."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from voxkernel.cli.info import mesh_facts
from voxkernel.cli.output import UsageError, check_output, display, print_json, print_table, say

HELP = "turn facets, merge vertices, fill holes: a changed copy of a mesh"
DESCRIPTION = (
    "Write a changed copy of a mesh and say what was changed. Without options: --merge-duplicates and --orient,\n"
    "which move no vertex. The others are PyMeshLab's; they move the surface, and with it the kernel."
)
EXAMPLES = (
    "voxkernel repair mesh.ply -o out.ply",
    "voxkernel repair scan.stl --merge-duplicates --orient --close-holes 50 -o closed.ply",
    "voxkernel repair scan.ply --decimate-to 20000 -o small.ply",
)
_STEPS = ("merge_duplicates", "orient", "close_holes", "remesh_edge_length", "smooth_steps", "decimate_to")
_SUFFIXES = (".ply", ".obj", ".off", ".stl", ".vtp", ".glb")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("mesh", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help="out.ply, .obj, .off, .stl, .vtp or .glb")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    steps = parser.add_argument_group("what to change, in this order")
    steps.add_argument("--merge-duplicates", action="store_true", help="one vertex a position, each triangle once")
    steps.add_argument("--orient", action="store_true", help="turn triangles: neighbours agree, closed parts face out")
    steps.add_argument("--close-holes", type=int, metavar="N", help="fill boundary loops of at most N edges")
    steps.add_argument("--remesh-edge-length", type=float, metavar="L", help="new triangles of this edge length")
    steps.add_argument("--smooth-steps", type=int, default=0, metavar="N", help="steps of Laplacian smoothing")
    steps.add_argument("--decimate-to", type=int, metavar="N", help="at most N triangles")


def run(args: argparse.Namespace) -> int:
    """Change, write, and say what was changed."""
    output = check_output(args.output, _SUFFIXES)
    if output.exists() and Path(args.mesh).exists() and output.samefile(args.mesh):
        raise UsageError(f"output must not be the mesh itself; got '{display(output)}'")
    steps: dict[str, Any] = {name: getattr(args, name) for name in _STEPS if getattr(args, name)}

    from voxkernel.mesh import as_mesh, repair

    with args.stage(f"reading {display(args.mesh)}"):
        mesh = as_mesh(args.mesh)
    with args.stage("repairing"):
        result = repair(mesh, **steps) if steps else repair(mesh, merge_duplicates=True, orient=True)
    result.mesh.write(output)
    say(f"wrote {display(output)}", quiet=args.quiet)
    before, after = mesh_facts(mesh), mesh_facts(result.mesh)
    if args.json:
        changes = [{"step": c.step, "text": c.text} for c in result.changes]
        print_json({"file": args.mesh, "output": args.output, "changes": changes, "before": before, "after": after})
        return 0
    rows = {"file": display(args.mesh)}
    rows |= {change.step.replace("_", " "): change.text for change in result.changes}
    rows |= {name: f"{_word(before[key])} -> {_word(after[key])}" for name, key in _SHOWN.items()}
    print_table(rows)
    return 0


_SHOWN = {
    "vertices": "vertices", "triangles": "triangles", "closed": "closed", "oriented": "oriented", "outward": "outward",
}  # fmt: skip


def _word(value: Any) -> str:
    return {None: "-", True: "yes", False: "no"}[value] if value is None or isinstance(value, bool) else f"{value:,}"
