"""`voxkernel view`: a mesh and its kernels in the browser."""

from __future__ import annotations

import argparse
import webbrowser
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from voxkernel.cli.argument_types import add_up, whole
from voxkernel.cli.output import UsageError, check_output, display, say

HELP = "a mesh and its kernels in the browser, to turn, cut and probe"
DESCRIPTION = (
    "Show a mesh in the browser, on this machine only and without a network: its kernel, relaxed kernels along a\n"
    "slider, a probe point that can be dragged with the facets it does not face in red, what it sees, sections, the\n"
    "facets that prove an empty kernel. Ctrl-C ends it. With -o, and where the extra `view` is not installed, a page\n"
    "with the same slider is written instead, which needs no server."
)
EXAMPLES = (
    "voxkernel view bust.ply",
    "voxkernel view scan.ply --tolerances 0.01,0.02,0.05 --depth 7",
    "voxkernel view vase.obj --guards 0.99 --no-browser --port 8080",
    "voxkernel view scan.ply -o scan.html",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("mesh", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    parser.add_argument("-o", "--output", metavar="FILE", help="page.html, instead of a server")
    parser.add_argument(
        "--port", type=whole(1, 65535), default=0, metavar="N", help="port on 127.0.0.1; a free one by default"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.add_argument(
        "--domain", choices=("ball", "hull", "box"), help="where to look (closed surfaces: hull, open ones: ball)"
    )
    parser.add_argument(
        "--tolerances", type=_shares, metavar="A,B,...", help="stops of the slider, shares of the area turned away"
    )
    parser.add_argument(
        "--depth", type=whole(3, 10), default=6, metavar="N", help="2**N voxels along the domain, 3 to 10"
    )
    add_up(parser)
    parser.add_argument("--guards", type=_share, metavar="S", help="show guards that together see this share")


def run(args: argparse.Namespace) -> int:
    """Compute, then serve until Ctrl-C, or write the page."""
    output = None if args.output is None else check_output(args.output, (".html",))
    if output is not None and args.port:
        raise UsageError("--port must not be given with -o: a page has no server")

    from voxkernel._extras import check_installed
    from voxkernel.mesh import as_mesh
    from voxkernel.view.loopback import free_port
    from voxkernel.view.shown import gathered
    from voxkernel.view.slider_page import write_slider_page
    from voxkernel.view.viewer import instead_of_viewer, missing_extra

    missing = None
    if output is not None:
        check_installed("plotly")
    else:
        missing = missing_extra()
        free_port(args.port)
    with args.stage(f"reading {display(args.mesh)}"):
        mesh = as_mesh(args.mesh)
    found: Any = None
    if args.guards is not None:
        from voxkernel.guarding import guards

        with args.stage("looking for guards"):
            found = guards(mesh, coverage=args.guards)
    with args.stage("computing the kernels"):
        shown = gathered(
            mesh, None, tolerances=args.tolerances, depth=args.depth, domain=args.domain, guards=found,
            title=display(Path(args.mesh).name), up=args.up,
        )  # fmt: skip
    if output is not None:
        with args.stage(f"writing {display(output)}"):
            write_slider_page(output, shown)
        say(f"wrote {display(output)}", quiet=args.quiet)
        return 0
    if missing is not None:
        page = Path(f"{Path(args.mesh).stem}_view.html")
        with args.stage(f"writing {display(page)}"):
            words = instead_of_viewer(missing, shown, page)
        say(words, quiet=args.quiet)
        if not args.no_browser:
            webbrowser.open(page.resolve().as_uri())
        return 0
    return _served(shown, args)


def _served(shown: Any, args: argparse.Namespace) -> int:
    """Serve; Ctrl-C is how a viewer ends, and no failure."""
    from voxkernel.view.server import serve

    def ready(url: str) -> None:
        starting.close()
        print(url, flush=True)
        say("Ctrl-C ends the viewer", quiet=args.quiet)

    with ExitStack() as starting:
        starting.enter_context(args.stage("starting the viewer"))
        try:
            serve(shown, port=args.port, browser=not args.no_browser, ready=ready)
        except KeyboardInterrupt:
            say("the viewer has ended", quiet=args.quiet)
    return 0


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"must be a number above 0 and at most 1; got {text}")
    return value


def _shares(text: str) -> list[float]:
    return [_share(part) for part in text.split(",")]
