"""What threads put into buckets together is what one puts there."""

import numpy as np
import pytest
import shapes

from voxkernel._core import (
    boundary_is_zero,
    coordinate_range,
    edge_convexity,
    triangles_at_vertices,
    used_vertices,
)

THREADS = (2, 3, 7, 40)


def convex(rng):
    vertices, faces = shapes.icosphere(6)  # 81,920 triangles
    return vertices, faces[rng.permutation(len(faces))]


def fan(rng):
    """Two pyramids of many sides: half of all edges have one smallest vertex."""
    n = 60_000
    angles = np.arange(n) * (2 * np.pi / n)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n)])
    ring, after = np.arange(2, n + 2), np.roll(np.arange(2, n + 2), -1)
    faces = np.concatenate(
        [np.column_stack([ring, after, np.zeros(n, int)]), np.column_stack([after, ring, np.ones(n, int)])]
    )
    return np.concatenate([[[0, 0, 1.0], [0, 0, -1.0]], rim]), faces


@pytest.mark.parametrize("make", [convex, fan])
def test_any_number_of_threads_says_the_same(make, rng):
    vertices, faces = make(rng)
    spare = np.concatenate([vertices, 1e3 * rng.normal(size=(100, 3))])  # no face refers to them
    same = np.arange(len(faces))
    dented = spare.copy()
    dented[faces[len(faces) // 2, 0]] *= 0.5
    opened = faces[:-1]
    low, high, smallest = coordinate_range(spare, faces)
    moved, ring = used_vertices(spare, faces, np.zeros(3), 1.0, np.zeros(3), 1)
    at_vertices = triangles_at_vertices(ring, len(moved), 1)
    for threads in THREADS:
        assert boundary_is_zero(faces, len(spare), threads)
        assert not boundary_is_zero(opened, len(spare), threads)
        assert edge_convexity(spare, faces, same, faces, 1, threads) == edge_convexity(spare, faces, same, faces)
        assert edge_convexity(dented, faces, same, faces, 1, threads) == 0
        assert edge_convexity(spare, opened, same[:-1], opened, 1, threads) == 0
        again = coordinate_range(spare, faces, threads)
        assert np.array_equal(again[:2], [low, high])
        assert again[2] == smallest
        assert np.array_equal(triangles_at_vertices(ring, len(moved), threads), at_vertices)
    # by another way: the triangles at some vertices, in their order
    for v in (0, 1, len(moved) // 2, len(moved) - 1):
        there = np.flatnonzero((ring.reshape(-1, 3) == v).any(axis=1))
        assert at_vertices[v].tolist() == [there[0], there[len(there) // 2], there[-1]]
