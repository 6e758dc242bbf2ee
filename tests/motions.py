"""Rigid motions for tests of registration, as 4x4 matrices."""

import numpy as np
from scipy.spatial.transform import Rotation


def pose(seed, size=1.0):
    """A random rigid motion as a 4x4 matrix."""
    rng = np.random.default_rng(seed)
    motion = np.eye(4)
    motion[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    motion[:3, 3] = rng.normal(size=3) * size
    return motion


def moved(motion, vertices):
    return vertices @ motion[:3, :3].T + motion[:3, 3]


def off(found, truth, vertices):
    """How far the points end from where they should, as a share of the diagonal."""
    extent = np.linalg.norm(np.ptp(vertices, axis=0))
    return np.abs(moved(found, vertices) - moved(truth, vertices)).max() / extent
