"""How long `import voxkernel` and `voxkernel --help` take in fresh processes."""

import subprocess
import sys


def _run(*command):
    return lambda: subprocess.run(command, check=True, capture_output=True)


def test_import_time(side_by_side):
    side_by_side(
        "fresh process",
        {
            "import numpy": _run(sys.executable, "-c", "import numpy"),
            "import voxkernel": _run(sys.executable, "-c", "import voxkernel"),
            "voxkernel --help": _run(sys.executable, "-m", "voxkernel.cli.main", "--help"),
        },
        rounds=9,
    )
