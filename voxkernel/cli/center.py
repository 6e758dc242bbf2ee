"""`voxkernel center`: the point that faces the most of a mesh."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from voxkernel.cli.argument_types import whole
from voxkernel.cli.output import (
    UsageError,
    check_output,
    display,
    number,
    print_json,
    print_table,
    say,
    write_json,
)
from voxkernel.cli.streaming import add_stream, opened

HELP = "the point that faces the most of a mesh"
DESCRIPTION = (
    "Find the star centre of a mesh: the point with the smallest share of the surface turned away from it, with\n"
    "certain bounds on that share over all points of the domain. It is 0 exactly when the kernel is not empty,\n"
    "and ranks meshes that are not star-shaped."
)
EXAMPLES = (
    "voxkernel center scan.ply",
    "voxkernel center scan.ply --gap 1e-6 --json",
    "voxkernel center asteroid.ply --relative-gap 0.1 --visible",
    "voxkernel center scan.ply --profile -o center.json",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("mesh", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    add_stream(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="center.json")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    parser.add_argument(
        "--domain", choices=("ball", "hull", "box"), help="where to look (closed surfaces: hull, open ones: ball)"
    )
    parser.add_argument("--weights", choices=("area", "count"), default="area", help="what a facet counts")
    parser.add_argument("--gap", type=_share, metavar="G", help="stop when the bounds are this close; 1e-4 by default")
    parser.add_argument("--relative-gap", type=_share, metavar="R", help="stop at this share of the upper bound")
    parser.add_argument("--threads", type=whole(1, 256), default=1, metavar="N", help="threads; 1 by default")
    parser.add_argument("--visible", action="store_true", help="cast rays: how much is really visible from there")
    parser.add_argument("--profile", action="store_true", help="volumes of the relaxed kernels for 26 tolerances")


def run(args: argparse.Namespace) -> int:
    """Search, print, write."""
    output = None if args.output is None else check_output(args.output, (".json",))

    if args.stream and args.profile:
        raise UsageError("--profile must not be given with --stream: it wants the mesh in memory")

    from voxkernel.mesh import as_mesh
    from voxkernel.relaxed import best_center

    with args.stage(f"reading {display(args.mesh)}"):
        mesh: Any = opened(args.mesh, quiet=args.quiet) if args.stream else as_mesh(args.mesh)
    with args.stage("searching for the point that faces the most"):
        center = best_center(
            mesh, gap=args.gap, relative_gap=args.relative_gap, domain=args.domain, weights=args.weights,
            threads=args.threads,
        )  # fmt: skip
    low, high = center.violation_bounds
    document: dict[str, Any] = {"file": args.mesh, **center.to_dict()}
    rows = {
        "file": display(args.mesh),
        "centre": "  ".join(number(v, 10) for v in center.point),
        "turned away": f"{number(100 * low, 8)} to {number(100 * high, 8)} % of the surface",
        "star-shaped": "yes" if high == 0.0 else "no",
    }
    if center.domain is not None:
        rows["domain"] = center.domain.kind
    if notes := [*filter(None, [center.reason]), *border_note(center)]:
        rows["note"] = document["note"] = "; ".join(notes)
    if args.visible:
        from voxkernel.measures import visible_fraction

        with args.stage("casting rays"):
            seen = visible_fraction(mesh, center.point)
        document["visible"] = seen.to_dict()
        rows["visible"] = f"{number(100 * seen.fraction)} % of the area, to {number(100 * seen.error, 2)} %"
    if args.profile:
        from voxkernel.measures import defect_profile

        with args.stage("measuring relaxed kernels"):
            profile = defect_profile(mesh, domain=args.domain)
        document["profile"] = profile.to_dict()
        for share, (lower, upper) in zip(profile.tolerances, profile.volume_share_bounds, strict=True):
            rows[f"volume at {number(share)}"] = f"{number(lower)} to {number(upper)} of the domain"
    if output is not None:
        write_json(Path(output), document)
        say(f"wrote {display(output)}", quiet=args.quiet)
    if args.json:
        print_json(document)
    else:
        print_table(rows)
    return 0


def border_note(center: Any) -> list[str]:
    """Say that it is the domain that decides where a star centre lies."""
    if not center.is_at_border:
        return []
    kind = center.domain.kind
    other = "hull" if kind != "hull" else "ball"
    return [f"the point lies on the border of the domain ({kind}), which decides it: try --domain {other}"]


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"must be a number between 0 and 1; got {text}")
    return value
