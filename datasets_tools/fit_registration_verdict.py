"""Fit the model behind `Registration.verdict` on one half of the shapes and check it on the other half.

Every shape is registered to changed copies of itself in random poses (noise, other facets, crops of one or both,
clutter) and to what it must not be laid on (another shape, its mirror image, other sizes, the part that is missing).
A shape belongs to one half by its name, so that no shape is in both. An answer is right when it is within 2 degrees
and 1 % of the diagonal of the truth; where there is a right answer, ambiguous ones (symmetric shapes) are left out.

DATA is a folder with faces/, closed/, open/, asteroids/ and range_scans/; without it, shapes are made by formula.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import tool

EXAMPLES = ("fit_registration_verdict.py --data data --outcomes outcomes.json -o verdict.md",)
# What is done to a shape; of those in a tuple one is chosen.
RIGHT = (
    ("noise 0.003", "noise 0.006", "noise 0.012"), ("copy", "coarse"), ("cropped 0.5", "cropped 0.3", "cropped 0.7"),
    ("worn 0.3", "worn 0.5"), ("both 0.3", "both 0.4", "both 0.2"), ("plane", "shoulders"),
)  # fmt: skip
WRONG = (("other",), ("scale 1.1", "scale 0.9", "scale 1.05"), ("mirrored", "scale 2"), ("disjoint", "other cropped"))

# Faces and animals are nearly their own mirror images, which then have a right answer.
PENALTY = 0.002  # of the squared weights: evidence that says the same shares its weight
FALSE = 0.02  # share of the wrong answers of the fitted half that may be called right
MARGIN = 0.05  # log-odds from a wrong answer to the limit
EXPRESSIONS = "face, another expression or person"
CHIRAL = ("formula", "formula, open", "asteroid")


def changed(kind: str, shape: Any, other: Any, seed: int) -> tuple[Any, Any]:
    """Make source and target of a pair."""
    import numpy as np
    from registration_changes import before_a_plane, both_cropped, extent, mirrored, with_shoulders
    from registration_pairs import cropped, decimated, noisy

    word, _, number = kind.partition(" ")
    value = float(number) if number.replace(".", "").isdigit() else 0.0
    light = noisy(decimated(shape, max(400, int(0.7 * len(shape[1])))), 0.001 * extent(shape), seed)
    if word == "noise":
        return shape, noisy(shape, value * extent(shape), seed)
    if word == "coarse":
        return shape, decimated(shape, 500)
    if word == "worn":
        return shape, cropped(noisy(shape, 0.006 * extent(shape), seed), value, seed)
    if word == "cropped":
        return shape, cropped(light, value, seed)
    if word == "both":
        return both_cropped(shape, light, value, seed)
    if word == "disjoint":
        return both_cropped(shape, light, 0.5, seed)
    if word == "plane":
        return shape, before_a_plane(light)
    if word == "shoulders":
        return shape, with_shoulders(light)
    if word == "scale":
        return shape, (light[0] * value, light[1])
    if word == "mirrored":
        return shape, mirrored(light)
    if word == "other":
        size = extent(shape) / extent(other)
        middle = other[0].mean(axis=0)
        moved = ((other[0] - middle) * size + shape[0].mean(axis=0), other[1])
        return shape, cropped(moved, 0.3, seed) if number else moved
    return shape, (np.array(light[0]), light[1])


def pairs(
    data: Path | None, rounds: int, first: int, halves: Sequence[int]
) -> Iterator[tuple[str, str, str, bool, Any]]:
    """Give half, kind of shape, what was done, whether there is a right answer, and the pair."""
    import numpy as np
    from registration_pairs import posed
    from registration_shapes import half_of, shapes

    known = [(kind, name, get) for kind, name, get in shapes(data)]
    for turn in range(first, first + rounds):
        for place, (kind, name, get) in enumerate(known):
            half = half_of(name)
            if half not in halves:
                continue
            others = [g for k, n, g in known if k == kind and n != name and half_of(n) == half]
            rng = np.random.default_rng([29, turn, place])
            for right, rows in ((True, RIGHT), (False, WRONG)):
                for choice in rng.permutation(len(rows))[:2]:
                    row = rows[choice][rng.integers(len(rows[choice]))]
                    if (row.startswith("other") and not others) or (row == "mirrored" and kind not in CHIRAL):
                        continue
                    other = others[rng.integers(len(others))]() if row.startswith("other") else None
                    seed = 1000 * turn + place
                    source, target = changed(row, get(), other, seed)
                    pair = posed(f"{name} {row}, round {turn}", seed, source, target, np.eye(4))
                    yield str(half), kind, row, right, pair
    if data is not None:
        yield from expression_pairs(data, halves)
        yield from range_pairs(data, halves)


def expression_pairs(data: Path, halves: Sequence[int]) -> Iterator[tuple[str, str, str, bool, Any]]:
    """Two expressions of one face, and another person's face."""
    import numpy as np
    from registration_pairs import OTHER, posed
    from registration_shapes import half_of, thinned

    for number, path in enumerate(sorted((data / "faces").glob("ict*.ply"))):
        person, expression = path.stem.split("_")
        half = half_of(path.stem)
        if half not in halves:
            continue
        face = thinned(path, 5000)
        other = thinned(path.with_name(f"{person}_{OTHER[expression]}.ply"), 4000)
        changed_face = posed(f"{path.stem} expression", number, face, other, np.eye(4))
        yield str(half), EXPRESSIONS, "expression", True, changed_face
        others = [p for p in sorted((data / "faces").glob(f"ict*_{expression}.ply")) if half_of(p.stem) == half]
        stranger = others[(others.index(path) + 1) % len(others)]
        if stranger != path:
            pair = posed(f"{path.stem} other person", number, face, thinned(stranger, 4000), np.eye(4))
            yield str(half), EXPRESSIONS, "other person", False, pair


def range_pairs(data: Path, halves: Sequence[int]) -> Iterator[tuple[str, str, str, bool, Any]]:
    """Scans of one object: those of each half with each other."""
    from registration_pairs import range_scans
    from registration_shapes import half_of

    for name, overlap, pair in range_scans(data, most=None):
        one, two = (half_of("scan " + part) for part in name.split("|"))
        if one == two and one in halves and (overlap >= 0.3 or overlap < 0.05):
            yield str(one), "range scan", f"overlap {overlap:.2f}", overlap >= 0.3, pair


def measured(pair: Any) -> dict[str, Any]:
    """Register a pair; what is right or doubted, the numbers of the verdict, the probability."""
    from evaluate_registration import SUCCESS_DEG, SUCCESS_SHARE, errors

    import voxkernel
    from voxkernel.registration.pair import solve
    from voxkernel.registration.prepare import prepare
    from voxkernel.registration.register import DEFAULT_MARGINS
    from voxkernel.registration.search import inverse

    one, two = (prepare(voxkernel.as_mesh(s), DEFAULT_MARGINS) for s in (pair.source, pair.target))
    both = (one, two) if one.area <= two.area else (two, one)
    found = solve(both, both, "point_to_plane")
    angle, shift = errors(found.transform if both[0] is one else inverse(found.transform), pair)
    judged = found.judged
    return {
        "right": angle < SUCCESS_DEG and shift < SUCCESS_SHARE, "ambiguous": found.ambiguous,
        "converged": found.converged, "numbers": judged.numbers.tolist(), "size": judged.size,
        "probability": judged.probability, "degrees": angle, "shift": shift,
    }  # fmt: skip


def fitted(numbers: Any, right: Any, signs: Any) -> tuple[Any, Any, Any, float]:
    """Logistic regression with a penalty; a weight cannot have the sign that contradicts its meaning."""
    import numpy as np
    from scipy.optimize import minimize

    center, spread = numbers.mean(axis=0), numbers.std(axis=0)
    x = (numbers - center) / spread
    share = np.where(right, 0.5 / right.sum(), 0.5 / (~right).sum())

    def loss(w: Any) -> tuple[float, Any]:
        z = x @ w[:-1] + w[-1]
        signed = np.where(right, z, -z)
        value = share @ np.logaddexp(0.0, -signed) + PENALTY * (w[:-1] ** 2).sum()
        pull = share * np.where(right, -1.0, 1.0) / (1.0 + np.exp(np.clip(signed, -50, 50)))
        return float(value), np.append(x.T @ pull + 2.0 * PENALTY * w[:-1], pull.sum())

    bounds = [(0.0, None) if s > 0 else (None, 0.0) for s in signs] + [(None, None)]
    answer = minimize(loss, np.zeros(x.shape[1] + 1), jac=True, bounds=bounds, method="L-BFGS-B").x
    return center, spread, answer[:-1], float(answer[-1])


def believed(numbers: Any, model: Any) -> Any:
    """Log-odds that a model gives."""
    center, spread, weights, bias = model
    return (numbers - center) / spread @ weights + bias


def limit(odds: Any, right: Any) -> float:
    """Log-odds from which an answer is right: above all wrong answers of the fitted half but a few."""
    import numpy as np

    return float(np.quantile(odds[~right], 1.0 - FALSE, method="higher")) + MARGIN


def report(outcomes: list[dict[str, Any]], fits: dict[str, Any]) -> str:
    """What the library and the model of each half say of the other half, by kind of shape, and their reliability."""
    import numpy as np

    from voxkernel.registration.verdict import NO_MATCH as NO
    from voxkernel.registration.verdict import RIGHT as RIGHT_AT

    x = np.array([o["numbers"] for o in outcomes])
    right = np.array([o["right"] for o in outcomes])
    half = np.array([o["half"] for o in outcomes])
    heads = ("", "pairs", "right answers", "called right", "wrong answers", "called right", "called no match")
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * 7]
    reliability: list[str] = []
    doubted = np.array([o["ambiguous"] or not o["converged"] for o in outcomes])
    said = np.clip([o["probability"] for o in outcomes], 1e-12, 1.0 - 1e-12)
    for own, other in (("library", "0"), ("library", "1"), *([(own, other) for own in fits for other in ("0", "1")])):
        if own == "library":
            odds, enough, least = np.log(said / (1.0 - said)), np.log(RIGHT_AT / (1 - RIGHT_AT)), np.log(NO / (1 - NO))
        else:
            (model, enough), least = fits[own], np.log(NO / (1 - NO))
            odds = believed(x, model)
        here = half == other
        words = {other: "to which the model was fitted", "library": "as the library says"}
        title = f"half {other}, " + words.get(own, f"model of half {own}")
        groups = {f"**{title}**": here}
        if own != other:
            kinds = dict.fromkeys(o["kind"] for o in outcomes)
            groups |= {kind: here & np.array([o["kind"] == kind for o in outcomes]) for kind in kinds}
        for name, mask in groups.items():
            r, w = mask & right, mask & ~right
            called = (odds >= enough) & ~doubted
            counts = (mask.sum(), r.sum(), (called & r).sum(), w.sum(), (called & w).sum(), (odds[w] < least).sum())
            lines.append(f"| {name} | " + " | ".join(map(str, counts)) + " |")
        if own != other:
            edges = [0.0, 0.02, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0 + 1e-9]
            p = 1.0 / (1.0 + np.exp(-odds))
            cells = [(here & (p >= a) & (p < b)) for a, b in pairwise(edges)]
            reliability += [f"| {title} | " + " | ".join(f"{c.sum()}, {(c & right).sum()}" for c in cells) + " |"]
    names = ("0.00 to 0.02", "to 0.20", "to 0.50", "to 0.80", "to 0.95", "to 0.99", "to 1.00")
    lines += ["", f"| probability: pairs, right | {' | '.join(names)} |", "|" + "---|" * 8, *reliability]
    return "\n".join(lines) + "\n"


def shown(model: Any, enough: float, names: Sequence[str]) -> str:
    """The lines of `voxkernel/registration/verdict.py` that a model stands for."""
    import numpy as np

    text = "\nThe model of half 0:\n\n"
    for name, row in zip(("_CENTERS", "_SPREADS", "_WEIGHTS"), model[:3], strict=True):
        text += f"    {name} = ({', '.join(f'{v:.4f}' for v in row)})\n"
    text += f"    _BIAS = {model[3]:.4f}\n    RIGHT = {1.0 / (1.0 + np.exp(-enough)):.3f}\n"
    return text + f"    # {', '.join(f'{n} {w:.2f}' for n, w in zip(names, model[2], strict=True))}\n"


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the arguments and run."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("--data", metavar="DATA", help="folder with faces/, closed/, open/, asteroids/, range_scans/")
    parser.add_argument("--rounds", type=tool.positive, default=1, metavar="N", help="times through all shapes")
    parser.add_argument("--first-round", type=int, default=0, metavar="R", help="others are other changes and poses")
    parser.add_argument("--halves", type=int, nargs="+", choices=(0, 1), default=(0, 1), metavar="H", help="0, 1")
    parser.add_argument("--every", type=tool.positive, default=1, metavar="K", help="only every K-th pair")
    parser.add_argument("--kinds", nargs="+", metavar="KIND", help="kinds of shapes; all by default")
    parser.add_argument("--fit", action="store_true", help="fit a model to each half; else only judge the library's")
    parser.add_argument("--first", type=int, default=0, metavar="J", help="where to begin with those")
    parser.add_argument("--outcomes", metavar="FILE", help="every outcome, a line each; those there are not made again")
    parser.add_argument("-o", "--output", metavar="TABLE.md")
    return tool.run(_run, parser.parse_args(argv))


def _run(args: argparse.Namespace) -> int:
    import numpy as np

    from voxkernel.registration.verdict import NAMES, SIGNS

    place = None if args.outcomes is None else Path(args.outcomes)
    outcomes: list[dict[str, Any]] = []
    if place is not None and place.exists():
        outcomes = [json.loads(line) for line in place.read_text(encoding="utf-8").splitlines()]
    done = {(o["kind"], o["pair"]) for o in outcomes}
    data = None if args.data is None else Path(args.data)
    made = pairs(data, args.rounds, args.first_round, args.halves)
    wanted = (p for p in made if args.kinds is None or p[1] in args.kinds)
    for count, (half, kind, row, possible, pair) in enumerate(wanted):
        if count % args.every != args.first or (kind, pair.row) in done:
            continue
        began = time.process_time()
        found = measured(pair)
        entry = {"half": half, "kind": kind, "pair": pair.row, "row": row, "possible": possible, **found}
        entry |= {"right": found["right"] and possible, "cpu": time.process_time() - began}
        outcomes.append(entry)
        if place is not None:
            with place.open("a", encoding="utf-8") as file:
                file.write(json.dumps(entry) + "\n")
        words = f"right {entry['right']} of {possible}, {entry['probability']:.3f}"
        tool.say(f"{kind} {pair.row}: {words}", quiet=args.quiet)
    used = [o for o in outcomes if o["row"] != "mirrored" or o["kind"] in CHIRAL]
    used = [o for o in used if not (o["ambiguous"] and o["possible"])]
    if args.fit:
        used = [o for o in used if np.isfinite(np.array(o["numbers"], float)).all()]
    fits: dict[str, Any] = {}
    for half in sorted({o["half"] for o in used}) if args.fit else ():
        own = [o for o in used if o["half"] == half]
        x, right = np.array([o["numbers"] for o in own]), np.array([o["right"] for o in own])
        model = fitted(x, right, np.array(SIGNS))
        fits[half] = model, limit(believed(x, model), right)
    text = report(used, fits)
    text += f"\n{len(outcomes)} pairs, {len(outcomes) - len(used)} left out.\n"
    if fits:
        text += shown(*fits["0"], NAMES)
    print(text, end="")
    if args.output is not None:
        Path(args.output).write_text(text, encoding="utf-8")
    return tool.OK


if __name__ == "__main__":
    sys.exit(main())
