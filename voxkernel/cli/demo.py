"""`voxkernel demo`: shapes by formula, scored, drawn and reported, without a network or a display."""

from __future__ import annotations

import argparse
import base64
import sys
import time
from pathlib import Path
from typing import Any

from voxkernel._extras import check_installed, optional
from voxkernel.cli.output import check_folder, display, number, print_table, say, write_json

HELP = "score and draw shapes made by formula; a first look"
DESCRIPTION = (
    "Make nine surfaces by formula, compute and score their kernels, and write meshes, kernels, pictures\n"
    "and one report page. Needs no network and no display."
)
EXAMPLES = ("voxkernel demo", "voxkernel demo -o pictures/demo")

_KERNELS = "kernels"  # a folder of their own: `voxkernel score DIR/*.ply` takes the shapes alone


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "-o", "--output", metavar="DIR", default="voxkernel-demo", help="folder to write to (default: ./voxkernel-demo)"
    )


def run(args: argparse.Namespace) -> int:
    """Score and draw every shape, then write the report."""
    for package in ("pyvista", "plotly", "jinja2"):
        check_installed(package)
    folder = check_folder(args.output)
    check_folder(str(folder / _KERNELS))

    from voxkernel.demo_shapes import SHAPES
    from voxkernel.pictures import interactive_page

    started = time.perf_counter()
    results: list[dict[str, Any]] = []
    for i, shape in enumerate(SHAPES):
        if sys.stderr.isatty() and not args.quiet:
            print(f"\r\x1b[Kvoxkernel: {i + 1}/{len(SHAPES)} {shape.name}", end="", file=sys.stderr, flush=True)
        results.append(_one(shape, folder))
    if sys.stderr.isatty() and not args.quiet:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)
    # The shape that is best to turn comes first.
    order = sorted(results, key=lambda r: r["shape"].name != "urchin")
    interactive_page(folder / "interactive.html", [(r["shape"].title, r["mesh"], r["score"].kernel) for r in order])
    _write_report(results, folder)
    for r in results:
        score = r["score"]
        numbers = f"ratio {number(score.ratio, 4):9}  volume {number(score.volume, 4)}"
        print(f"{r['shape'].name:8}  {score.verdict:16}  {numbers}")
    print_table({
        "report": display(folder / "index.html"),
        "interactive": display(folder / "interactive.html"),
        "pictures": display(folder / "*.png"),
        "kernels": display(folder / _KERNELS / "*.ply") + ", " + display(folder / _KERNELS / "*.json"),
    })  # fmt: skip
    say(f"done in {time.perf_counter() - started:.0f} s; open {display(folder / 'index.html')}", quiet=args.quiet)
    return 0


def _one(shape: Any, folder: Path) -> dict[str, Any]:
    from voxkernel.measures import starshapeness
    from voxkernel.pictures import surface_picture

    mesh = shape.make()
    started = time.perf_counter()
    score = starshapeness(mesh)
    seconds = time.perf_counter() - started
    mesh.write(folder / f"{shape.name}.ply")
    score.kernel.write(folder / _KERNELS / f"{shape.name}.ply")
    write_json(folder / _KERNELS / f"{shape.name}.json", score.kernel.to_dict())
    picture = folder / f"{shape.name}.png"
    surface_picture(picture, mesh, score.kernel, title=shape.title)
    return {
        "shape": shape, "mesh": mesh, "score": score, "seconds": seconds, "picture": picture,
        "verified": score.certificate.verify(),
    }  # fmt: skip


def _write_report(results: list[dict[str, Any]], folder: Path) -> None:
    from importlib.resources import files

    from voxkernel._version import __version__

    jinja2 = optional("jinja2")
    source = (files("voxkernel.cli") / "templates" / "demo.html").read_text(encoding="utf-8")
    template = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(source)
    items = [
        {
            "name": r["shape"].name,
            "title": r["shape"].title,
            "what": r["shape"].what,
            "facets": f"{r['mesh'].n_facets:,}",
            "verdict": r["score"].verdict,
            "ratio": number(r["score"].ratio, 4),
            "volume": number(r["score"].volume, 6),
            "reference": f"{r['score'].reference} {number(r['score'].reference_volume, 6)}",
            "note": "; ".join(filter(None, [r["score"].reason, *r["score"].notes])),
            "verified": r["verified"],
            "image": base64.b64encode(r["picture"].read_bytes()).decode("ascii"),
        }
        for r in results
    ]
    page = template.render(items=items, version=__version__)
    (folder / "index.html").write_text(page, encoding="utf-8")
