"""Registration: exact recovery, inverse, units, symmetry, degenerate kernels, noise, crops, bad input."""

import json

import numpy as np
import pytest
import shapes
from cells import hull_cell
from motions import moved, off, pose
from scipy.spatial.transform import Rotation

from voxkernel import as_mesh, exact_kernel, kernel_moments, register, register_many, voxel_kernel
from voxkernel.demo_shapes import face
from voxkernel.errors import MeshError
from voxkernel.registration import align_kernels, frame_candidates, prepare_surface, refine_alignment, score_alignment


def boulder(n=24, seed=5):
    """A convex body without any symmetry."""
    points, faces = hull_cell(np.random.default_rng(seed).normal(size=(n, 3)) * [3, 2, 1])
    return points, faces.astype(np.int64)


@pytest.fixture(scope="module")
def small_face():
    from voxkernel import repair

    mesh = repair(face(), decimate_to=1500).mesh
    return mesh.vertices, mesh.faces


@pytest.mark.parametrize("poses", [8, pytest.param(200, marks=pytest.mark.slow)])
def test_copies_are_found_to_rounding(poses):
    vertices, faces = boulder()
    target = prepare_surface((vertices, faces))
    worst = 0.0
    for seed in range(poses):
        away = pose(seed, 10.0)
        found = register((moved(away, vertices), faces), target)
        assert found.converged
        worst = max(worst, off(found.T_target_source, np.linalg.inv(away), moved(away, vertices)))
    assert worst < 1e-9


def test_copies_of_an_open_surface(small_face):
    vertices, faces = small_face
    for seed in range(2):
        away = pose(seed, 300.0)
        found = register((vertices, faces), (moved(away, vertices), faces))
        assert off(found.T_target_source, away, vertices) < 1e-9
        assert found.fitness == pytest.approx(1.0)
        assert found.inlier_rmse < 1e-9 * np.ptp(vertices)
        assert (found.converged, found.ambiguous, found.reason) == (True, False, "")
        # The kernels alone are near, without any ICP.
        assert off(found.kernel_T_target_source, away, vertices) < 0.1


def test_order_of_vertices_and_faces_does_not_matter(small_face, rng):
    vertices, faces = small_face
    again, again_faces = shapes.shuffled(vertices, faces, rng)
    away = pose(3, 100.0)
    found = register((vertices, faces), (moved(away, again), again_faces))
    assert off(found.T_target_source, away, vertices) < 1e-9


@pytest.fixture(scope="module")
def in_noise(small_face):
    """A face, itself under noise of a quarter of its width, and what was found."""
    vertices, faces = small_face
    noisy = moved(pose(2, 50.0), vertices + np.random.default_rng(0).normal(size=vertices.shape) * 0.5)
    return vertices, noisy, faces, register((vertices, faces), (noisy, faces))


def test_exchanging_source_and_target_gives_the_inverse(in_noise):
    vertices, noisy, faces, there = in_noise
    back = register((noisy, faces), (vertices, faces))
    np.testing.assert_allclose(there.T_target_source @ back.T_target_source, np.eye(4), atol=1e-9 * np.ptp(noisy))
    assert there.score == pytest.approx(back.score, abs=1e-9)
    # The same numbers, not only near ones: the pair is put in one order, and nothing is added in parallel.
    assert (there.score, there.probability) == (back.score, back.probability)
    np.testing.assert_array_equal(list(there.evidence.values()), list(back.evidence.values()))


@pytest.mark.parametrize("unit", [1e-6, pytest.param(1e5, marks=pytest.mark.slow)])
def test_units_do_not_matter(in_noise, unit):
    vertices, noisy, faces, one = in_noise
    two = register((vertices * unit, faces), (noisy * unit, faces))
    np.testing.assert_allclose(two.T_target_source[:3, :3], one.T_target_source[:3, :3], atol=1e-7)
    np.testing.assert_allclose(two.T_target_source[:3, 3], one.T_target_source[:3, 3] * unit, rtol=1e-6)
    assert two.fitness == pytest.approx(one.fitness, abs=1e-6)
    assert two.inlier_rmse == pytest.approx(one.inlier_rmse * unit, rel=1e-6)


def test_same_answer_every_time(small_face):
    vertices, faces = small_face
    # A surface with noise, not noise alone: Open3D's ICP adds in parallel, and where nothing fits rounding decides.
    noisy = moved(pose(4, 50.0), vertices + 0.01 * np.random.default_rng(0).normal(size=vertices.shape))
    answers = [register((vertices, faces), (noisy, faces)) for _ in range(2)]
    for other in answers[1:]:
        np.testing.assert_allclose(other.T_target_source, answers[0].T_target_source, rtol=1e-10, atol=1e-9)
        assert [c.origin for c in other.candidates] == [c.origin for c in answers[0].candidates]


def test_noise_other_triangles_and_a_crop(small_face):
    from voxkernel import repair

    vertices, faces = small_face
    extent = np.linalg.norm(np.ptp(vertices, axis=0))
    mesh = repair((vertices, faces), decimate_to=400).mesh
    noise = np.random.default_rng(7).normal(size=mesh.vertices.shape) * 0.004 * extent
    away = pose(11, 200.0)
    found = register((vertices, faces), (moved(away, mesh.vertices + noise), mesh.faces))
    assert off(found.T_target_source, away, vertices) < 0.02
    middles = vertices[faces].mean(axis=1)
    part = faces[middles[:, 0] < np.quantile(middles[:, 0], 0.7)]
    cropped = register((vertices, faces), (moved(away, vertices), part), overlap_steps=1)
    assert off(cropped.T_target_source, away, vertices) < 1e-6
    # Fitness divides by the source's area: what was cropped away has no partner.
    assert 0.6 < cropped.fitness < 0.9
    assert register((moved(away, vertices), part), (vertices, faces)).fitness == pytest.approx(1.0)


@pytest.mark.parametrize(
    "make", [shapes.cube, shapes.octahedron, lambda: shapes.icosphere(3), shapes.torus, shapes.plus_cross]
)
def test_symmetric_shapes_are_flagged(make):
    vertices, faces = make()
    away = pose(5)
    found = register((vertices, faces), (moved(away, np.asarray(vertices)), faces))
    assert found.ambiguous
    assert found.reason
    # One of the right answers is found all the same.
    assert found.score > 0.9
    assert found.fitness > 0.99


def test_mirror_images_are_not_taken_for_each_other(small_face):
    vertices, faces = boulder()
    mirrored = vertices * [1, 1, -1]
    found = register((vertices, faces), (mirrored, faces[:, ::-1]))
    assert found.score < 0.9
    assert np.linalg.det(found.T_target_source[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("make", "margins"),
    [
        (lambda: shapes.s_tetromino(0.0), [0.0]), (lambda: shapes.notched_cube(0.0), [0.0]), (shapes.two_boxes, [0.0]),
        (shapes.two_boxes, None),
    ],
)  # fmt: skip
def test_degenerate_and_empty_kernels_give_an_answer(make, margins):
    vertices, faces = (np.asarray(a) for a in make())
    away = pose(8)
    found = register((vertices, faces), (moved(away, vertices), faces), margins=margins)
    assert found.converged
    assert found.score > 0.99
    assert np.isfinite(found.T_target_source).all()


def test_loose_triangles_are_connected_first(small_face):
    vertices, faces = small_face
    away = pose(15, 100.0)
    loose = moved(away, vertices)[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    found = register((vertices, faces), loose)
    assert off(found.T_target_source, away, vertices) < 1e-9


def test_surfaces_with_few_or_no_extents():
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0.0]]), np.array([[0, 1, 2]])
    found = register(triangle, triangle)
    assert found.converged
    assert found.ambiguous
    assert "slide on each other in 3 ways" in found.reason
    for vertices, message in (
        (np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), "`faces` must hold a triangle with positive area"),
        (triangle[0] * 1e150, r"`vertices` must lie within 2\*\*200"),
    ):
        with pytest.raises(MeshError, match=message):
            register((vertices, triangle[1]), triangle)
    # Twice the size in other units: no rigid motion lays one on the other.
    small, large = boulder(), (boulder()[0] * 1000, boulder()[1])
    found = register(small, large)
    assert (found.verdict, found.scale) == ("no match", 1.0)
    assert "at a scale of 1e+03" in found.reason


def test_facets_that_face_the_other_way_are_turned_over_and_that_is_said(small_face):
    for (vertices, faces), seeds in ((boulder(), (3, 4)), (small_face, (21,))):
        for seed in seeds:
            away = pose(seed, 10.0)
            target = moved(away, vertices)
            for one, two in ((faces, faces[:, ::-1]), (faces[:, ::-1], faces)):
                inside_out = register((vertices, one), (target, two))
                assert (inside_out.verdict, inside_out.facets_turned) == ("right", True)
                assert off(inside_out.T_target_source, away, vertices) < 1e-9
    assert not register((vertices, faces), (vertices, faces)).facets_turned


def test_surfaces_that_do_not_fit_say_so(small_face):
    other = boulder()
    size = np.linalg.norm(np.ptp(small_face[0], axis=0)) / np.linalg.norm(np.ptp(other[0], axis=0))
    found = register((other[0] * size, other[1]), small_face)
    assert found.verdict != "right"
    assert found.probability < 0.8
    assert found.reason


@pytest.mark.parametrize("refine", ["point_to_point", "none"])
def test_other_refinements(small_face, refine):
    vertices, faces = small_face
    away = pose(9, 100.0)
    found = register((vertices, faces), (moved(away, vertices), faces), refine=refine)
    assert found.converged
    limit = 1e-9 if refine == "point_to_point" else 0.1
    assert off(found.T_target_source, away, vertices) < limit
    if refine == "none":
        np.testing.assert_array_equal(found.T_target_source, found.kernel_T_target_source)


def test_read_only_and_single_precision(small_face):
    vertices, faces = small_face
    away = pose(10, 10.0)
    source, target = vertices.astype(np.float32), moved(away, vertices).astype(np.float32)
    for array in (source, target):
        array.flags.writeable = False
    found = register((source, faces.astype(np.int32)), (target, faces))
    assert off(found.T_target_source, away, vertices) < 1e-5
    assert not found.T_target_source.flags.writeable


def test_stages_alone(small_face):
    vertices, faces = small_face
    away = pose(12, 100.0)
    other = (moved(away, vertices), faces)
    kernels = [voxel_kernel(s, depth=5, margin=0.1, domain="ball") for s in ((vertices, faces), other)]
    candidates = frame_candidates(*map(kernel_moments, kernels))
    assert candidates.shape[1:] == (4, 4)
    np.testing.assert_allclose(np.linalg.det(candidates[:, :3, :3]), 1.0)
    scores = [score_alignment((vertices, faces), other, c) for c in candidates]
    best = candidates[int(np.argmax(scores))]
    assert off(best, away, vertices) < 0.1
    shape, converged = align_kernels(*kernels, best)
    assert converged
    assert off(shape, away, vertices) < 0.1
    final, converged = refine_alignment((vertices, faces), other, shape)
    assert converged
    assert off(final, away, vertices) < 1e-9
    assert score_alignment((vertices, faces), other, final) == pytest.approx(1.0)
    assert score_alignment((vertices, faces), other, np.eye(4)) < 0.5


def test_frames_of_polytopes_and_equal_axes():
    vertices, faces = boulder()
    away = pose(13)
    moments = [kernel_moments(exact_kernel((v, faces))) for v in (vertices, moved(away, vertices))]
    candidates = frame_candidates(*moments)
    assert len(candidates) == 4
    assert min(off(c, away, vertices) for c in candidates) < 1e-9
    cube = kernel_moments(exact_kernel(shapes.cube()))
    assert len(frame_candidates(cube, cube)) == 60
    assert len(frame_candidates(cube, kernel_moments(exact_kernel(shapes.torus())))) == 0


def test_many_surfaces_in_one_and_two_processes(tmp_path):
    vertices, faces = boulder()
    paths = []
    for k in range(2):
        as_mesh((moved(pose(k, 10.0), vertices), faces)).write(tmp_path / f"{k}.ply")
        paths.append(tmp_path / f"{k}.ply")
    surfaces = [(vertices, faces), *paths, tmp_path / "missing.ply"]
    steps = []
    alone = register_many(surfaces, progress=lambda done, total: steps.append((done, total)))
    assert steps == [(k, 7) for k in range(1, 8)]
    assert [(p.source, p.target) for p in alone] == [(1, 0), (2, 0), (3, 0)]
    for k in (0, 1):
        assert off(np.linalg.inv(alone[k].registration.T_target_source), pose(k, 10.0), vertices) < 1e-9
    assert alone[2].registration is None
    assert "missing.ply" in alone[2].reason
    both = register_many(surfaces, workers=2, pairs=[(1, 0), (2, 1)])
    np.testing.assert_allclose(
        both[0].registration.T_target_source, alone[0].registration.T_target_source, atol=1e-9 * np.ptp(vertices)
    )
    assert len(register_many([(vertices, faces)] * 3, pairs="all")) == 3


def test_bad_arguments(small_face):
    for options, message in (
        ({"refine": "icp"}, "`refine` must be one of 'point_to_plane', 'point_to_point', 'none'; got 'icp'"),
        ({"margins": []}, "`margins` must hold at least one number; got none"),
        ({"margins": [-1]}, "`margins` must be >= 0"),
        ({"max_distance": 0}, "`max_distance` must be"),
        ({"overlap_steps": 11}, "`overlap_steps` must be"),
    ):
        with pytest.raises(ValueError, match=message):
            register(small_face, small_face, **options)
    prepared = prepare_surface(boulder(), margins=[0.1])
    with pytest.raises(ValueError, match=r"`target` must be prepared with the margins"):
        register(boulder(), prepared)
    for matrix, message in (
        (np.eye(3), r"`T_target_source` must have shape \(4, 4\); got \(3, 3\)"),
        (np.diag([1, 1, -1, 1]), "`T_target_source` must be a rotation and a shift"),
        (np.full((4, 4), np.nan), "`T_target_source` must be a rotation and a shift"),
    ):
        with pytest.raises(ValueError, match=message):
            score_alignment(boulder(), boulder(), matrix)
    with pytest.raises(ValueError, match="`pairs` must be 'reference', 'all' or pairs"):
        register_many([boulder()], pairs="some")
    with pytest.raises(ValueError, match="`reference` must be positions from 0 to 0; got 3"):
        register_many([boulder()], reference=3)


def test_result_as_text(small_face):
    found = register(small_face, small_face)
    assert repr(found).startswith("Registration('right', probability=")
    document = json.loads(json.dumps(found.to_dict()))
    assert document["fitness"] == pytest.approx(1.0)
    assert len(document["candidates"]) == len(found.candidates)


def test_scans_of_real_faces(data_dir):
    truth = json.loads((data_dir / "scans" / "ground_truth.json").read_text())["scans"]
    for number, (name, entry) in enumerate(list(truth.items())[:3]):
        scan = as_mesh(data_dir / "scans" / name)
        away = pose(number, 100.0)
        found = register(data_dir / entry["reference"], (moved(away, scan.vertices), scan.faces))
        expected = away @ np.array(entry["T_ref_to_scan"])
        angle = Rotation.from_matrix(found.T_target_source[:3, :3] @ expected[:3, :3].T).magnitude()
        assert np.degrees(angle) < 0.5
        assert not found.ambiguous


@pytest.mark.parametrize("size", [1e-50, 1.0, 1e50])
def test_the_frame_of_a_surface_turns_with_it(size):
    """Its axes belong to the surface, in any unit and far from the origin; lengths along them are those of before."""
    vertices, faces = boulder()
    away = pose(7, 100.0)
    there = moved(away, vertices) * size
    one, two = (prepare_surface((v, faces)) for v in (vertices, there))
    assert np.allclose(two.vertices, one.vertices * size, atol=1e-11 * size)
    assert two.area == pytest.approx(one.area * size**2)
    used = there[np.unique(faces)]
    assert np.allclose(moved(two.T_world_local, two.vertices), used, atol=1e-12 * size)


def test_extents_beyond_floating_point_are_refused(small_face):
    vertices, faces = small_face
    with pytest.raises(MeshError, match="rescale first"):
        register((vertices * 1e70, faces), (vertices, faces))
