#!/usr/bin/env python3
"""Compare the run of `voxkernel evaluate` with what a manifest knows: a report on classification.

RUN is a run directory; MANIFEST a CSV with `file` and any of label, kind, truth (or is_star_shaped or
kernel_nonempty), kernel_volume, defect, parameters, as `make_shapes.py` writes it. The report has
  verdicts   truth against verdict, with the share of certificates that were verified
  volumes    the largest relative difference of kernel volumes from the known ones
  defects    known smallest violations: Spearman's rank correlation with the bounds found, and how many lie between
  retrieval  how often the nearest other shape is of the same family or kind, by defect profile (sum of differences)
             and by spherical-harmonic energies (square roots, relative to degree 0); shapes of a series, which have
             one base, are not compared with others for this: of them it is asked whether the nearest has that base
`evaluate --profile --energies 8` makes good descriptors; by default a run has three values of the profile.
The report goes to stdout as Markdown or, with -o, to FILE.md and the numbers to FILE.json. Exit code 1 when a verdict
differs from the truth or files of the manifest are not in the run.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import tool

EXAMPLES = (
    "make_shapes.py shapes/ && voxkernel evaluate shapes/ -o run/ --profile --energies 8",
    "classify.py run/ --manifest shapes/manifest.csv",
    "classify.py run/ --manifest shapes/manifest.csv -o classification.md --title 'Shapes by formula'",
)


def read_run(run: str) -> list[dict[str, Any]]:
    """Read the rows of a run of `voxkernel.evaluate`."""
    from voxkernel.run_table import read_rows

    rows = read_rows(run).to_pylist()
    if not rows:
        raise ValueError(f"`run` must be a run directory with rows; got '{run}'")
    return rows


def markdown(found: dict[str, Any], title: str) -> str:
    """Write the report."""
    parts = [f"## {title}", _summary(found), _confusion(found["verdicts"]), _labels(found["verdicts"])]
    parts += [_defects(found["defects"]), _retrieval(found["retrieval"])]
    return "\n\n".join(part for part in parts if part) + "\n"


def _number(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"


def _summary(found: dict[str, Any]) -> str:
    verdicts, volumes = found["verdicts"], found["volumes"]
    lines = [f"* {found['meshes']} meshes, {found['seconds']['sum']:.1f} s of computation in total."]
    if verdicts["known"]:
        lines.append(f"* {verdicts['right']} of {verdicts['known']} verdicts with a known truth are right.")
    lines.append(f"* {verdicts['verified']} of {verdicts['certificates']} certificates were verified in rationals.")
    if volumes["count"]:
        lines.append(
            f"* {volumes['count']} kernel volumes are known and not 0; the largest relative difference is "
            f"{volumes['largest']:.1e}."
        )
    for name, what in (("missing", "files of the manifest are not in the run"), ("not_in_manifest", "are only there")):
        if found[name]:
            lines.append(f"* {len(found[name])} {what}.")
    if verdicts["wrong"]:
        lines.append(f"* Wrong: {tool.escaped(', '.join(verdicts['wrong'][:20]))}")
    return "\n".join(lines)


def _confusion(verdicts: dict[str, Any]) -> str:
    if not verdicts["confusion"]:
        return ""
    answers = list(next(iter(verdicts["confusion"].values())))
    rows = [("truth", *answers)]
    rows += [(truth, *(str(line[a]) for a in answers)) for truth, line in verdicts["confusion"].items()]
    if verdicts["unknown"]:
        rows.append(("not known", *(str(verdicts["unknown"][a]) for a in answers)))
    return "### Truth against verdict\n\n" + tool.markdown_table(rows)


def _labels(verdicts: dict[str, Any]) -> str:
    answers = [a for a in ("star-shaped", "degenerate", "not star-shaped", "failed")]
    rows = [("class", "meshes", *answers)]
    for label, counts in verdicts["labels"].items():
        rows.append((label, str(sum(counts.values())), *(str(counts[a]) for a in answers)))
    return "### Verdicts per class\n\n" + tool.markdown_table(rows)


def _defects(defects: dict[str, Any]) -> str:
    if not defects:
        return ""
    head = ("shapes", "count", "defect from", "to", "within the bounds", "Spearman, upper bound", "lower", "median gap")
    rows = [head]
    for name, d in defects.items():
        rho = (_number(d[f"spearman_{side}"], 6) for side in ("upper", "lower"))
        ends = (_number(d["smallest"], 3), _number(d["largest"], 3))
        rows.append((name, str(d["count"]), *ends, str(d["within_bounds"]), *rho, _number(d["median_gap"], 2)))
    return "### Known defects against the bounds found\n\n" + tool.markdown_table(rows)


def _retrieval(retrieval: dict[str, Any]) -> str:
    if not retrieval:
        return ""
    names = list(retrieval["label"])
    text = f"{retrieval['count']} shapes have all descriptors; {retrieval['left_out']} do not."
    parts = ["### Nearest neighbours", text]
    rows = [("same", "shapes", "by chance", *names)]
    details = []
    families, kinds = (retrieval[what][names[0]]["classes"] for what in ("label", "kind"))
    for what, title in (("label", "family"), ("kind", "kind")):
        first = retrieval[what][names[0]]
        if not first["count"] or (what == "kind" and kinds.keys() == families.keys()):
            continue
        hits = (_percent(retrieval[what][name]["accuracy"]) for name in names)
        rows.append((title, str(first["count"]), _percent(first["chance"]), *hits))
        details.append(_by_class(retrieval[what], title, names))
    for label, line in retrieval.get("series", {}).items():
        rows.append((f"base, of {label}", str(line["count"]), "-", *(_percent(line["accuracy"][n]) for n in names)))
    return "\n\n".join([*parts, tool.markdown_table(rows), *details])


def _by_class(found: dict[str, Any], title: str, names: list[str]) -> str:
    rows = [(title, "shapes", *names)]
    for name, line in found[names[0]]["classes"].items():
        hits = (_percent(found[method]["classes"][name]["accuracy"]) for method in names)
        rows.append((name, str(line["count"]), *hits))
    return tool.markdown_table(rows)


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and write the report."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("run", metavar="RUN", help="run directory of `voxkernel evaluate`, or its URL")
    parser.add_argument("--manifest", required=True, metavar="CSV", help="what is known about the files")
    parser.add_argument("-o", "--output", metavar="FILE.md", help="write the report here, and FILE.json")
    parser.add_argument("--title", default="Classification", help="heading of the report")
    parser.add_argument("--no-retrieval", action="store_true", help="leave nearest neighbours out")
    parser.add_argument("--json", action="store_true", help="the numbers as JSON on stdout instead of Markdown")
    return tool.run(_run, parser.parse_args(argv))


def _run(args: argparse.Namespace) -> int:
    from classification import classification

    target = Path(args.output) if args.output else None
    if target and target.suffix != ".md":
        raise tool.UsageError(f"--output must end in .md; got '{args.output}'")
    found = classification(read_run(args.run), tool.read_csv(args.manifest))
    if not found["meshes"]:
        raise ValueError(f"`manifest` must name files of the run; got none of them in '{args.manifest}'")
    if args.no_retrieval:
        found["retrieval"] = {}
    report = markdown(found, args.title)
    if target:
        target.write_text(report, encoding="utf-8", errors="backslashreplace")
        target.with_suffix(".json").write_text(tool.to_json(found) + "\n", encoding="utf-8", errors="backslashreplace")
    if args.json:
        print(tool.to_json(found))
    elif not target:
        print(report, end="")
    verdicts = found["verdicts"]
    tool.say(f"{verdicts['right']} of {verdicts['known']} known verdicts are right", quiet=args.quiet)
    return tool.FAILED if verdicts["wrong"] or found["missing"] else tool.OK


if __name__ == "__main__":
    sys.exit(main())
