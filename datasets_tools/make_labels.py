#!/usr/bin/env python3
"""Write label images of solids made by formula, with what is known about them.

FOLDER gets one file per family and size, FAMILY-SIZE.npz (read by `voxkernel labels`), with `--count` objects in
random poses one behind the other, and manifest.csv with a row per object:
  file, object     the image and the object's number in it
  family, size     which formula, and the edge of its cube in voxels
  is_star_shaped   yes or no: whether a point of the solid sees it whole; empty where it is not known. Its voxels see a
                   little less along flat sides that become stairs, and much less in thin plates (l, starfish, sheet)
  fragments, holes of the solid; thin walls and gaps of small sizes may close or open in voxels
  volume           of the solid in voxels, empty where it is not known
  seed, parameters
Object k of a family and size depends only on --seed, the family, the size and k.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import tool

EXAMPLES = (
    "make_labels.py labels/",
    "make_labels.py labels/ --families ball,c --sizes 8,16,32 --count 5 --seed 3",
)
COLUMNS = (
    "file", "object", "family", "size", "is_star_shaped", "fragments", "holes", "volume", "seed", "parameters",
)  # fmt: skip
SIZES = "8,16,32,64"


def write_labels(
    folder: Path, *, families: list[str] | None = None, sizes: list[int], count: int = 10, seed: int = 0
) -> list[dict[str, Any]]:
    """Write the images and the manifest; returns its rows."""
    import numpy as np
    from label_formulas import FAMILIES, voxels

    rows: list[dict[str, Any]] = []
    for family in families or list(FAMILIES):
        for size in sizes:
            image = np.zeros((count * (size + 1), size, size), np.uint16)
            file = f"{family}-{size}.npz"
            for k in range(count):
                rng = np.random.default_rng([seed, list(FAMILIES).index(family), size, k])
                solid = FAMILIES[family](rng)
                part = image[k * (size + 1) : k * (size + 1) + size]
                part[voxels(solid, size, rng)] = k + 1
                volume = None if solid.volume is None else solid.volume * (size / 2) ** 3
                rows.append({
                    "file": file, "object": k + 1, "family": family, "size": size,
                    "is_star_shaped": solid.is_star_shaped, "fragments": solid.fragments, "holes": solid.holes,
                    "volume": volume, "seed": seed, "parameters": solid.parameters,
                })  # fmt: skip
            np.savez_compressed(folder / file, labels=image, spacing=np.ones(3))
    tool.write_csv(folder / "manifest.csv", COLUMNS, rows)
    return rows


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and write the images."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("folder", metavar="FOLDER", help="made if it is not there; its parent must be")
    parser.add_argument("--families", metavar="A,B,...", help="some of those of label_formulas.py; all by default")
    parser.add_argument("--sizes", metavar="N,M,...", default=SIZES, help=f"edges in voxels, 4 to 256; {SIZES}")
    parser.add_argument("--count", type=tool.positive, default=10, help="objects per family and size (default 10)")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers, >= 0 (default 0)")
    return tool.run(_run, parser.parse_args(argv))


def _run(args: argparse.Namespace) -> int:
    from label_formulas import FAMILIES

    if args.seed < 0:
        raise tool.UsageError(f"--seed must be at least 0; got {args.seed}")
    families = args.families.split(",") if args.families else None
    unknown = sorted(set(families or ()) - set(FAMILIES))
    if unknown:
        raise tool.UsageError(f"--families must be some of {', '.join(FAMILIES)}; got '{unknown[0]}'")
    try:
        sizes = [int(n) for n in args.sizes.split(",")]
    except ValueError:
        sizes = []
    if not sizes or not all(4 <= n <= 256 for n in sizes):
        raise tool.UsageError(f"--sizes must be numbers from 4 to 256 with commas between; got '{args.sizes}'")
    folder = tool.output_folder(args.folder)
    rows = write_labels(folder, families=families, sizes=sizes, count=args.count, seed=args.seed)
    tool.say(f"{len(rows)} objects and manifest.csv in {folder}", quiet=args.quiet)
    return tool.OK


if __name__ == "__main__":
    sys.exit(main())
