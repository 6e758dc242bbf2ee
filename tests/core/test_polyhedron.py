"""Polyhedra in the compiled core: moments, solid angles and reach, next to NumPy and to known answers."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._core import moments, planes_reaching, solid_angle


def test_moments_of_a_box():
    kernel = voxkernel.exact_kernel(shapes.box((-1, -1, -1), (1, 2, 3)))
    volume, first, second, area = moments(kernel.vertices, kernel.face_starts, kernel.face_vertices)
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
    rows, over, pads = planes_reaching(normals, offsets, errors, center, corners, margin)
    truth = excess - (offsets - normals @ center)
    assert rows.tolist() == np.flatnonzero(truth > -margin).tolist()
    assert over == pytest.approx(truth[rows], abs=1e-14)
    assert ((pads > 1e-15) & (pads < 1e-13)).all()


def test_reach_leaves_out_nothing_within_rounding():
    """A plane through a corner is listed, whatever side rounding puts it on; one that is clear is not."""
    corners = np.array([[0.1, 0.2, 0.3], [-0.1, 0.0, 0.2]])
    normals = np.tile(np.array([[0.6, 0.8, 0.0]]), (3, 1))
    through = normals[0] @ corners[0]
    rows, _, _ = planes_reaching(
        normals, through + np.array([0.0, 2.0**-52, 1e-9]), np.zeros(3), np.zeros(3), corners, 0.0
    )
    assert rows.tolist() == [0, 1]


def test_solid_angle_of_closed_and_open_surfaces():
    vertices, faces = shapes.spiky()
    assert solid_angle(vertices, faces.ravel()) == pytest.approx(4 * np.pi)
    assert solid_angle(vertices + 50, faces.ravel()) == pytest.approx(0, abs=1e-9)
    octant = np.eye(3)
    assert solid_angle(octant, np.array([0, 1, 2])) == pytest.approx(np.pi / 2)
