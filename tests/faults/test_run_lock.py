"""One process writes to a run at a time, under whatever name it knows the folder, and a dead one is in nobody's way."""

import errno
import json
import os
import platform
import signal
import subprocess
import sys
from pathlib import Path

import fsspec
import pytest

import voxkernel
from voxkernel._file_lock import lock_file
from voxkernel.evaluation.run_lock import locked_run
from voxkernel.run_table import open_run

OWNER = """
import sys
from voxkernel.evaluation.run_lock import locked_run
from voxkernel.run_table import open_run
with locked_run(*open_run(sys.argv[1])):
    print("locked", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def owner():
    """Start processes that hold the lock of a run until they are told to end."""
    started = []

    def start(run):
        env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1])}
        command = [sys.executable, "-c", OWNER, str(run)]
        process = subprocess.Popen(command, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout.readline() == "locked\n"
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def taken(run):
    with locked_run(*open_run(str(run))) as is_locked:
        return is_locked


def test_the_message_names_folder_and_owner(tmp_path, owner):
    run = tmp_path / "run"
    process = owner(run)
    words = rf"`output` must not be in use by another evaluation; got '{run}', in use by process {process.pid} on "
    with pytest.raises(BlockingIOError, match=rf"{words}{platform.node()}, started 20\d\d-\S+$"):
        taken(run)
    process.communicate()
    assert taken(run)


def test_other_names_of_the_folder(tmp_path, owner, monkeypatch):
    (tmp_path / "run").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "link").symlink_to("run")
    monkeypatch.chdir(tmp_path)
    owner(tmp_path / "run")
    for name in ("{tmp}/link", "{tmp}/other/../run", "file://{tmp}/run", "{tmp}/run/", "run", "./link/../run"):
        with pytest.raises(BlockingIOError, match="must not be in use by another evaluation"):
            taken(name.format(tmp=tmp_path))


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_killed_owner_is_in_nobodys_way(tmp_path, owner):
    process = owner(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert json.loads((tmp_path / ".lock").read_bytes())["pid"] == process.pid  # still written there, and no obstacle
    assert taken(tmp_path)


def test_twice_in_one_process(tmp_path):
    with locked_run(*open_run(str(tmp_path))), pytest.raises(BlockingIOError, match=f"process {os.getpid()} on"):
        taken(tmp_path)
    assert taken(tmp_path)
    assert (tmp_path / ".lock").read_bytes() == b""


def test_an_owner_that_has_not_signed(tmp_path):
    with lock_file(tmp_path / ".lock"), pytest.raises(BlockingIOError, match="a process that has not given its name"):
        taken(tmp_path)


def test_a_lock_file_that_was_deleted_excludes_nobody_and_is_replaced(tmp_path):
    with locked_run(*open_run(str(tmp_path))):
        (tmp_path / ".lock").unlink()
        with locked_run(*open_run(str(tmp_path))), pytest.raises(BlockingIOError, match="in use by"):
            taken(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="fcntl")
def test_file_system_without_locks(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with pytest.warns(RuntimeWarning, match=rf"'{tmp_path}' is on a file system without locks \(No locks available\)"):
        assert not taken(tmp_path)


def test_object_store_has_no_lock():
    assert not taken("memory://run_without_lock")
    assert not fsspec.filesystem("memory").exists("/run_without_lock/.lock")


def test_output_that_cannot_be_a_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"`output` must be a folder that can be written to; got '.*file' \(File ex"):
        taken(tmp_path / "file")
