"""The server of worker processes is started before this process imports anything that takes time."""

import os
import subprocess
import sys

import pytest

from voxkernel._fork_server import _OF_ANALYSIS, _OF_PICTURES, _OF_WORKERS, ENVIRONMENT

ASKED = """
import sys
import voxkernel._fork_server as server
class Started(Exception): pass
def start_method(**options):
    heavy = {"voxkernel.evaluation", "numpy", "pyarrow", "distributed"} & sys.modules.keys()
    raise Started(options["for_pictures"], sorted(heavy))
server.start_method = start_method
from voxkernel.cli.commands import parsed
from voxkernel.cli.evaluate import _start_early
try:
    _start_early(parsed(["evaluate", *sys.argv[1:]]))
    print("not started")
except Started as started:
    print(*started.args)
"""


def asked(*arguments):
    options = {"capture_output": True, "text": True, "check": True, "timeout": 120}
    return subprocess.run([sys.executable, "-c", ASKED, *map(str, arguments)], **options).stdout.strip()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "in").mkdir()
    for k in range(201):
        (tmp_path / "in" / f"{k}.ply").touch()
    return tmp_path


def test_started_before_anything_large_is_imported(folder):
    one, run = folder / "in" / "0.ply", folder / "run"
    assert asked(one, "-o", run) == "True []"
    assert asked(one, "-o", run, "--no-thumbnails") == "False []"
    assert asked(folder / "in", "-o", run) == "False []"  # too many for pictures nobody asked for
    assert asked(folder / "in", "-o", run, "--thumbnails") == "True []"


def test_not_started_where_it_may_not_be_needed(folder):
    one = folder / "in" / "0.ply"
    assert asked(one, "-o", folder) == "not started"  # all rows may be there
    assert asked(folder / "missing.ply", "-o", folder / "run") == "not started"
    assert asked(one, "-o", folder / "run", "--scheduler", "tcp://127.0.0.1:1") == "not started"


@pytest.mark.skipif(sys.platform != "linux", reason="worker processes are forks on Linux only")
def test_what_the_server_imports_starts_no_thread():
    names = ", ".join((*_OF_WORKERS, *_OF_ANALYSIS, *_OF_PICTURES))
    code = f"import os, {names}; print(len(os.listdir('/proc/self/task')))"
    environment = {**os.environ, **ENVIRONMENT}
    shown = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert shown.stdout.strip() == "1", shown.stderr
