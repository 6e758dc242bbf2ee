"""A path that is no regular file is refused before it is opened, by every reader and in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import voxkernel

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system")

READERS = {
    **{suffix: "voxkernel.as_mesh(path)" for suffix in (".ply", ".off", ".obj", ".stl", ".wrl", ".glb", ".3ds")},
    **{suffix: "voxkernel.read_polyhedral(path)" for suffix in (".hedra", ".mesh", ".vtu")},
    ".vdb": "voxkernel.read_vdb(path)",
    ".npz": "read_npz(path)",
    ".csv": "read_labels(path)",
    ".parquet": "read_parts(LocalFileSystem(), [path])",
}


CODE = """
import sys, voxkernel
from voxkernel.evaluation.inputs import Item, content_hash, read_labels
from voxkernel.run_table import read_parts
from voxkernel.grid import read_npz
from fsspec.implementations.local import LocalFileSystem
for line in sys.stdin.read().splitlines():
    path, call = line.split("\t")
    try:
        print(eval(call))
    except OSError as error:
        print(error)
"""


def answers(asked):
    """What readers say of some paths, from one child that is ended if it waits for a pipe."""
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parent.parent)}
    text = "".join(f"{path}\t{call}\n" for path, call in asked)
    run = [sys.executable, "-c", CODE]
    done = subprocess.run(run, input=text, capture_output=True, text=True, timeout=120, env=env)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == len(asked), lines
    return lines


def test_pipes_devices_and_folders(tmp_path):
    asked = []
    for suffix, call in READERS.items():
        pipe, device, folder = (tmp_path / f"{kind}{suffix}" for kind in ("pipe", "zero", "folder"))
        os.mkfifo(pipe)
        os.symlink("/dev/zero", device)
        folder.mkdir()
        asked += [(pipe, call), (device, call)]
        if suffix not in (".hedra", ".mesh", ".vtu"):
            asked.append((folder, call))
    for (path, _), line in zip(asked, answers(asked), strict=True):
        assert str(path) in line
        assert ("folder" if path.is_dir() else "must be a regular file; got ") in line


def test_names_that_cannot_be(tmp_path):
    for name in ("nul\0byte.ply", "x" * 5000 + ".ply"):
        with pytest.raises(voxkernel.VoxKernelError, match="`path` must be an existing file; got ") as caught:
            voxkernel.as_mesh(str(tmp_path / name))
        assert "\n" not in str(caught.value)


def test_a_pipe_in_a_folder_of_cells_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "1.ply")
    assert answers([(tmp_path, "content_hash(Item('cells', path)) == ''")]) == ["True"]
