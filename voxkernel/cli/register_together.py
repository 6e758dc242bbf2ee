"""`voxkernel register --together`: many scans of one thing, laid together."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from voxkernel._extras import optional
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

__all__ = ["add_arguments", "check", "run"]

_PAIR_ONLY = {"apply": "--apply", "max_distance": "--max-distance", "overlap_steps": "--overlap-steps"}
_MOST_REFUSED = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    many = parser.add_argument_group("many scans of one thing")
    many.add_argument(
        "--together", action="store_true",
        help="lay all surfaces together, in the frame of the first that belongs; exit code 1 where some do not",
    )  # fmt: skip
    many.add_argument("--merged", metavar="FILE", help="write all scans that belong in one mesh: .ply .obj .off .stl")
    many.add_argument("--all-pairs", action="store_true", help="register every pair, not only those that look alike")
    many.add_argument("--neighbors", type=int, default=5, metavar="N", help="pairs tried for each scan; 5 by default")
    many.add_argument("--workers", type=int, default=1, metavar="N", help="processes; 1 by default")
    many.add_argument("--scheduler", metavar="URL", help="a Dask scheduler to use and trust instead, tls://host:8786")


def check(args: argparse.Namespace) -> None:
    """Refuse options that do not go together."""
    if not args.together:
        if len(args.target) != 1:
            raise UsageError(f"one TARGET or --together must be given; got {len(args.target)} targets")
        if args.merged is not None:
            raise UsageError("--merged must be given with --together")
        return
    for name, option in _PAIR_ONLY.items():
        if getattr(args, name):
            raise UsageError(f"{option} must be given without --together")
    if args.refine != "point_to_plane":
        raise UsageError(f"--refine must be point_to_plane with --together; got {args.refine}")


def run(args: argparse.Namespace) -> int:
    """Lay all surfaces together, print, write."""
    paths = [args.source, *args.target]
    output = None if args.output is None else check_output(args.output, (".json",))
    merged = None if args.merged is None else check_output(args.merged, (".ply", ".obj", ".off", ".stl"))
    picture = None if args.picture is None else check_picture(args.picture)
    for path in paths:
        if merged is not None and merged.exists() and Path(path).exists() and merged.samefile(path):
            raise UsageError(f"output must not be an input; got '{display(merged)}'")

    from voxkernel.registration import register_together

    with _client(args.scheduler) as client:
        found = register_together(
            paths, pairs="all" if args.all_pairs else "shortlist", neighbors=args.neighbors, workers=args.workers,
            client=client, progress=_progress(args.quiet), margins=args.margins,
        )  # fmt: skip
    document = {"surfaces": paths, **found.to_dict()}
    if output is not None:
        write_json(output, document)
        say(f"wrote {display(output)}", quiet=args.quiet)
    placed = len(paths) - len(found.apart)
    if merged is not None and placed:
        found.merged(paths).write(merged)
        say(f"wrote {display(merged)}", quiet=args.quiet)
    if picture is not None and placed:
        from voxkernel.pictures import together_picture

        names = [display(Path(p).name) for p in paths]
        together_picture(picture, paths, found, names=names, title=f"{len(paths)} scans", up=args.up)
        say(f"wrote {display(picture)}", quiet=args.quiet)
    if args.json:
        print_json(document)
    else:
        print_table(_rows(paths, found))
    return 0 if not found.apart else 1


@contextmanager
def _client(url: str | None) -> Generator[Any]:
    if url is None:
        yield None
        return
    with optional("distributed").Client(url, timeout="5s", set_as_default=False) as client:
        yield client


def _progress(quiet: bool) -> Callable[[int, int], None] | None:
    """Say every tenth of the work on a terminal."""
    if quiet or not sys.stderr.isatty():
        return None
    last = [0]

    def show(done: int, total: int) -> None:
        if done == total or done >= last[0] + max(1, total // 10):
            last[0] = done
            sys.stderr.write(f"voxkernel: {done} of {total} steps\n")
            sys.stderr.flush()

    return show


def _rows(paths: list[str], found: Any) -> dict[str, str]:
    folders = {os.path.dirname(path) for path in paths}
    is_one = len(folders) == 1
    names = [display(os.path.basename(path) if is_one else path) for path in paths]
    rows = {"folder": display(*folders)} if is_one and "" not in folders else {}
    rows |= {
        "scans": f"{len(paths) - len(found.apart)} of {len(paths)} belong together",
        "frame": names[found.reference] if len(found.apart) < len(paths) else "none",
        "residual": f"{number(found.residual, 4)}, as the tree lays them {number(found.tree_residual, 4)}",
    }
    uses = {use: [p for p in found.pairs if p.use == use] for use in ("tree", "loop", "contradicts", "refused")}
    for use in ("tree", "loop"):
        text = ", ".join(f"{names[p.source]} - {names[p.target]}" for p in uses[use])
        rows[f"{use} ({len(uses[use])})"] = text or "none"
    for k, pair in enumerate([*uses["contradicts"], *uses["refused"]][:_MOST_REFUSED], start=1):
        rows[f"refused {k}"] = f"{names[pair.source]} - {names[pair.target]}: {pair.reason}"
    left = len(uses["contradicts"]) + len(uses["refused"]) - _MOST_REFUSED
    if left > 0:
        rows["refused"] = f"{left} more, in the JSON"
    for i in found.apart:
        rows[f"apart {i}"] = f"{names[i]}: {found.reasons[i]}"
    return rows
