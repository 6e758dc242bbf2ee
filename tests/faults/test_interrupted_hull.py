"""The dual hull of many planes answers an interrupt."""

import os
import signal
import threading

import numpy as np
import pytest

from voxkernel.exact import exact_kernel
from voxkernel.halfspaces import HalfSpaces


def test_long_hull_is_left_at_once():
    normals = np.random.default_rng(0).normal(size=(1_000_000, 3))  # seconds of work
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    planes = HalfSpaces.from_planes(normals, np.ones(len(normals)))
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        exact_kernel(planes)
