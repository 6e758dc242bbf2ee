"""Polyhedra in the compiled core: moments, solid angles and reach, next to NumPy and to known answers."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._core import moments, planes_reaching, solid_angle, triangles_at_vertices


def test_moments_of_a_box():
    kernel = voxkernel.exact_kernel(shapes.box((-1, -1, -1), (1, 2, 3)))
    volume, first, second, area = moments(kernel.vertices, kernel.face_starts, kernel.face_vertices.astype(np.int32))
    assert volume == pytest.approx(24)
    assert first / volume == pytest.approx([0, 0.5, 1])
    assert np.diag(second) == pytest.approx([24 / 3, 24 * (9 / 12 + 0.25), 24 * (16 / 12 + 1)])
    assert area == pytest.approx(2 * (6 + 8 + 12))


@pytest.mark.parametrize("n_corners", [1, 8, 9, 100, 3000])
@pytest.mark.parametrize("margin", [0.0, 1e-3])
def test_reach_against_all_pairs(n_corners, margin, rng):
    """Random planes about the corners of a ball: every corner is looked at here."""
    corners = rng.normal(size=(n_corners, 3))
    corners /= np.linalg.norm(corners, axis=1)[:, None]
    center = np.array([1.0, -2.0, 0.5])
    normals = rng.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    excess = (normals @ corners.T).max(axis=1)
    errors = np.full(2000, 1e-15)
    offsets = normals @ center + excess - rng.choice([-1e-2, -1e-4, -1e-12, 1e-12, 1e-4, 1e-2], 2000)
    everything, among = np.empty(0, np.bool_), rng.random(2000) < 0.3
    rows = planes_reaching(normals, offsets, errors, center, corners, margin, everything)
    truth = np.flatnonzero(excess - (offsets - normals @ center) > -margin)
    assert rows.tolist() == truth.tolist()
    some = planes_reaching(normals, offsets, errors, center, corners, margin, among)
    assert some.tolist() == truth[among[truth]].tolist()


def test_reach_leaves_out_nothing_within_rounding():
    """A plane through a corner is listed, whatever side rounding puts it on; one that is clear is not."""
    corners = np.array([[0.1, 0.2, 0.3], [-0.1, 0.0, 0.2]])
    normals = np.tile(np.array([[0.6, 0.8, 0.0]]), (3, 1))
    through = normals[0] @ corners[0]
    offsets, everything = through + np.array([0.0, 2.0**-52, 1e-9]), np.empty(0, np.bool_)
    rows = planes_reaching(normals, offsets, np.zeros(3), np.zeros(3), corners, 0.0, everything)
    assert rows.tolist() == [0, 1]


def test_sums_do_not_depend_on_threads():
    vertices, faces = shapes.ellipsoid(subdivisions=5)  # five blocks of facets
    start, ring = np.arange(0, 3 * len(faces) + 1, 3), faces.ravel().astype(np.int32)
    volume, first, second, area = moments(vertices, start, ring)
    assert volume == pytest.approx(8 * np.pi, rel=1e-2)
    angle = solid_angle(vertices, ring)
    assert angle == pytest.approx(4 * np.pi)
    for threads in (2, 3, 9):
        again = moments(vertices, start, ring, threads)
        assert (again[0], again[3], solid_angle(vertices, ring, threads)) == (volume, area, angle)
        assert np.array_equal(again[1], first)
        assert np.array_equal(again[2], second)


def test_solid_angle_of_closed_and_open_surfaces():
    vertices, faces = shapes.spiky()
    ring = faces.ravel().astype(np.int32)
    assert solid_angle(vertices, ring) == pytest.approx(4 * np.pi)
    assert solid_angle(vertices + 50, ring) == pytest.approx(0, abs=1e-9)
    octant = np.eye(3)
    assert solid_angle(octant, ring[:0]) == 0
    assert solid_angle(octant, np.array([0, 1, 2], np.int32)) == pytest.approx(np.pi / 2)


def test_three_triangles_at_every_vertex():
    """The first, a middle and the last one, as sorting finds them."""
    vertices, faces = shapes.icosphere(1)
    ring = np.random.default_rng(0).permutation(faces).ravel().astype(np.int32)
    order = np.argsort(ring, kind="stable")
    counts = np.bincount(ring)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    expected = np.stack([order[first], order[first + counts // 2], order[first + counts - 1]], axis=1) // 3
    assert np.array_equal(triangles_at_vertices(ring, len(vertices)), expected)


def test_reach_far_beyond_the_range_of_floats():
    """Boxes of corners are kept as floats: corners that have none are still looked at."""
    corners = np.array([[1e300, 0.0, 0.0], [0.0, 1e-300, 0.0], *np.full((20, 3), -1.0)])
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    offsets = np.array([0.5e300, -1.0, 1.0])
    rows = planes_reaching(normals, offsets, np.zeros(3), np.zeros(3), corners, 0.0, np.empty(0, np.bool_))
    assert rows.tolist() == [0, 1, 2]  # the last one because rounding is that large
