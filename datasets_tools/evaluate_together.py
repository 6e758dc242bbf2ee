"""How many scans `register_together` lays right, of sets of partial scans with strangers among them.

Strips of faces, views of closed bodies, crops, and range scans, each in a random pose, with one or two scans of other
things. A scan is right when it is within 2 degrees and 1 % of the diagonal of where it belongs; strangers must have no
pose. The rules were fitted on the half "tune"; no object of "report" is in it but for the one of the range scans, whose
scans are others.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tool

if TYPE_CHECKING:
    from scan_sets import ScanSet

EXAMPLES = (
    "evaluate_together.py --data data -o together.md --json together.json",
    "evaluate_together.py --data data --half tune --sets 1",
)
COLUMNS = ("set", "scans", "right", "wrong", "no pose", "strangers", "refused", "pairs tried", "of", "CPU seconds")


def measured(found: Any, scans: ScanSet) -> dict[str, int]:
    """Count the scans that are right, wrong and without a pose, and the strangers that were refused."""
    import numpy as np

    truths = scans.T_common_scan
    placed = [i for i, T in enumerate(truths) if T is not None and i not in found.apart]
    extent = max(float(np.linalg.norm(np.ptp(s[0][s[1].ravel()], axis=0))) for s in scans.scans)

    def right(base: int) -> int:
        return sum(_off(found.poses, truths, base, i, scans.scans[i][0].mean(axis=0), extent) for i in placed)

    # In the frame that most scans agree with: one wrong scan must not make all others wrong.
    n_right = max((right(base) for base in placed), default=0)
    n_right = 0 if len(placed) < 2 else n_right
    known = sum(T is not None for T in truths)
    strangers = [i for i, T in enumerate(truths) if T is None]
    return {
        "scans": known, "right": n_right, "wrong": len(placed) - n_right, "no pose": known - len(placed),
        "strangers": len(strangers), "refused": sum(i in found.apart for i in strangers),
        "pairs tried": sum(p.use != "not tried" for p in found.pairs), "of": len(found.pairs),
    }  # fmt: skip


def _off(poses: Any, truths: Any, base: int, i: int, middle: Any, extent: float) -> bool:
    """Whether scan i lies beside the base as it should."""
    import numpy as np

    ours = np.linalg.inv(poses[base]) @ poses[i]
    true = np.linalg.inv(truths[base]) @ truths[i]
    turn = ours[:3, :3] @ true[:3, :3].T
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    shift = np.linalg.norm((ours - true)[:3] @ np.append(middle, 1.0))
    return bool(angle < 2.0 and shift < 0.01 * extent)


def main(argv: Sequence[str] | None = None) -> int:
    """Parse arguments and run."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("--data", type=Path, required=True, metavar="DIR", help="faces/, closed/ and range_scans/")
    parser.add_argument("--half", choices=("tune", "report"), default="report", help="report by default")
    parser.add_argument("--sets", type=int, default=3, metavar="N", help="sets of each kind, 1 to 3; 3 by default")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes; 1 by default")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="the table as Markdown")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every set and every pair")
    return tool.run(_run, parser.parse_args(argv))


def _run(args: argparse.Namespace) -> int:
    import scan_sets

    import voxkernel

    if not (args.data / "range_scans").is_dir():
        raise tool.UsageError(f"`--data` must hold range_scans/; got '{args.data}'")
    rows: list[dict[str, Any]] = []
    raw: list[dict[str, Any]] = []
    for scans in scan_sets.sets(args.data, args.half, args.sets):
        began = time.process_time()
        found = voxkernel.register_together(scans.scans, workers=args.workers)
        seconds = time.process_time() - began
        row = {"set": f"{scans.row}, {scans.name}", **measured(found, scans), "CPU seconds": round(seconds, 1)}
        rows.append(row)
        raw.append({**row, "found": found.to_dict()})
        tool.say(", ".join(f"{k} {v}" for k, v in row.items()), quiet=args.quiet)
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    lines += ["| " + " | ".join(str(row[c]) for c in COLUMNS) + " |" for row in rows]
    table = "\n".join(lines) + "\n"
    if args.json is not None:
        args.json.write_text(json.dumps(raw), encoding="utf-8")
    if args.output is not None:
        args.output.write_text(table, encoding="utf-8")
    sys.stdout.write(table)
    return tool.OK


if __name__ == "__main__":
    sys.exit(main())
