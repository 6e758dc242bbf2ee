"""Memory beyond the surface, under a limit that the system keeps: in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

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
    paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", BEGIN + script], capture_output=True, text=True, timeout=600,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_flat_polygon_beside_many_planes():
    """80 corners beside 400,000 planes: all their products take 256 MB."""
    out = run(
        """
angles = 2 * np.pi * np.arange(80) / 80
sides = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(80)])
far = np.random.default_rng(0).normal(size=(400_000, 3))
normals = np.concatenate([sides, [[0, 0, 1], [0, 0, -1]], far])
offsets = np.concatenate([np.ones(80), [0, 0], 2 * np.linalg.norm(far, axis=1)])
planes = HalfSpaces.from_planes(normals, offsets)
few = [0, 20, 40, 60, 80, 81]
voxkernel.exact_kernel(HalfSpaces.from_planes(normals[few], offsets[few]))
leave(140_000_000)
kernel = voxkernel.exact_kernel(planes)
print(kernel.dimension, len(kernel.vertices), len(kernel.face_facets))
"""
    )
    assert out.split() == ["2", "80", "1"]


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
def test_a_convex_surface_all_of_whose_facets_bound_its_kernel(threads):
    """At most 200 bytes a facet, half of which are kept; 24 MB for the stack of a thread and the like."""
    out = run(
        f"""
import shapes
voxkernel.exact_kernel(shapes.icosphere(3))
vertices, faces = shapes.icosphere(7)
mesh = voxkernel.as_mesh((vertices * [1.0, 0.7, 0.5], faces))
leave(200 * len(faces) + 24_000_000)
print(len(voxkernel.exact_kernel(mesh, threads={threads}).face_facets))
"""
    )
    assert int(out) == 20 * 4**7


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
def test_planes_all_of_which_bound_the_kernel(threads):
    """At most 200 bytes a plane; each face has six corners, each corner three numbers and three rows: 112 are kept."""
    out = run(
        f"""
normals = np.random.default_rng(0).normal(size=(300_000, 3))
planes = HalfSpaces.from_planes(normals, np.linalg.norm(normals, axis=1))
voxkernel.exact_kernel(HalfSpaces.from_planes(normals[:9000], np.ones(9000)))
leave(200 * len(planes) + 24_000_000)
print(len(voxkernel.exact_kernel(planes, threads={threads}).face_facets))
"""
    )
    assert int(out) == 300_000
