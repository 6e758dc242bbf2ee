"""`voxkernel labels`: one row per object of label images, a report, and maps to lay over them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from voxkernel.cli.evaluate import add_label_arguments, label_options
from voxkernel.cli.failures import show_failures
from voxkernel.cli.messages import option_names
from voxkernel.cli.output import UsageError, display, say

if TYPE_CHECKING:
    from voxkernel.evaluation.inputs import Item

HELP = "label images: which objects are star-convex, from where, and why not"
DESCRIPTION = (
    "Look at every object of label images of 2 or 3 axes: how much of it its best voxel sees (V*, certified), how\n"
    "well rays from there describe it, and why it falls short. Writes a run (RUN/rows/*.parquet, as `evaluate` does)\n"
    "and RUN/report.html. The same command again goes on where an interrupted run stopped."
)
EXAMPLES = (
    "voxkernel labels nuclei.tif --spacing 2,1,1 -o out/",
    "voxkernel labels cells.h5::label -o out/ --csv",
    "voxkernel labels organs.nii.gz -o out/ --surface --map seen.nii.gz",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("images", nargs="+", metavar="IMAGE", help="label images, or folders of them")
    parser.add_argument("-o", "--output", metavar="RUN", required=True, help="directory of the run")
    add_label_arguments(parser)
    out = parser.add_argument_group("what is written")
    out.add_argument("--no-pictures", action="store_true", help="do not draw the worst objects")
    out.add_argument(
        "--map", metavar="FILE",
        help="of one image, to lie over it: hidden voxels 1, seen 2, centres 3; .tif, .nii, .nii.gz or .npz",
    )  # fmt: skip
    out.add_argument("--csv", action="store_true", help="write RUN/rows.csv as well")
    engine = parser.add_argument_group("how it runs")
    engine.add_argument("--workers", type=int, metavar="N", help="processes; one per core by default")
    engine.add_argument(
        "--timeout", type=float, default=3600.0, metavar="S", help="seconds per object, 0: none; 3600 by default"
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate, write the report, and say in one line what was found."""
    from voxkernel.cli.progress import shown
    from voxkernel.evaluation import EvaluateSettings, evaluate
    from voxkernel.evaluation.inputs import BadInput
    from voxkernel.labels import is_label_file
    from voxkernel.report import write_report

    for path in args.images:
        if Path(path).is_file() and not is_label_file(path):
            raise UsageError(f"IMAGE must be a label image; got '{display(path)}'")
    try:
        settings = EvaluateSettings(
            **label_options(args), label_images=True, thumbnails=not args.no_pictures, workers=args.workers,
            timeout=args.timeout or None, csv=args.csv,
        )  # fmt: skip
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error
    mapped = None if args.map is None else _image_to_map(args)
    try:
        with shown(quiet=args.quiet) as progress:
            result = evaluate(args.images, output=args.output, settings=settings, progress=progress)
    except BadInput as error:
        words = str(error).replace("`paths` must lead to at least one mesh", "IMAGE must lead to a label image")
        raise UsageError(words) from error
    page = Path(args.output) / "report.html"
    with args.stage("writing the report"):
        summary = write_report(page, args.output)
    if mapped is not None:
        with args.stage(f"writing {display(str(args.map))}"):
            _write_map(args, settings, mapped, is_whole=not result.n_failed)
    names = option_names(args.parser)
    failed = [(entry["file"], entry.get("object"), entry["reason"]) for entry in summary["failures"]["rows"]]
    show_failures(failed, len(failed), names)
    in_parts = {file for file, number, _ in failed if number is not None}  # images whose other objects are there
    n_whole = max(0, result.n_failed - len(in_parts))
    words = [_words(summary.get("objects"))] if result.n_ok or in_parts else []
    if in_parts:
        words.append(f"{sum(number is not None for _, number, _ in failed)} objects failed")
    if n_whole:
        words.append(f"{n_whole} of {result.n_ok + result.n_failed} images failed")
    print(f"{display(args.output)}: {'; '.join(words)}")
    return 1 if result.n_failed else 0


def _image_to_map(args: argparse.Namespace) -> Item:
    """Refuse a map that is of no single image, or that would take its place, before anything is computed."""
    from voxkernel.evaluation.inputs import BadInput, find_items
    from voxkernel.labels import check_target, is_label_file

    try:
        items = [item for item in find_items(args.images, label_images=True) if is_label_file(item.url)]
    except BadInput as error:
        raise UsageError(str(error)) from error
    try:
        check_target(args.map, [item.url for item in items])
    except ValueError as error:
        raise UsageError(f"--map {str(error).removeprefix('`path` ')}") from error
    if len(items) != 1:
        raise UsageError(f"--map must be given with one image; got {len(items) or 'none'}")
    if "://" in items[0].url:
        raise UsageError(f"--map must be given with an image on this machine; got '{display(items[0].url)}'")
    return items[0]


def _words(objects: Any) -> str:
    if not objects:
        return "no objects"
    shares = "".join(f", {n} {reason}" for reason, n in objects["shortfalls"].items())
    rays = objects["recommended_rays"]
    advice = f"; {rays} rays bring 90 % of them to an overlap of 0.8" if rays else ""
    return f"{objects['n']} objects, {objects['n_star']} seen whole from one voxel{shares}{advice}"


def _write_map(args: argparse.Namespace, settings: Any, item: Item, *, is_whole: bool) -> None:
    """Paint what the rows of the run say; where the image failed, its objects that have rows, if any."""
    import numpy as np

    from voxkernel._extras import optional
    from voxkernel.labels import LabelObjects, paint_seen, read_labels, write_labels
    from voxkernel.run_index import open_index
    from voxkernel.run_table import open_run

    index = open_index(*open_run(args.output), ("kind", "voxels", "box_low", "box_high", "center_index"))
    compute, keys = optional("pyarrow.compute"), index.keys
    rows = keys.filter(compute.and_(compute.equal(keys["file"], item.name), compute.equal(keys["kind"], "label")))
    index.close()
    if not is_whole and not rows.num_rows:
        return
    image = read_labels(item.url, spacing=settings.spacing)
    label, voxels = (rows.column(name).to_numpy() for name in ("object", "voxels"))
    low, high, center = (
        np.array(rows.column(name).to_pylist(), dtype=np.int64).reshape(-1, len(image.shape))
        for name in ("box_low", "box_high", "center_index")
    )
    painted = paint_seen(image, LabelObjects(label=label, voxels=voxels, low=low, high=high), center)
    write_labels(args.map, painted, like=image)
    if not is_whole and rows.column("n_objects")[0].as_py() > rows.num_rows:
        n = rows.column("n_objects")[0].as_py() - rows.num_rows
        say(f"objects without a row, not in {display(args.map)}: {n}", quiet=args.quiet)
