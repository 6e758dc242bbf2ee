"""Blender loads our .vdb and finds the grid where we say it is: box, transform and type of values.

`bpy` comes from PyPI, for one version of Python each: VOXKERNEL_BLENDER_PYTHON names a Python that has it.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapes

from voxkernel import voxel_kernel, write_vdb

pytestmark = pytest.mark.blender
PEER = Path(__file__).with_name("blender_peer.py")


@pytest.fixture(scope="module")
def blender():
    python = os.environ.get("VOXKERNEL_BLENDER_PYTHON", sys.executable)
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    probe = [python, "-c", "from importlib.util import find_spec; print(find_spec('bpy') is not None)"]
    if subprocess.run(probe, capture_output=True, text=True, env=env, check=True).stdout.strip() != "True":
        pytest.skip("`bpy` not found; pip install bpy, or name a Python that has it in VOXKERNEL_BLENDER_PYTHON")

    def load(path):
        done = subprocess.run(
            [python, str(PEER), str(path)], capture_output=True, text=True, env=env, timeout=300, check=True
        )
        return json.loads(done.stdout.splitlines()[-1])

    return load


def test_blender_finds_box_and_transform(blender, tmp_path):
    vertices, faces = shapes.cube()
    kernel = voxel_kernel((vertices * [4.0, 2.0, 1.0] + [3.0, -5.0, 7.0], faces), depth=5)
    grid = kernel.inside
    path = tmp_path / "kernel.vdb"
    write_vdb(path, {"density": grid}, value_type="float")
    seen = blender(path)
    assert seen["error"] == ""
    (density,) = seen["grids"].values()
    assert list(seen["grids"]) == ["density"]
    assert density["type"] == "FLOAT"
    # OpenVDB, and so Blender, means the centre of voxel (0, 0, 0) by its origin; we mean its lower corner.
    ours = np.eye(4)
    ours[:3, :3] = grid.linear
    ours[:3, 3] = grid.origin + grid.linear @ [0.5, 0.5, 0.5]
    np.testing.assert_allclose(density["transform"], ours, rtol=1e-6)  # Blender keeps float32
    # The box of the object is that of the leaves of 8 voxels which hold the active ones; before Blender 5 it ran from
    # centre to centre of the outer ones.
    inset = 0.0 if seen["version"] >= [5, 0, 0] else 0.5
    low, high = np.array(grid.active_bbox)
    low, high = low // 8 * 8 + inset, high // 8 * 8 + 8 - inset
    corners = np.array(seen["corners"])
    np.testing.assert_allclose(corners.min(axis=0), grid.origin + grid.linear @ low, atol=1e-5)
    np.testing.assert_allclose(corners.max(axis=0), grid.origin + grid.linear @ high, atol=1e-5)
