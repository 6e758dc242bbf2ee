"""The option --stream, and what it says while a surface is read."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING

from voxkernel.cli.output import say

if TYPE_CHECKING:
    from voxkernel.large import StreamedSurface, StreamProgress

__all__ = ["add_stream", "opened"]

_SECONDS = 1.0


def add_stream(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    parser.add_argument(
        "--stream",
        action="store_true",
        help="read in chunks what exceeds memory: .ply .stl .obj .off .glb .gltf .parquet .zarr, a folder of them",
    )


def opened(path: str, *, quiet: bool) -> StreamedSurface:
    """Open a surface; notes go to stderr, and on a terminal what is being read."""
    from voxkernel.large import stream_mesh

    last = [time.monotonic()]

    def show(state: StreamProgress) -> None:
        now = time.monotonic()
        if state.note:
            say(state.note, quiet=quiet)
        elif sys.stderr.isatty() and now - last[0] >= _SECONDS:
            last[0] = now
            say(str(state), quiet=quiet)

    return stream_mesh(path, progress=show)
