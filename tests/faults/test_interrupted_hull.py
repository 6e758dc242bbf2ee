"""Qhull cannot be interrupted; the call that waits for it can."""

import os
import signal
import threading

import numpy as np
import pytest

from voxkernel.exact.dual_hull import _LONG_HULL, polyhedron_of_duals


def test_long_hull_is_left_at_once():
    points = np.random.default_rng(0).normal(size=(15 * _LONG_HULL, 3))  # seconds of work
    points /= np.linalg.norm(points, axis=1)[:, None]
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        polyhedron_of_duals(points, np.concatenate([np.eye(3), -np.eye(3)]) / 8)


def test_long_and_short_hulls_agree(monkeypatch):
    points = np.random.default_rng(1).normal(size=(500, 3))
    cube = np.concatenate([np.eye(3), -np.eye(3)]) / 8
    short = polyhedron_of_duals(points, cube)
    monkeypatch.setattr("voxkernel.exact.dual_hull._LONG_HULL", 100)
    long = polyhedron_of_duals(points, cube)
    assert np.array_equal(short.vertices, long.vertices)
    assert np.array_equal(short.ring, long.ring)
