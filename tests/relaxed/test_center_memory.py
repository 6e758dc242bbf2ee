"""What `best_center` takes beyond the half-spaces, of 100,000 facets, in a process of its own."""

import subprocess
import sys

import pytest

CODE = """
import numpy as np, voxkernel
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.domain import ball_domain


def face(n):
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-1, 1, n),) * 2, indexing="ij"))
    z = 1.2 * (1 - 0.5 * (x**2 + y**2)) + 0.15 * np.cos(9 * x) * np.cos(7 * y)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.c_[a, a + n, a + 1], np.c_[a + 1, a + n, a + n + 1]])
    mesh = voxkernel.as_mesh((np.c_[x, y, z + np.random.default_rng(3).normal(scale=2 / n, size=len(z))], faces))
    return HalfSpaces.from_mesh(mesh), ball_domain(mesh)


def bytes_of(line):
    return 1024 * int(open("/proc/self/status").read().split(line + ":")[1].split()[0])


small, large = face(20), face(224)
voxkernel.best_center(small[0], domain=small[1])  # what is imported
open("/proc/self/clear_refs", "w").write("5")  # the peak starts again
before = bytes_of("VmRSS")
center = voxkernel.best_center(large[0], domain=large[1])
print((bytes_of("VmHWM") - before) / len(large[0]), center.violation_bounds[1])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_at_most_a_hundred_bytes_a_facet():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    taken, high = map(float, done.stdout.split())
    assert 0 < high < 1
    assert taken <= 100
