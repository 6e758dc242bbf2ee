"""Nearest points on triangles, the rim, robust ICP, features: against formulas and brute force."""

from collections import Counter

import numpy as np
import pytest
import shapes
from test_partial import hills
from test_register import moved, off, pose

from voxkernel import as_mesh
from voxkernel._open3d import open3d_mesh
from voxkernel.registration import prepare_surface
from voxkernel.registration.features import feature_motions, feature_points
from voxkernel.registration.motions import scaled
from voxkernel.registration.polish import polished
from voxkernel.registration.prepare import rim_of
from voxkernel.registration.side import Side
from voxkernel.registration.thin import clustered, smoothed, thinned


@pytest.fixture(scope="module")
def surface():
    return prepare_surface(hills(), margins=[0.1])


def test_the_rim_of_a_square_and_of_a_closed_body():
    _, faces = hills(n=4)
    rim = rim_of(faces, 25)
    assert rim.edges.sum() == 16
    assert rim.vertices.sum() == 16
    cube = as_mesh(shapes.cube())
    assert not rim_of(cube.faces, len(cube.vertices)).edges.any()


def test_the_rim_is_that_of_counted_edges_also_where_facets_are_turned_or_missing(rng):
    faces = hills()[1][rng.random(3200) > 0.1]
    faces[::7] = faces[::7, ::-1]
    rim = rim_of(faces, 41 * 41)
    edges = [[tuple(sorted((f[(k + 1) % 3], f[(k + 2) % 3]))) for k in range(3)] for f in faces.tolist()]
    counts = Counter(e for three in edges for e in three)
    np.testing.assert_array_equal(rim.edges, [[counts[e] == 1 for e in three] for three in edges])
    ends = {v for three in edges for e in three if counts[e] == 1 for v in e}
    assert set(np.flatnonzero(rim.vertices).tolist()) == ends


def test_cells_and_smoothing_are_those_of_open3d():
    vertices, faces = hills(n=60)
    for cell in (0.05, 0.02):
        ours, triangles = clustered(vertices, faces, cell)
        theirs = open3d_mesh(vertices, faces).simplify_vertex_clustering(cell)
        assert len(triangles) == len(theirs.triangles)
        order, other = np.lexsort(ours.round(9).T), np.lexsort(np.asarray(theirs.vertices).round(9).T)
        np.testing.assert_allclose(ours[order], np.asarray(theirs.vertices)[other], atol=1e-12)
    again = open3d_mesh(ours, triangles).filter_smooth_simple(5)
    np.testing.assert_allclose(smoothed(ours, triangles, 5), np.asarray(again.vertices), atol=1e-12)
    # A table of cells would be too large: the numbers come from sorting.
    far = np.concatenate([vertices, vertices + 1e3]), np.concatenate([faces, faces + len(vertices)])
    assert len(clustered(*far, 0.02)[0]) == pytest.approx(2 * len(ours), rel=0.05)


def test_nearest_points_against_brute_force(surface, rng):
    side = Side(surface.skin, surface.diagonal, 500)
    points = rng.normal(size=(40, 3)) * 0.4
    found = side.nearest(points)
    u = rng.dirichlet([0.5, 0.5, 0.5], size=200)
    dense = np.einsum("su,fuk->fsk", u, side.vertices[side.faces]).reshape(-1, 3)
    brute = np.array([np.linalg.norm(dense - p, axis=1).min() for p in points])
    assert (found.distances <= brute + 1e-6).all()
    assert (brute - found.distances < 0.02).all()
    np.testing.assert_allclose(np.linalg.norm(points - found.spots, axis=1), found.distances, atol=1e-12)
    # Far to the side, the nearest point is on the rim; close above a facet in the middle it is not.
    assert side.nearest(np.array([[5.0, 0, 0], [0, -5.0, 0]])).on_rim.all()
    inner = side.points[~side.nearest(side.points + 1e-4 * side.normals).on_rim]
    assert len(inner) > 0.9 * len(side.points)


def test_polish_comes_back_from_a_small_motion_and_finds_a_size(surface):
    side = Side(surface.skin, surface.diagonal, 800)
    start = np.eye(4)
    start[:3, :3] = shapes.random_rotation(np.random.default_rng(0))
    vector = np.array([0.05, -0.04, 0.06])
    from scipy.spatial.transform import Rotation

    start[:3, :3], start[:3, 3] = Rotation.from_rotvec(vector).as_matrix(), [0.01, 0.01, -0.01]
    end = polished(side, side, start, reach=0.06, least=1 / 300, steps=60)
    assert np.abs(end.transform - np.eye(4)).max() < 1e-5
    start[:3, :3] *= 1.04
    end = polished(side, side, start, reach=0.06, least=1 / 300, steps=60, with_scale=True)
    assert np.abs(end.transform - np.eye(4)).max() < 1e-4


def test_standard_errors_follow_the_noise_and_hold_the_truth(surface):
    side = Side(surface.skin, surface.diagonal, 2000)
    noise = np.random.default_rng(3).normal(size=(len(side.points), 1)) * side.normals
    found = []
    for sigma in (0.002, 0.004):
        given = (side.points + sigma * noise) * surface.diagonal, side.normals, side.areas
        other = Side(surface.skin, surface.diagonal, 2000, given)
        end = polished(side, other, np.eye(4), reach=0.06, least=0.06, steps=40, with_scale=True)
        size = np.cbrt(np.linalg.det(end.transform[:3, :3]))
        assert abs(np.log(size)) < 4 * end.errors[6]
        assert np.abs(end.transform - np.eye(4)).max() < 5 * end.errors.max() < 0.02
        found.append(end)
    np.testing.assert_allclose(found[1].errors / found[0].errors, 2.0, rtol=0.3)
    assert found[0].rests()
    assert not found[0]._replace(step=0.5 * found[0].errors.max()).rests()
    assert not found[0]._replace(step=3e-5, errors=np.zeros(7)).rests()


def test_features_of_a_copy_lead_to_its_motion():
    vertices, faces = hills()
    motion = pose(7, 1.0)
    one, two = (prepare_surface(s, margins=[0.1]) for s in ((vertices, faces), (moved(motion, vertices), faces)))
    spacing = 1 / 50
    points = [feature_points(s, one.diagonal, spacing, 5 * spacing) for s in (one, two)]
    best = feature_motions(*points, spacing, 4)[0]
    world = two.T_world_local @ scaled(best, one.diagonal) @ np.linalg.inv(one.T_world_local)
    assert off(world, motion, vertices) < 0.02
    again = feature_motions(*points, spacing, 4)[0]
    np.testing.assert_array_equal(best, again)
    assert feature_motions(points[0], type(points[0])(*(a[:0] for a in (
        points[1].points, points[1].normals, points[1].features))), spacing, 4) == []  # fmt: skip


def test_thinned_surfaces_are_small_and_near():
    vertices, faces = hills(n=120)
    thin, few = thinned(vertices, faces, 1.5, 5000)
    assert 1000 < len(few) <= 5000
    from scipy.spatial import KDTree

    assert KDTree(vertices).query(thin)[0].max() < 0.05
    same = thinned(vertices, faces, 1.5, len(faces))
    assert same[0] is vertices
    assert same[1] is faces
