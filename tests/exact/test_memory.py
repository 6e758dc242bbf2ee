"""Memory beyond the surface, under a limit that the system keeps: in a process of its own."""

import subprocess
import sys

import pytest

pytest.importorskip("resource")

BEGIN = """
import resource, sys
import numpy as np
import voxkernel
from voxkernel.halfspaces import HalfSpaces

def leave(more):
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + more, used + more))
"""


def run(script):
    if not sys.platform.startswith("linux"):
        pytest.skip("asks Linux how much is in use")
    done = subprocess.run([sys.executable, "-c", BEGIN + script], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_flat_polygon_beside_many_planes():
    """300 corners beside 200,000 planes: all their products take 480 MB."""
    out = run(
        """
angles = 2 * np.pi * np.arange(300) / 300
sides = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(300)])
far = np.random.default_rng(0).normal(size=(200_000, 3))
normals = np.concatenate([sides, [[0, 0, 1], [0, 0, -1]], far])
offsets = np.concatenate([np.ones(300), [0, 0], 2 * np.linalg.norm(far, axis=1)])
planes = HalfSpaces.from_planes(normals, offsets)
voxkernel.exact_kernel(HalfSpaces.from_planes(normals[:302], offsets[:302]))
leave(150_000_000)
kernel = voxkernel.exact_kernel(planes)
print(kernel.dimension, len(kernel.vertices), len(kernel.face_facets))
"""
    )
    assert out.split() == ["2", "300", "1"]
