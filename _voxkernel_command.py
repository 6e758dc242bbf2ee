"""The console script `voxkernel`: an interrupt while the library is still being imported ends it like any later one.

It stands beside the package, because importing anything in there imports the library first.
"""

from __future__ import annotations

import sys

__all__ = ["main"]


def main() -> int:
    """Import the command line and run it; the exit code is that of `voxkernel.cli.main.main`."""
    try:
        from voxkernel.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        sys.stderr.write("voxkernel: error: interrupted\n")
        return 130
