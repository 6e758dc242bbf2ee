"""`voxkernel evaluate`: a table with one row per mesh of a data set."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import islice
from typing import TYPE_CHECKING, Any

from voxkernel.cli.failures import show_failures
from voxkernel.cli.messages import option_names
from voxkernel.cli.output import UsageError, display, say

if TYPE_CHECKING:
    from voxkernel.evaluation import EvaluationResult

HELP = "a table of a whole data set, one row per mesh"
DESCRIPTION = (
    "Evaluate meshes, folders with all below them, globs and URLs on several processes: facts, verdict with its\n"
    "certificate, kernel volume, star centre, defect profile. Rows appear in RUN/rows/*.parquet as work finishes.\n"
    "A mesh that cannot be read, takes too long or kills its process costs its own row, which says why.\n"
    "The same command again goes on where an interrupted run stopped."
)
EXAMPLES = (
    "voxkernel evaluate scans/ -o run/",
    "voxkernel evaluate 'shapes/*.ply' -o run/ --labels labels.csv --views 50 --csv",
    "voxkernel evaluate shapes/ -o run/ --labels folders --profile --energies 16",
    "voxkernel evaluate s3://bucket/meshes -o s3://bucket/run --scheduler tcp://10.0.0.1:8786",
    "voxkernel evaluate scans/ -o run/ --retry-failed --timeout 3600",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("paths", nargs="+", metavar="PATH", help="meshes, folders, globs, or fsspec URLs (s3://...)")
    parser.add_argument("-o", "--output", metavar="RUN", required=True, help="directory or URL of the run")
    row = parser.add_argument_group("what is in a row")
    row.add_argument("--domain", choices=("ball", "hull", "box"), help="where kernels are looked for")
    row.add_argument("--depth", type=int, default=6, metavar="D", help="2**D voxels for relaxed kernels; 6 by default")
    row.add_argument("--tolerances", metavar="A,B", help="shares of the defect profile; 0.01,0.03,0.1 by default")
    row.add_argument("--profile", action="store_true", help="defect profile for 26 tolerances, 0 to 0.5")
    row.add_argument("--visible", action="store_true", help="cast rays: how much is visible from the star centre")
    row.add_argument("--guards", type=float, metavar="C", help="how many points see this share of the area, 0.99")
    row.add_argument("--energies", type=int, metavar="L", help="spherical-harmonic energies up to this degree")
    row.add_argument("--label-images", action="store_true", help="take label images of folders and globs, too")
    row.add_argument("--labels", metavar="CSV", help="columns file,label; or the word 'folders'")
    add_label_arguments(parser)
    pictures = parser.add_argument_group("for a report")
    pictures.add_argument(
        "--thumbnails", action=argparse.BooleanOptionalAction,
        help="draw every surface with its kernel; by default in runs of up to 200 files",
    )  # fmt: skip
    pictures.add_argument(
        "--views", default="0", metavar="N", help="simplified copies to turn, of the first N, or 'all'"
    )
    pictures.add_argument("--csv", action="store_true", help="write RUN/rows.csv as well")
    engine = parser.add_argument_group("how it runs")
    engine.add_argument("--workers", type=int, metavar="N", help="processes; one per core by default")
    engine.add_argument("--scheduler", metavar="URL", help="a Dask scheduler to use and trust instead, tls://host:8786")
    engine.add_argument(
        "--timeout", type=float, default=300.0, metavar="S", help="seconds per mesh, 0 for none; 300 by default"
    )
    engine.add_argument("--threads", type=int, default=1, metavar="N", help="threads of one process; 1 by default")
    engine.add_argument("--memory", "--memory-limit", dest="memory_limit", metavar="SIZE",
                        help="memory of one process, such as 4GB")  # fmt: skip
    engine.add_argument("--retry-failed", action="store_true", help="try again what failed in an earlier run")
    engine.add_argument("--rehash", action="store_true", help="hash files again that have not been touched")


def add_label_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what is asked about label images."""
    image = parser.add_argument_group("label images (.tif, .nii, .nrrd, .npy, .npz, .h5, .zarr): one row per object")
    image.add_argument(
        "--spacing", metavar="A,B,C",
        help="distance of voxel centres along each axis, in the order of the array's axes: z,y,x for .tif, .h5 and "
             ".zarr as a rule, x,y,z for .nii and .nrrd; it counts more than what the file stores, and must be given "
             "where it stores none, as .npy",
    )  # fmt: skip
    rays = "32,64,96,128,256"
    image.add_argument("--rays", default=rays, metavar="N,M", help=f"numbers of rays to try; {rays} by default")
    image.add_argument("--surface", action="store_true", help="also measure a smoothed surface of each object")


def label_options(args: argparse.Namespace) -> dict[str, Any]:
    """Settings of label images."""
    spacing = None if args.spacing is None else _numbers("--spacing", args.spacing, float)
    return {"spacing": spacing, "n_rays": _numbers("--rays", args.rays, int), "surface": args.surface}


def _numbers(option: str, text: str, kind: type) -> list[Any]:
    try:
        return [kind(v) for v in text.split(",")]
    except ValueError:
        what = "integers" if kind is int else "numbers"
        raise UsageError(f"{option} must be {what} with commas between; got '{display(text)}'") from None


def run(args: argparse.Namespace) -> int:
    """Evaluate, with progress on stderr."""
    _start_early(args)
    from voxkernel.cli.progress import shown
    from voxkernel.evaluation import evaluate
    from voxkernel.evaluation.inputs import BadInput
    from voxkernel.labels.image_files import is_label_file
    from voxkernel.report.text import left_out_text

    settings = _settings(args)
    try:
        with shown(quiet=args.quiet) as progress:
            result = evaluate(args.paths, output=args.output, settings=settings, labels=args.labels, progress=progress)
    except BadInput as error:
        raise UsageError(str(error)) from error
    for name in result.unmatched_labels[:10]:
        say(f"no mesh for the label of '{display(name)}'", quiet=args.quiet)
    if len(result.unmatched_labels) > 10:
        say(f"no mesh for {len(result.unmatched_labels) - 10} more labels", quiet=args.quiet)
    before = f", {result.n_reused} from an earlier run" if result.n_reused else ""
    show_failures(result.failures, result.n_failed_rows, option_names(args.parser))
    counts = f"{result.n_rows} rows, {_ok_text(result)}, {result.n_failed} failed{before}"
    left_out = left_out_text(result.left_out)
    print(f"{display(args.output)}: {counts}{'; ' if left_out else ''}{left_out}")
    if not args.label_images and any(is_label_file(f"x{suffix}") for suffix, _ in result.left_out):
        say("--label-images takes label images of folders and globs, too", quiet=args.quiet)
    return 1 if result.n_failed else 0


def _ok_text(result: EvaluationResult) -> str:
    """Meshes and images that went well, each where there are any."""
    n_meshes, n_images = result.n_ok - result.n_images_ok, result.n_images_ok
    words = [f"{n_meshes} meshes ok"] if n_meshes else []
    words += [f"{n_images} label image{'' if n_images == 1 else 's'} ok"] if n_images else []
    return ", ".join(words) or "0 ok"


def _start_early(args: argparse.Namespace) -> None:
    """Start the server of worker processes before all that this process imports, where there will be a new run."""
    if args.scheduler is not None or os.path.exists(args.output) or not all(map(os.path.exists, args.paths)):
        return
    if any(find_spec(package) is None for package in ("dask", "distributed", "pyarrow", "fsspec")):
        return
    from voxkernel._fork_server import FEW, start_method

    few = sum(1 for path in args.paths for _ in islice(_files(path), FEW + 1)) <= FEW
    start_method(for_analysis=True, for_pictures=few if args.thumbnails is None else args.thumbnails)


def _files(path: str) -> Iterator[str]:
    return (name for _, _, names in os.walk(path) for name in names) if os.path.isdir(path) else iter([path])


def _settings(args: argparse.Namespace) -> Any:
    """Turn arguments into settings; what cannot be meant is bad usage."""
    from voxkernel.evaluation import PROFILE_TOLERANCES, EvaluateSettings

    if args.profile and args.tolerances is not None:
        raise UsageError("--profile and --tolerances must not be given together")
    options: dict[str, Any] = {**label_options(args), "label_images": args.label_images}
    if args.profile:
        options["tolerances"] = PROFILE_TOLERANCES
    try:
        if args.tolerances is not None:
            options["tolerances"] = _numbers("--tolerances", args.tolerances, float)
        return EvaluateSettings(
            domain=args.domain, depth=args.depth, visible=args.visible, energies=args.energies, guards=args.guards,
            thumbnails=args.thumbnails, views=_views(args.views),
            timeout=args.timeout or None, memory_limit=args.memory_limit, workers=args.workers,
            threads=args.threads,
            scheduler=args.scheduler, retry_failed=args.retry_failed, rehash=args.rehash, csv=args.csv, **options,
        )  # fmt: skip
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error


def _views(text: str) -> Any:
    if text != "all" and not (text.isascii() and text.isdigit()):
        raise UsageError(f"--views must be a number or 'all'; got '{display(text)}'")
    return text if text == "all" else int(text)
