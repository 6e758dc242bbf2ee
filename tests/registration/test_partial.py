"""Registration of surfaces that share a part or nothing: clutter, crops of both, other sizes, what the verdict says."""

import numpy as np
import pytest
import shapes
from motions import moved, off, pose

from voxkernel import register
from voxkernel.demo_shapes import face
from voxkernel.registration.evidence import Evidence
from voxkernel.registration.verdict import NAMES, SIGNS, believed, descriptors, verdict_of


def hills(seed=4, n=40):
    """An open height field of Gaussian hills, without any symmetry."""
    rng = np.random.default_rng(seed)
    spots, sizes, heights = rng.uniform(0, 1, (9, 2)), rng.uniform(0.08, 0.2, 9), rng.uniform(-0.12, 0.3, 9)
    axis = np.linspace(0.0, 1.0, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(1.3 * axis, axis, indexing="ij"))
    gaps = (x[:, None] - 1.3 * spots[:, 0]) ** 2 + (y[:, None] - spots[:, 1]) ** 2
    z = np.exp(-0.5 * gaps / sizes**2) @ heights
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + n + 1, corner + n + 2, corner + 1
    return np.column_stack([x, y, z]), np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def part(surface, low, high):
    """The facets whose middles lie between two values of x, with the vertices they use."""
    vertices, faces = surface
    middles = vertices[faces].mean(axis=1)[:, 0]
    used, renumbered = np.unique(faces[(middles >= low) & (middles <= high)], return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)


def away(surface, seed):
    motion = pose(seed, 2.0)
    return motion, (moved(motion, surface[0]), surface[1])


def with_floor(surface):
    """The surface and a square three times as wide below it."""
    vertices, faces = surface
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1, 2.3, 12), np.linspace(-1, 2, 12), indexing="ij"))
    corner = (np.arange(11)[:, None] * 12 + np.arange(11)).ravel()
    a, b, c, d = corner, corner + 12, corner + 13, corner + 1
    floor = np.column_stack([x, y, np.full(len(x), -0.5)])
    more = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]) + len(vertices)
    return np.concatenate([vertices, floor]), np.concatenate([faces, more])


def test_clutter_does_not_lead_astray():
    whole = hills()
    motion, target = away(with_floor(whole), 1)
    found = register(whole, target)
    assert (found.verdict, found.ambiguous) == ("right", False)
    assert off(found.T_target_source, motion, whole[0]) < 1e-3


def test_two_parts_with_a_strip_in_common_and_the_inverse():
    whole = hills()
    left = part(whole, 0.0, 0.9)
    motion, right = away(part(whole, 0.4, 1.3), 2)
    there, back = register(left, right), register(right, left)
    assert there.verdict == back.verdict == "right"
    assert there.probability == pytest.approx(back.probability, abs=1e-6)
    assert off(there.T_target_source, motion, left[0]) < 1e-3
    np.testing.assert_allclose(there.T_target_source @ back.T_target_source, np.eye(4), atol=1e-9)


def test_strips_that_explain_more_a_little_off_lie_where_they_fit():
    """Strips of a smooth face slide over each other: another motion explains more of both, but nothing exactly."""
    mesh = face()
    (low, high), middles = mesh.bounds[:, 0], mesh.vertices[mesh.faces].mean(axis=1)[:, 0]
    at = (middles - low) / (high - low)
    left = mesh.vertices, mesh.faces[at <= 0.45]
    motion, middle = away((mesh.vertices, mesh.faces[(at >= 0.275) & (at <= 0.725)]), 70)
    found = register(left, middle)
    assert (found.verdict, found.ambiguous) == ("right", False)
    assert off(found.T_target_source, motion, mesh.vertices) < 1e-6


def test_a_fifth_of_a_smooth_face_in_common_is_enough():
    """40 % of the facets cut off either copy, on opposite sides: most matches of features are false."""
    mesh = face()
    order = np.argsort(mesh.vertices[mesh.faces].mean(axis=1)[:, 1], kind="stable")
    n = round(0.6 * len(order))
    motion, upper = away((mesh.vertices, mesh.faces[order[-n:]]), 3)
    found = register((mesh.vertices, mesh.faces[order[:n]]), upper)
    assert (found.verdict, found.ambiguous) == ("right", False)
    assert off(found.T_target_source, motion, mesh.vertices) < 1e-6


def test_parts_with_nothing_in_common_are_not_called_right():
    whole = hills()
    _, right = away(part(whole, 0.66, 1.3), 3)
    found = register(part(whole, 0.0, 0.64), right)
    assert found.verdict != "right"
    assert found.reason


@pytest.mark.parametrize("size", [1.1, pytest.param(2.0, marks=pytest.mark.slow)])
def test_another_size_is_refused_named_and_estimated(size):
    whole = hills()
    motion, target = away((whole[0] * size, whole[1]), 4)
    refused = register(whole, target)
    assert refused.verdict == "no match"
    assert f"at a scale of {size:.3g}" in refused.reason
    assert refused.scale == 1.0
    found = register(whole, target, estimate_scale=True)
    assert found.verdict == "right"
    assert found.scale == pytest.approx(size, rel=1e-4)
    truth = motion @ np.diag([size, size, size, 1.0])
    assert off(found.T_target_source, truth, whole[0]) < 1e-3
    np.testing.assert_allclose(found.apply(whole[0]), target[0], atol=1e-3)


def grid_faces(rows, columns, *, closed):
    """Two triangles for each cell of a grid of vertices, whose rows may close to rings."""
    row, column = (a.ravel() for a in np.indices((rows - 1, columns if closed else columns - 1)))
    p, q = row * columns + column, row * columns + (column + 1) % columns
    return np.concatenate([
        np.column_stack([p, q, q + columns]), np.column_stack([p, q + columns, p + columns])
    ])  # fmt: skip


def vase(around, along):
    """A body of revolution without lids, wider and narrower along its axis."""
    t, angle = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 1.0, along), np.arange(around), indexing="ij"))
    radius, angle = 0.4 + 0.2 * np.sin(5.0 * t) * (1.0 - 0.3 * t), 2.0 * np.pi * angle / around
    vertices = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 1.3 * t])
    return vertices, grid_faces(along, around, closed=True)


def wave(hill):
    """A wave along y with one low hill on it, which alone keeps it from sliding along y."""
    y, x = (a.ravel() for a in np.meshgrid(np.linspace(-0.8, 0.8, 33), np.linspace(-1, 1, 41), indexing="ij"))
    low = hill * np.exp(-8.0 * (x + 0.3) ** 2 - 9.0 * (y - 0.2) ** 2)
    return np.column_stack([x, y, 0.3 * np.exp(-2.0 * (x - 0.2) ** 2) + low]), grid_faces(33, 41, closed=False)


@pytest.mark.parametrize("other", [(60, 40), (37, 25)])
def test_bodies_of_revolution_slide_in_one_way_in_whatever_facets(other):
    found = register(vase(60, 40), away(vase(*other), 3)[1])
    assert (found.verdict, found.ambiguous) == ("uncertain", True)
    assert "the surfaces slide on each other in one way" in found.reason


@pytest.mark.parametrize(("hill", "noise", "verdict"), [
    (0.03, 0.0, "right"), (0.03, 0.015, "uncertain"), (0.06, 0.005, "right"),
])  # fmt: skip
def test_a_low_hill_holds_a_wave_unless_noise_hides_it(hill, noise, verdict):
    """The hill leaves a smallest eigenvalue of 0.0004 or 0.0015 of the largest: what counts is whether offsets grow."""
    whole = wave(hill)
    vertices, faces = part(whole, -1.0, 0.75)
    vertices += np.random.default_rng(1).normal(size=vertices.shape) * noise
    motion, target = away((vertices, faces), 3)
    found = register(whole, target)
    assert (found.verdict, found.ambiguous) == (verdict, verdict == "uncertain")
    if verdict == "right":
        assert off(found.T_target_source, motion, vertices) < 5e-3
    else:
        assert "the surfaces slide on each other" in found.reason


@pytest.mark.slow
def test_the_mirror_image_is_not_right():
    whole = hills()
    mirrored = whole[0] * [-1, 1, 1], whole[1][:, ::-1]
    assert register(whole, away(mirrored, 5)[1]).verdict != "right"


GOOD = Evidence(0.9, 0.6, 0.98, 0.001, 0.002, 0.04, 0.05, 0.4, 0.02, 0.001)


def test_the_model_keeps_the_sense_of_its_evidence():
    base = descriptors(GOOD, 0.3, 1.001, 0.0)
    assert len(base) == len(NAMES) == len(SIGNS)
    for k, sign in enumerate(SIGNS):
        more = base.copy()
        more[k] += sign
        assert believed(more) >= believed(base), NAMES[k]
    assert believed(base) > 0.8
    bad = descriptors(GOOD._replace(agreement=0.7, systematic=0.018, shortfall=0.45, turned=0.11), 0.9, 1.05, 0.0)
    assert believed(bad) < 0.1


def test_a_size_counts_beyond_its_standard_error():
    place = NAMES.index("growth")
    none, known, unknown, large = (
        descriptors(GOOD, 0.3, *size)[place] for size in ((1.0, 0.0), (1.01, 0.0), (1.01, 0.004), (1.1, 0.004))
    )
    assert none == unknown < known < large


def test_noise_of_more_than_a_hundredth_is_right():
    whole = hills()
    motion, (vertices, faces) = away(whole, 8)
    noise = np.random.default_rng(8).normal(size=vertices.shape) * 0.012 * np.linalg.norm(np.ptp(whole[0], axis=0))
    found = register(whole, (vertices + noise, faces))
    assert found.verdict == "right"
    assert found.converged
    assert off(found.T_target_source, motion, whole[0]) < 0.03


def test_a_doubted_answer_is_never_right():
    assert verdict_of(0.999, doubted=False) == "right"
    assert verdict_of(0.999, doubted=True) == "uncertain"
    assert verdict_of(0.5, doubted=False) == "uncertain"
    assert verdict_of(0.01, doubted=False) == verdict_of(0.01, doubted=True) == "no match"


def test_symmetric_shapes_are_uncertain():
    found = register(shapes.cube(), away(shapes.cube(), 6)[1])
    assert (found.verdict, found.ambiguous) == ("uncertain", True)
