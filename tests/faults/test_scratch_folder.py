"""The temporary folder of a killed evaluation is removed by the next one; nothing else ever is."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import voxkernel
from voxkernel._file_lock import lock_file
from voxkernel._scratch_folder import scratch_folder

OWNER = """
import pathlib, sys
from voxkernel._scratch_folder import scratch_folder
with scratch_folder() as folder:
    (pathlib.Path(folder) / "worker" / "deep").mkdir(parents=True)
    (pathlib.Path(folder) / "worker" / "deep" / "file").write_text("kept")
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Let temporary folders be made where only this test makes some."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def owner(temporary):
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1]), "TMPDIR": str(temporary)}
    command = [sys.executable, "-c", OWNER]
    process = subprocess.Popen(command, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    return process, Path(process.stdout.readline().strip())


def killed(temporary):
    process, folder = owner(temporary)
    process.kill()
    process.communicate()
    assert (folder / "worker" / "deep" / "file").exists()
    return folder


def begin():
    with scratch_folder() as folder:
        assert Path(folder).is_dir()
    assert not Path(folder).exists()


def test_left_by_a_killed_owner(temporary):
    folders = [killed(temporary), killed(temporary)]  # the second removes what the first has left
    assert [folder.exists() for folder in folders] == [False, True]
    begin()
    assert list(temporary.iterdir()) == []


def test_of_a_living_owner(temporary):
    process, folder = owner(temporary)
    begin()
    assert (folder / "worker" / "deep" / "file").exists()
    process.communicate()
    assert process.returncode == 0
    assert not folder.exists()


def test_what_others_have_made_stays(temporary):
    mark = (killed(temporary) / ".owner").read_bytes()
    (temporary / "voxkernel-data").mkdir()  # other names
    (temporary / "voxkernel-data" / ".owner").write_bytes(mark)
    (temporary / "voxkernel-run-notes").mkdir()  # no mark
    (temporary / "voxkernel-run-young").mkdir()  # a mark that is not signed yet
    (temporary / "voxkernel-run-young" / ".owner").touch()
    (temporary / "voxkernel-run-elsewhere").mkdir()  # of another machine that shares the folder
    (temporary / "voxkernel-run-elsewhere" / ".owner").write_bytes(mark.replace(b" on ", b" on another."))
    (temporary / "voxkernel-run-file").write_bytes(mark)
    (temporary / "target").mkdir()
    (temporary / "target" / ".owner").write_bytes(mark)
    (temporary / "voxkernel-run-link").symlink_to("target")
    (temporary / "voxkernel-run-mark").mkdir()
    (temporary / "voxkernel-run-mark" / ".owner").symlink_to("../target/.owner")
    (temporary / "voxkernel-run-locked").mkdir()
    before = sorted(str(path) for path in temporary.rglob("*") if "worker" not in str(path))
    with lock_file(temporary / "voxkernel-run-locked" / ".owner") as held:
        held.write(mark)
        begin()
        now = {str(path) for path in temporary.rglob("*")}
    dead = {path for path in before if path not in now}
    assert len(dead) == 2  # the killed owner's folder and its mark
    assert all(Path(path).parent == temporary or Path(path).name == ".owner" for path in dead)


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root can give a file away")
def test_of_another_user_stays(temporary):
    folder = killed(temporary)
    os.chown(folder / ".owner", 12345, 12345)
    begin()
    assert folder.exists()


def test_where_nothing_can_be_locked(temporary, monkeypatch):
    monkeypatch.setattr("voxkernel._scratch_folder.lock_file", _refuse)
    begin()
    assert list(temporary.iterdir()) == []


def _refuse(*_, **__):
    raise OSError("no locks")
