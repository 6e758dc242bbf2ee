"""Polyhedra in the compiled core: moments, solid angles and reach, next to NumPy and to known answers."""

import numpy as np
import oracle
import pytest
import shapes
from scipy.spatial import HalfspaceIntersection

import voxkernel
from voxkernel._core import clipped_polyhedron, face_misfit, moments, planes_reaching, solid_angle


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


def closed(start, ring):
    """Whether every edge is traversed once each way."""
    edges = {(int(a), int(b)) for f in range(len(start) - 1) for a, b in _edges(ring[start[f] : start[f + 1]])}
    return len(edges) == len(ring) and all((b, a) in edges for a, b in edges)


def _edges(polygon):
    return zip(polygon, np.roll(polygon, -1), strict=True)


@pytest.mark.parametrize("n", [4, 6, 20, 100, 256])
@pytest.mark.parametrize("thin", [1.0, 1e-3])
def test_clipping_beside_a_dual_hull(n, thin, rng):
    """Planes about the origin, and as many that cannot matter."""
    normals = np.concatenate([np.eye(3), [[-1, -1, -1]], rng.normal(size=(n - 4, 3))])
    normals[:, 2] /= thin
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    slacks = rng.uniform(0.5, 1.0, n)
    slacks[::3] += 2.0
    vertices, start, ring, rows, is_closed, is_sound = clipped_polyhedron(normals, slacks, 1e4)
    truth = HalfspaceIntersection(np.column_stack([normals, -slacks]), np.zeros(3)).intersections
    truth = np.unique(np.round(truth, 9), axis=0)
    assert is_closed
    assert is_sound
    assert closed(start, ring)
    assert len(vertices) == len(truth)
    near = np.abs(vertices[:, None] - truth).max(axis=2).min(axis=1)
    assert near.max() < 1e-8 * np.abs(truth).max()
    assert rows.tolist() == sorted(set(rows.tolist()))
    on_face, blur, extent = face_misfit(normals, slacks, np.zeros(n), np.zeros(3), vertices, start, ring, rows)
    assert on_face <= 1e-13 * extent
    assert 0 < blur < 1e-14 * (extent + 1)
    assert extent == pytest.approx(np.linalg.norm(vertices, axis=1).max(), rel=1e-15)


@pytest.mark.parametrize("seed", range(40))
def test_clipping_with_ties(seed):
    """Integer planes: many meet in one corner, or pass through corners of others."""
    rng = np.random.default_rng(seed)
    integers = np.unique(rng.integers(-2, 3, (rng.integers(4, 30), 3)), axis=0)
    integers = integers[integers.any(axis=1)]
    offsets = rng.integers(1, 4, len(integers))
    exact = [oracle.plane(n, int(d)) for n, d in zip(integers.tolist(), offsets, strict=True)]
    truth = oracle.kernel([*exact, *oracle.box_planes([-8] * 3, [8] * 3)])
    lengths = np.linalg.norm(integers, axis=1)
    vertices, start, ring, _, is_closed, is_sound = clipped_polyhedron(
        integers / lengths[:, None], offsets / lengths, 8.0
    )
    assert is_sound
    assert closed(start, ring)
    assert len(vertices) == len(truth.vertices)
    assert moments(vertices, start, ring)[0] == pytest.approx(float(truth.volume), rel=1e-12)
    assert is_closed == all(max(map(abs, v)) < 8 for v in truth.vertices)


def test_clipping_says_when_nothing_is_left():
    normals, slacks = np.array([[1.0, 0, 0], [-1.0, 0, 0]]), np.array([1.0, -1.0])
    assert clipped_polyhedron(normals, slacks, 8.0)[5] is False
    vertices, start, _, _, is_closed, is_sound = clipped_polyhedron(np.empty((0, 3)), np.empty(0), 8.0)
    assert (len(vertices), len(start) - 1, is_closed, is_sound) == (8, 6, False, True)
