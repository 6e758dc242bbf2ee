"""Success rates of registration through kernels beside FPFH + RANSAC, fast global registration, PCA and ICP.

Every pair is a surface and a changed copy of it (or another scan of the same object) in a random pose; the
true motion is known. A registration succeeds when it is within 2 degrees and 1 % of the diagonal of it. All
methods run in the same process on the same pairs, and all but ours end in the same ICP.

DATA is a folder with scans/ and its ground_truth.json, faces/ and closed/. Without it, pairs are made from a
face by formula. Seconds are of CPU, of all threads. Rows to refuse have no right answer.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tool

if TYPE_CHECKING:
    from registration_pairs import Pair

EXAMPLES = (
    "evaluate_registration.py --data data -o registration.md --json registration.json",
    "evaluate_registration.py --pairs 2 --methods kernels ransac",
    "evaluate_registration.py --data data --rows partial --only shoulders --first 100 --outcomes outcomes.jsonl",
)
USUAL = ("kernels", "overlap", "ransac", "kiss", "fgr", "pca", "icp")
NAMES = (*USUAL, "ransac35", "ransac75", "kiss35", "kiss75", "kissgicp")
ROWS = ("scans", "closed", "partial", "bodies", "range", "refused", "sizes")
SUCCESS_DEG, SUCCESS_SHARE = 2.0, 0.01


@dataclass(frozen=True)
class Outcome:
    """What one method made of one pair; errors in degrees and in shares of the source's diagonal."""

    row: str
    pair: int
    method: str
    start_deg: float
    start_share: float
    final_deg: float
    final_share: float
    seconds: float
    ambiguous: bool = False
    led_by: str = ""
    verdict: str = ""
    probability: float | None = None
    evidence: dict[str, float] | None = None

    @property
    def success(self) -> bool:
        """Whether the final motion is close enough to the true one."""
        return self.final_deg < SUCCESS_DEG and self.final_share < SUCCESS_SHARE


def errors(found: Any, pair: Pair) -> tuple[float, float]:
    """Angle to the true rotation, and how far the source's centre is off, as a share of its diagonal.

    A pair without a true motion is off by more than any.
    """
    import numpy as np
    from scipy.spatial.transform import Rotation

    if pair.T_target_source is None:
        return 360.0, 1.0
    turn = Rotation.from_matrix(found[:3, :3] @ pair.T_target_source[:3, :3].T)
    centre = pair.source[0].mean(axis=0)
    off = (found - pair.T_target_source)[:3] @ np.append(centre, 1.0)
    extent = np.linalg.norm(np.ptp(pair.source[0], axis=0))
    return float(np.degrees(turn.magnitude())), float(np.linalg.norm(off) / extent)


@dataclass(frozen=True)
class Kept:
    """Outcomes that were measured before, and where more are written."""

    path: Path | None
    known: tuple[Outcome, ...]

    def of(self, pair: Pair, method: str) -> Outcome | None:
        """What is known of a method on a pair."""
        key = pair.row, pair.number, method
        return next((o for o in self.known if (o.row, o.pair, o.method) == key), None)

    def write(self, outcome: Outcome) -> None:
        """Add an outcome, a line of JSON."""
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(outcome)) + "\n")


def kept(path: Path | None) -> Kept:
    """Read what there is."""
    if path is None or not path.exists():
        return Kept(path, ())
    return Kept(path, tuple(Outcome(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()))


def measure(pairs: Iterator[Pair], methods: list[str], before: Kept, *, quiet: bool) -> list[Outcome]:
    """Run all methods on every pair, but those whose outcome is known."""
    outcomes: list[Outcome] = []
    for pair in pairs:
        for name in methods:
            known = before.of(pair, name)
            if known is not None:
                outcomes.append(known)
                continue
            began = time.process_time()
            found = methods_of()[name][1](pair)
            seconds = time.process_time() - began
            off = (*errors(found.first, pair), *errors(found.final, pair))
            outcomes.append(Outcome(
                pair.row, pair.number, name, *off, seconds, found.ambiguous, found.led_by, found.verdict,
                found.probability if found.verdict else None, found.evidence or None,
            ))  # fmt: skip
            before.write(outcomes[-1])
        done = ", ".join(f"{o.method} {o.final_deg:.2f} {o.verdict}" for o in outcomes[-len(methods) :])
        tool.say(f"{pair.row} {pair.number}: degrees {done}", quiet=quiet)
    return outcomes


def table(outcomes: list[Outcome], methods: list[str]) -> str:
    """Write one line per row: successes, median error, CPU seconds of every method; what ours says of its answers."""
    import numpy as np

    lines = [
        "| pairs | " + " | ".join(methods_of()[m][0] for m in methods)
        + " | right ones called right | wrong ones called right |",
        "|---|" + "---|" * (len(methods) + 2),
    ]
    rows = list(dict.fromkeys(o.row for o in outcomes))
    for row in [*rows, "all"]:
        cells: list[str] = []
        for method in methods:
            mine = [o for o in outcomes if o.method == method and row in (o.row, "all")]
            final, seconds = (np.median([getattr(o, k) for o in mine]) for k in ("final_deg", "seconds"))
            won = f"**{sum(o.success for o in mine)}** of {len(mine)}; {final:.2f}°" if "refuse" not in row else "-"
            cells.append(f"{won}; {seconds:.2f} s")
        ours = [o for o in outcomes if o.method == "kernels" and row in (o.row, "all")]
        for wanted in (True, False):
            these = [o for o in ours if o.success is wanted]
            cells.append(f"{sum(o.verdict == 'right' for o in these)} of {len(these)}" if these else "-")
        lines.append(f"| {row} | " + " | ".join(cells) + " |")
    led = [o.led_by for o in outcomes if o.method == "kernels"]
    if led:
        words = ", ".join(f"{word} {led.count(word)}" for word in dict.fromkeys(led))
        lines += ["", f"What led to the answers: {words}."]
    return "\n".join(lines) + "\n"


def methods_of() -> dict[str, Any]:
    """Import the methods when they are needed."""
    from registration_methods import METHODS

    return METHODS


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the arguments and run."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("--data", metavar="DATA", help="folder with scans/, faces/ and closed/")
    parser.add_argument(
        "--pairs", type=tool.positive, default=10, metavar="N", help="pairs in every row; 10 by default"
    )
    parser.add_argument(
        "--methods", nargs="+", choices=NAMES, default=list(USUAL), metavar="M", help=", ".join(NAMES)
    )
    parser.add_argument("-o", "--output", metavar="TABLE.md")
    parser.add_argument("--json", metavar="RAW.json", help="every outcome")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS[:-1]), metavar="R", help=", ".join(ROWS))
    parser.add_argument("--only", nargs="+", metavar="WORD", help="pairs whose row holds one of the words")
    parser.add_argument(
        "--first", type=int, default=0, metavar="K",
        help="number of the first pair of a row, a multiple of 10; others are other poses, noise and crops",
    )
    parser.add_argument(
        "--outcomes", type=Path, metavar="FILE", help="every outcome, a line each; those there are not measured again"
    )
    return tool.run(_run, parser.parse_args(argv))


def _wanted(row: str, words: list[str] | None) -> bool:
    return words is None or any(word in row for word in words)


def _run(args: argparse.Namespace) -> int:
    from registration_pairs import closed_pairs, formula_pairs, scan_pairs
    from registration_rows import body_rows, partial_rows, range_rows, refused_rows, size_rows

    data = None if args.data is None else Path(args.data)
    if data is not None and not (data / "scans" / "ground_truth.json").exists():
        raise tool.UsageError(f"--data must hold scans/ground_truth.json; got '{args.data}'")
    tool.say("warming up: compiled loops, Open3D", quiet=args.quiet)
    for name in args.methods:
        methods_of()[name][1](next(formula_pairs(1)))
    before = kept(args.outcomes)
    if data is None:
        wanted = (p for p in formula_pairs(args.pairs) if _wanted(p.row, args.only))
        outcomes = measure(wanted, args.methods, before, quiet=args.quiet)
    else:
        makers = {
            "scans": scan_pairs, "closed": closed_pairs, "partial": partial_rows, "bodies": body_rows,
            "range": range_rows, "refused": refused_rows, "sizes": size_rows,
        }  # fmt: skip
        outcomes: list[Outcome] = []
        for name in args.rows:
            count = 10 * args.pairs if name == "range" else args.pairs
            wanted = (p for p in makers[name](data, count, args.first) if _wanted(p.row, args.only))
            outcomes += measure(wanted, args.methods, before, quiet=args.quiet)
    if args.only and not outcomes:
        raise tool.UsageError(f"--only must have a word of a row; got '{' '.join(args.only)}'")
    order = {name: k for k, name in enumerate(dict.fromkeys(o.row for o in outcomes))}
    outcomes.sort(key=lambda o: order[o.row])
    text = table(outcomes, args.methods)
    print(text, end="")
    if args.output is not None:
        Path(args.output).write_text(text, encoding="utf-8")
    if args.json is not None:
        lines = ",\n".join(json.dumps(asdict(o)) for o in outcomes)
        Path(args.json).write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    return tool.OK


if __name__ == "__main__":
    sys.exit(main())
