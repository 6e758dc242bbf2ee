"""A container's view: the installation cannot be written, and there is no home; every command works all the same."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import as_mesh
from voxkernel.cli.commands import COMMANDS

# A folder that nobody, not even root, can make or write.
NOWHERE = "/proc/nowhere"
CALLS = {
    "kernel": ("kernel", "star.ply", "-o", "kernel.ply", "--picture", "kernel.png"),
    "center": ("center", "face.ply"),
    "score": ("score", "star.ply", "face.ply"),
    "guards": ("guards", "star.ply", "-o", "pieces"),
    "sphere": ("sphere", "star.ply", "-o", "sphere.npz"),
    "register": ("register", "moved.ply", "star.ply"),
    "labels": ("labels", "nucleus.npy", "--spacing", "1,1,1", "-o", "objects"),
    "evaluate": ("evaluate", "meshes", "-o", "run", "--workers", "1", "--no-thumbnails"),
    "report": ("report", "run", "-o", "report.html"),
    "info": ("info", "star.ply"),
    "view": ("view", "star.ply", "-o", "view.html"),
    "repair": ("repair", "star.ply", "-o", "repaired.ply"),
    "demo": ("demo", "-o", "demo"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Meshes to work on; what the commands write goes here too."""
    path = tmp_path_factory.mktemp("work")
    vertices, faces = shapes.spiky(2)
    as_mesh((vertices, faces)).write(path / "star.ply")
    as_mesh((shapes.moved(vertices, shapes.quarter_turns()[5], [1.0, 2.0, 3.0]), faces)).write(path / "moved.ply")
    as_mesh(shapes.height_field(n=6)).write(path / "face.ply")
    np.save(path / "nucleus.npy", np.pad(np.ones((4, 5, 6), np.uint8), 1))
    (path / "meshes").mkdir()
    shutil.copy(path / "star.ply", path / "meshes")
    return path


@pytest.fixture(scope="module")
def installation(tmp_path_factory):
    """A copy of the package without caches, and the words that run a command where it is read-only."""
    site = tmp_path_factory.mktemp("site")
    without = shutil.ignore_patterns("__pycache__", "*.cpp", "*.h")
    shutil.copytree(Path(voxkernel.__file__).parent, site / "voxkernel", ignore=without)
    if os.geteuid():
        subprocess.run(["chmod", "-R", "a-w", site], check=True)
        yield site, []
        subprocess.run(["chmod", "-R", "u+w", site], check=True)
        return
    mount = f'mount --bind "{site}" "{site}" && mount -o remount,ro,bind "{site}" && exec "$@"'
    words = ["unshare", "--mount", "sh", "-c", mount, "sh"]
    tried = subprocess.run([*words, "touch", site / "x"], capture_output=True) if shutil.which("unshare") else None
    if tried is None or b"ead-only" not in tried.stderr:
        pytest.skip("root writes everywhere, and this machine allows no read-only mount")
    yield site, words


def test_the_list_is_complete():
    assert set(CALLS) == set(COMMANDS)


# Without a folder for its caches, whatever draws looks for all fonts again: one of these commands, `sphere`, is enough.
DRAW = ("kernel", "register", "view", "labels", "demo")


@pytest.mark.parametrize(
    "command", [*(c for c in COMMANDS if c not in DRAW), *(pytest.param(c, marks=pytest.mark.slow) for c in DRAW)]
)
def test_command(command, folder, installation):
    site, words = installation
    env = {k: v for k, v in os.environ.items() if not k.startswith("XDG_")}
    env |= {"HOME": NOWHERE, "PYTHONPATH": str(site), "MPLCONFIGDIR": NOWHERE, "TMPDIR": str(folder)}
    done = subprocess.run(
        [*words, sys.executable, "-m", "voxkernel.cli.main", *CALLS[command]],
        cwd=folder, env=env, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert not list(site.rglob("__pycache__"))
