"""`voxkernel guards`: few points that see a mesh, and its star-shaped pieces."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from voxkernel.cli.argument_types import add_up
from voxkernel.cli.output import (
    UsageError,
    check_folder,
    check_output,
    check_picture,
    display,
    number,
    print_json,
    print_table,
    say,
    write_json,
)

if TYPE_CHECKING:
    from voxkernel.guarding import GuardsProgress

HELP = "few points that see all of a mesh, and star-shaped pieces"
DESCRIPTION = (
    "Find few points that together see a share of a mesh: what fresh samples say, what is proven, and how many are\n"
    "needed at least. -o takes a folder for the star-shaped pieces, one file a guard; a .ply for all of them in\n"
    "colours; or a .json for the numbers."
)
EXAMPLES = (
    "voxkernel guards mesh.ply",
    "voxkernel guards mesh.ply --coverage 0.99 -o pieces/ --picture guards.html",
    "voxkernel guards mesh.ply --bound --json",
    "voxkernel guards part.stl --outside --distance 300 --picture plan.png",
    "voxkernel guards scan.ply --coverage 0.999 --time-limit 60 -o pieces.ply",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("mesh", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    parser.add_argument("-o", "--output", metavar="OUT", help="folder of pieces, pieces.ply in colours, or .json")
    parser.add_argument("--picture", metavar="FILE", help="the surface by guards, the unseen in red: .png or .html")
    add_up(parser)
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    parser.add_argument("--coverage", type=float, default=0.99, metavar="C", help="share of the area; 0.99 by default")
    parser.add_argument("--max-guards", type=int, metavar="N", help="stop at so many")
    parser.add_argument("--bound", action="store_true", help="how many are needed at least (closed surfaces)")
    parser.add_argument("--outside", action="store_true", help="guards outside: a scan plan for a closed surface")
    parser.add_argument("--distance", type=float, metavar="D", help="of guards outside, mesh units")
    parser.add_argument("--time-limit", type=float, metavar="S", help="seconds; then the best so far")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="1 by default")
    parser.add_argument("--rng", type=int, default=0, metavar="SEED", help="0 by default")


def run(args: argparse.Namespace) -> int:
    """Search, print, write."""
    if args.distance is not None and not args.outside:
        raise UsageError("--distance must be given with --outside")
    _check(args)
    picture = None if args.picture is None else check_picture(args.picture)
    output = None
    if args.output is not None:
        is_file = Path(args.output).suffix.lower() in (".json", ".ply")
        output = check_output(args.output, (".json", ".ply")) if is_file else check_folder(args.output)

    from voxkernel.guarding import guards, star_cover
    from voxkernel.mesh import as_mesh

    with args.stage(f"reading {display(args.mesh)}"):
        mesh = as_mesh(args.mesh)
    with args.stage("looking for guards") as rename:
        found = guards(
            mesh, coverage=args.coverage, max_guards=args.max_guards, bound=args.bound,
            side="outside" if args.outside else "inside", distance=args.distance, threads=args.threads,
            time_limit=args.time_limit, rng=args.rng, progress=lambda state: rename(_words(state)),
        )  # fmt: skip
    document: dict[str, Any] = {"file": args.mesh, **found.to_dict()}
    cover = None
    if output is not None:
        with args.stage("cutting pieces"):
            cover = star_cover(found)
        document["pieces"] = cover.to_dict()["pieces"]
        if output.suffix.lower() == ".json":
            write_json(output, document)
        else:
            cover.write(output)
        say(f"wrote {display(output)}", quiet=args.quiet)
    if picture is not None:
        from voxkernel.pictures import guards_picture

        with args.stage(f"drawing {display(picture)}"):
            guards_picture(picture, found, title=Path(args.mesh).name, up=args.up)
        say(f"wrote {display(picture)}", quiet=args.quiet)
    if args.json:
        print_json(document)
    else:
        print_table(_rows(args.mesh, found, cover))
    return 0


def _check(args: argparse.Namespace) -> None:
    """Refuse numbers that no mesh makes good, before one is read."""
    if not 0.0 < args.coverage <= 1.0:
        raise UsageError(f"--coverage must be in (0, 1]; got {args.coverage:g}")
    for option, value, least in (("--max-guards", args.max_guards, 1), ("--threads", args.threads, 1)):
        if value is not None and value < least:
            raise UsageError(f"{option} must be at least {least}; got {value}")
    for option, value in (("--distance", args.distance), ("--time-limit", args.time_limit)):
        if value is not None and not 0.0 < value < float("inf"):
            raise UsageError(f"{option} must be > 0 and finite; got {value:g}")


def _rows(path: str, found: Any, cover: Any) -> dict[str, str]:
    low, high = found.seen_bounds
    rows = {
        "file": display(path),
        "guards": str(len(found)),
        "seen": f"{number(100 * found.seen)} % of the area ({number(100 * low)} to {number(100 * high)} %)",
        "certified": f"{number(100 * found.certified)} %",
        "facing": f"{number(100 * found.facing_bound)} % at most",
    }
    if found.bound is not None:
        chance = found.bound.error_probability
        rows["at least"] = f"{found.at_least} guards" + (f", wrong with probability {chance:.1g}" if chance else "")
        rows["samples"] = f"{found.bound.at_least_for_samples} guards at least for all {found.bound.n_samples} samples"
    if cover is not None:
        rows["pieces"] = f"{len(cover)}; {len(cover.left_faces)} facets are not wholly in one"
    notes = [found.reason, found.left_out]
    if any(notes):
        rows["note"] = "; ".join(note for note in notes if note)
    if found.bound is not None and found.bound.reason:
        rows["bound"] = f"may be more: {found.bound.reason}"
    for i, point in enumerate(found.points):
        rows[f"guard {i}"] = "  ".join(number(v, 10) for v in point)
    return rows


def _words(state: GuardsProgress) -> str:
    doing = {"search": "looking for guards", "confirm": "casting rays", "certify": "certifying", "bound": "bounding"}
    return f"{doing[state.stage]}: {state.n_guards} see {100.0 * state.seen:.2f} %"
