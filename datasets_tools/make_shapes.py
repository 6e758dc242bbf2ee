#!/usr/bin/env python3
"""Write labelled families of surfaces made by formula, with what is known about their kernels.

FOLDER gets one sub-folder per family with binary .ply files, and manifest.csv with a row per file:
  file            relative to FOLDER
  label           the family
  kind            which formula of the family
  truth           "star-shaped", "degenerate" or "not star-shaped"; empty where it is not known, or "broken"
  is_star_shaped  yes or no: whether the kernel is not empty
  dimension       of the kernel, -1 when it is empty
  kernel_volume   exact but for rounding; empty where it is not known or infinite
  defect          smallest share of the area that a point cannot face; empty where it is not known
  facets, seed, parameters
The number of facets is within a factor of 3 of --facets where the formula can be refined so far; re-triangulation
series start with a 16th of it. Shape k of a family depends only on --seed, --facets, the family and k, not on --count.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import tool

EXAMPLES = (
    "make_shapes.py shapes/",
    "make_shapes.py shapes/ --families convex,star,near-star --count 100 --facets 2000 --seed 7",
    "make_shapes.py many/ --count 1238 --facets 100 --broken 96       # 10,000 files, 96 of them unreadable",
)
COLUMNS = (
    "file", "label", "kind", "truth", "is_star_shaped", "dimension", "kernel_volume", "defect", "facets", "seed",
    "parameters",
)  # fmt: skip
BROKEN = ("no-bytes", "cut-off", "no-mesh", "nan", "bad-index", "no-facets")


def verdict(dimension: int | None) -> str | None:
    """Name the verdict that a kernel of this dimension has to get."""
    if dimension is None:
        return None
    return "star-shaped" if dimension == 3 else "degenerate" if dimension >= 0 else "not star-shaped"


def write_shapes(
    folder: Path,
    *,
    families: list[str] | None = None,
    count: int = 20,
    facets: int = 500,
    seed: int = 0,
    broken: int = 0,
    quiet: bool = True,
) -> list[dict[str, Any]]:
    """Write `count` shapes of each family and `broken` unreadable files; returns the rows of the manifest."""
    from shape_families import FAMILIES, make_shape

    from voxkernel import TriangleMesh

    names = list(FAMILIES) if families is None else families
    rows: list[dict[str, Any]] = []
    for family in names:
        (folder / family).mkdir(exist_ok=True)
        for index in range(count):
            kind, shape = make_shape(family, index, seed=seed, facets=facets)
            file = f"{family}/{kind}-{index:05d}.ply"
            TriangleMesh.from_triangles(*shape.surface).write(folder / file)
            rows.append({
                "file": file, "label": family, "kind": kind, "truth": verdict(shape.dimension),
                "is_star_shaped": shape.is_star_shaped, "dimension": shape.dimension,
                "kernel_volume": shape.kernel_volume, "defect": shape.defect, "facets": len(shape.surface[1]),
                "seed": seed, "parameters": shape.parameters,
            })  # fmt: skip
            tool.progress(len(rows), len(names) * count + broken, "files", quiet=quiet)
    rows += _write_broken(folder, broken, seed)
    tool.write_csv(folder / "manifest.csv", COLUMNS, rows)
    return rows


def _write_broken(folder: Path, count: int, seed: int) -> list[dict[str, Any]]:
    """Write files that no reader can make a surface of, in turns of six ways."""
    if count:
        (folder / "broken").mkdir(exist_ok=True)
    rows = []
    for index in range(count):
        kind = BROKEN[index % len(BROKEN)]
        file = f"broken/{kind}-{index:05d}.ply"
        (folder / file).write_bytes(_broken_bytes(kind, index))
        rows.append({"file": file, "label": "broken", "kind": kind, "truth": "broken", "seed": seed})
    return rows


def _broken_bytes(kind: str, index: int) -> bytes:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
    head += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
    points = f"0 0 0\n1 0 {index}\n0 1 0\n"
    texts = {
        "no-bytes": "",
        "cut-off": head.format(1) + points[:8],
        "no-mesh": f"this is no mesh, number {index}\n",
        "nan": head.format(1) + points.replace("1 0", "nan 0", 1) + "3 0 1 2\n",
        "bad-index": head.format(1) + points + "3 0 1 7\n",
        "no-facets": head.format(0) + points,
    }
    return texts[kind].encode()


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and write the shapes."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("folder", metavar="FOLDER", help="made if it is not there; its parent must be")
    parser.add_argument("--families", metavar="A,B,...", help="some of the families (see --list); all by default")
    parser.add_argument("--count", type=tool.positive, default=20, help="shapes per family (default 20)")
    parser.add_argument("--facets", type=tool.positive, default=500, help="aimed at for each shape (default 500)")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers, >= 0 (default 0)")
    parser.add_argument("--broken", type=int, default=0, metavar="N", help="write N unreadable files as well")
    parser.add_argument("--list", action=_List, help="print families and their formulas, and stop")
    return tool.run(_run, parser.parse_args(argv))


class _List(argparse.Action):
    def __init__(self, **options: Any) -> None:
        super().__init__(nargs=0, **options)

    def __call__(self, *_: Any) -> None:
        from shape_families import FAMILIES

        print(tool.table([("family", "kinds"), *((family, ", ".join(kinds)) for family, kinds in FAMILIES.items())]))
        sys.exit(tool.OK)


def _run(args: argparse.Namespace) -> int:
    from shape_families import FAMILIES

    if args.seed < 0 or args.broken < 0:
        raise tool.UsageError(f"--seed and --broken must be at least 0; got {min(args.seed, args.broken)}")
    families = args.families.split(",") if args.families else None
    unknown = sorted(set(families or ()) - set(FAMILIES))
    if unknown:
        raise tool.UsageError(f"--families must be some of {', '.join(FAMILIES)}; got '{unknown[0]}'")
    folder = tool.output_folder(args.folder)
    rows = write_shapes(
        folder, families=families, count=args.count, facets=args.facets, seed=args.seed, broken=args.broken,
        quiet=args.quiet,
    )  # fmt: skip
    tool.say(f"{len(rows)} files and manifest.csv in {folder}", quiet=args.quiet)
    return tool.OK


if __name__ == "__main__":
    sys.exit(main())
