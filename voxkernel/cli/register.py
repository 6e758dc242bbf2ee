"""`voxkernel register`: the rigid motion that lays one surface on another."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from voxkernel._extras import check_installed
from voxkernel.cli import register_together
from voxkernel.cli.argument_types import add_up
from voxkernel.cli.output import (
    UsageError,
    check_output,
    check_picture,
    display,
    number,
    print_json,
    print_table,
    say,
    write_json,
)

HELP = "the rigid motion that lays one surface on another"
DESCRIPTION = (
    "Register a source surface to a target through their relaxed kernels, from any pose and without a first guess,\n"
    "then by ICP on the surfaces. The motion maps source points to target points. Exit code 1 for 'no match'.\n"
    "An answer that is not right without doubt says why."
)
EXAMPLES = (
    "voxkernel register scan.ply reference.ply -o T.json",
    "voxkernel register scan.ply reference.ply --apply moved.ply --picture before_after.html",
    "voxkernel register left.ply right.ply --overlap-steps 2 --json",
    "voxkernel register scan*.ply --together -o poses.json --merged all.ply --picture together.png",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("source", metavar="SOURCE", help="the surface to move: .ply .obj .off .stl ...")
    parser.add_argument("target", metavar="TARGET", nargs="*", help="the surface that stays; the others of --together")
    parser.add_argument("-o", "--output", metavar="FILE", help="T.json: the motion, its fit and what was tried")
    parser.add_argument("--apply", metavar="FILE", help="write the moved source: .ply .obj .off .stl")
    parser.add_argument(
        "--picture", metavar="FILE", nargs="?", const="registration.png",
        help="before, after and how far the surfaces are off: .html or .png; registration.png where no name is given",
    )  # fmt: skip
    add_up(parser)
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    register_together.add_arguments(parser)
    parser.add_argument(
        "--margins", type=_share, nargs="+", metavar="M",
        help="margins of the relaxed kernels, shares of the area; 0.06 0.1 0.15 by default",
    )  # fmt: skip
    parser.add_argument(
        "--refine", choices=("point_to_plane", "point_to_point", "none"), default="point_to_plane",
        help="ICP on the surfaces; none gives what the kernels say",
    )  # fmt: skip
    parser.add_argument("--max-distance", type=_length, metavar="D", help="what the fitness calls near, mesh units")
    parser.add_argument(
        "--overlap-steps", type=int, default=0, metavar="N",
        help="crop both to their overlap and register again, N times; for partial scans",
    )  # fmt: skip
    parser.add_argument(
        "--estimate-scale", action="store_true",
        help="the surfaces may be of different size; the motion holds the scale",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Register, print, write."""
    check_installed("open3d")
    register_together.check(args)
    if args.together:
        return register_together.run(args)
    (args.target,) = args.target
    output = None if args.output is None else check_output(args.output, (".json",))
    moved = None if args.apply is None else check_output(args.apply, (".ply", ".obj", ".off", ".stl", ".vtp", ".glb"))
    picture = None if args.picture is None else check_picture(args.picture)
    for path in (args.source, args.target):
        if moved is not None and moved.exists() and Path(path).exists() and moved.samefile(path):
            raise UsageError(f"output must not be an input; got '{display(moved)}'")

    from voxkernel.registration import prepare_surface, register

    with args.stage(f"preparing {display(args.source)}"):
        source = prepare_surface(args.source, margins=args.margins)
    with args.stage(f"preparing {display(args.target)}"):
        target = prepare_surface(args.target, margins=args.margins)
    with args.stage("registering"):
        found = register(
            source, target, margins=args.margins, refine=args.refine, max_distance=args.max_distance,
            overlap_steps=args.overlap_steps, estimate_scale=args.estimate_scale,
        )  # fmt: skip
    document = {"source": args.source, "target": args.target, **found.to_dict()}
    if output is not None:
        write_json(output, document)
        say(f"wrote {display(output)}", quiet=args.quiet)
    if moved is not None:
        source.mesh.transformed(found.T_target_source).write(moved)
        say(f"wrote {display(moved)}", quiet=args.quiet)
    if picture is not None:
        from voxkernel.pictures import registration_picture

        names = " → ".join(display(Path(p).name) for p in (args.source, args.target))
        with args.stage(f"drawing {display(picture)}"):
            registration_picture(picture, source, target, found, title=names, up=args.up)
        say(f"wrote {display(picture)}", quiet=args.quiet)
    if args.json:
        print_json(document)
    else:
        print_table(_rows(args, found))
    return 1 if found.verdict == "no match" else 0


def _rows(args: argparse.Namespace, found: Any) -> dict[str, str]:
    import numpy as np
    from scipy.spatial.transform import Rotation

    motion = found.T_target_source
    turn = Rotation.from_matrix(motion[:3, :3] / found.scale).as_rotvec()
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle > 0 else turn
    rows = {
        "source": display(args.source),
        "target": display(args.target),
        "verdict": f"{found.verdict}, probability {number(found.probability, 3)}",
        "rotation": f"{number(np.degrees(angle), 8)} degrees about " + "  ".join(number(v, 6) for v in axis),
        "shift": "  ".join(number(v, 10) for v in motion[:3, 3]),
        "fitness": f"{number(100 * found.fitness, 5)} % of the source within {number(found.max_distance, 4)}, "
        f"RMS {number(found.inlier_rmse, 4)}",
        "margin": number(found.margin, 3) if np.isfinite(found.margin) else "no kernel led to the answer",
        "scale": number(found.scale, 8),
        "led by": found.led_by or "nothing",
        "facets": "of one surface turned over" if found.facets_turned else "as given",
        "converged": "yes" if found.converged else "no",
        "ambiguous": "yes" if found.ambiguous else "no",
    }
    if found.reason:
        rows["note"] = found.reason
    return rows


def _share(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"must be between 0 and 1; got {text}")
    return value


def _length(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"must be > 0; got {text}")
    return value
