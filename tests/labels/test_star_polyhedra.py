"""Kernels of many star polyhedra: known solids, the code of `exact_kernel`, errors."""

import numpy as np
import pytest

import voxkernel
from voxkernel import star_polyhedra_kernels
from voxkernel.labels.ray_sets import golden_rays, outward_faces

AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])


def test_an_octahedron_is_its_own_kernel():
    kernels = star_polyhedra_kernels([[1, 2, 3], [0, 0, 0]], [[2] * 6, [1] * 6], AXES)
    np.testing.assert_allclose(kernels.volume, [32 / 3, 4 / 3], rtol=1e-12)
    np.testing.assert_allclose(kernels.polyhedron_volume, kernels.volume, rtol=1e-12)
    np.testing.assert_allclose(kernels.low[0], [-1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(kernels.high[0], [3, 4, 5], atol=1e-12)
    assert kernels.n_general == 0


@pytest.mark.parametrize("spread", [0.0, 1e-9, 1e-4, 0.1, 0.6, 3.0])
def test_beside_the_exact_kernel(rng, spread):
    rays = golden_rays(32)
    distances = np.exp(spread * rng.normal(size=(6, 32)))
    centers = rng.normal(size=(6, 3))
    kernels = star_polyhedra_kernels(centers, distances, rays, threads=2)
    assert (kernels.volume > 0).all()
    assert (kernels.volume <= kernels.polyhedron_volume * (1 + 1e-9)).all()
    for i in range(6):
        exact = voxkernel.exact_kernel((rays * distances[i][:, None], outward_faces(rays)))
        assert kernels.volume[i] == pytest.approx(exact.volume, rel=1e-8)
        low, high = exact.vertices.min(axis=0), exact.vertices.max(axis=0)
        for ends, expected in ((kernels.low[i] - centers[i], low), (kernels.high[i] - centers[i], high)):
            np.testing.assert_allclose(ends, expected, atol=1e-8 * np.ptp(exact.vertices))


def ellipsoid(semi_axes):
    return lambda rng, rays: 1 / np.linalg.norm(rays / semi_axes, axis=1) * (1 + 0.02 * rng.random((3, len(rays))))


FAMILIES = {
    "noise of a twentieth": lambda rng, rays: 1 + 0.05 * rng.random((3, len(rays))),
    "equal lengths": lambda rng, rays: np.ones((2, len(rays))),
    "whole lengths": lambda rng, rays: rng.integers(3, 6, (3, len(rays))),
    "wild": lambda rng, rays: np.exp(0.6 * rng.normal(size=(3, len(rays)))),
    "long": ellipsoid([30, 1, 1]),
    "needle": ellipsoid([3000, 1, 1]),
    "flat": ellipsoid([0.02, 1, 1]),
}  # fmt: skip


@pytest.mark.parametrize("unit", [1e-56, 1e-9, 1.0, 1e9, 1e56])
@pytest.mark.parametrize("family", FAMILIES)
def test_families_beside_the_exact_kernel(rng, family, unit):
    """So many rays that hulls are large, and checked along their edges."""
    rays = golden_rays(160)
    distances = unit * FAMILIES[family](rng, rays)
    kernels = star_polyhedra_kernels(np.zeros((len(distances), 3)), distances, rays)
    for i in range(len(distances)):
        exact = voxkernel.exact_kernel((rays * distances[i][:, None], outward_faces(rays)))
        assert kernels.volume[i] == pytest.approx(exact.volume, rel=1e-8)
        for ends, expected in ((kernels.low, exact.vertices.min(axis=0)), (kernels.high, exact.vertices.max(axis=0))):
            np.testing.assert_allclose(ends[i], expected, atol=1e-8 * np.ptp(exact.vertices))


def test_a_second_call_answers_the_same_after_an_error():
    distances = np.ones((1, 6))
    for _ in range(2):
        with pytest.raises(ValueError, match="must close around the centre"):
            star_polyhedra_kernels([[0, 0, 0]], distances, AXES, faces=[[0, 2, 4]])
        assert star_polyhedra_kernels([[0, 0, 0]], distances, AXES).volume[0] == pytest.approx(4 / 3, rel=1e-12)


def test_threads_do_not_change_rows(rng):
    distances = rng.uniform(1, 2, (600, 24))
    one, two = (star_polyhedra_kernels(np.zeros((600, 3)), distances, golden_rays(24), threads=t) for t in (1, 2))
    assert np.array_equal(one.volume, two.volume)
    assert np.array_equal(one.low, two.low)


def test_lengths_at_the_ends_of_the_range():
    """The octahedron of half-axes a, b, c on either side has the volume (a + a') (b + b') (c + c') / 6."""
    lengths = np.array([[1e60] * 6, [1e-60] * 6, [1e30, 1e30, 1e-30, 1e-30, 1.0, 1.0]])
    kernels = star_polyhedra_kernels(np.zeros((3, 3)), lengths, AXES)
    whole = np.prod(lengths.reshape(-1, 3, 2).sum(axis=2), axis=1) / 6
    np.testing.assert_allclose(kernels.polyhedron_volume, whole, rtol=1e-12)
    np.testing.assert_allclose(kernels.volume, whole, rtol=1e-9)  # an octahedron is convex
    with pytest.raises(voxkernel.MeshError, match="must span, along each axis, nothing or at least"):
        star_polyhedra_kernels([[0, 0, 0]], [[1e60, 1e60, 1e-60, 1e-60, 1.0, 1.0]], AXES)


def test_none():
    assert len(star_polyhedra_kernels(np.zeros((0, 3)), np.zeros((0, 6)), AXES)) == 0


WRONG = {
    "`distances` must be > 0; got 0": ([[0, 0, 0]], [[0] * 6], AXES, None),
    "`distances` must have one row for each of 2 centers; got 1": ([[0, 0, 0]] * 2, [[1] * 6], AXES, None),
    r"`distances` must have shape \(n, 6\)": ([[0, 0, 0]], [[1] * 5], AXES, None),
    "`rays` must be at least 4 directions": ([[0, 0, 0]], [[1] * 3], AXES[::2], None),
    "`rays` must surround the centre": ([[0, 0, 0]], [[1] * 6], np.abs(AXES) + [[0.1, 0.2, 0.3]] * AXES, None),
    "`rays` must surround the centre; got directions to one": ([[0, 0, 0]], [[1] * 6], AXES + AXES[4] * 3, None),
    "`distances` must be from 1e-60 to 1e\\+60; got 1e\\+200": ([[0, 0, 0]], [[1] * 5 + [1e200]], AXES, None),
    "`distances` must be from 1e-60 to 1e\\+60; got 1e-200": ([[0, 0, 0]], [[1e-200] * 6], AXES, None),
    "`distances` times the lengths of `rays` must be from 1e-60": ([[0, 0, 0]], [[1e40] * 6], AXES * 1e40, None),
    "`rays` must have lengths from 1e-60 to 1e\\+60; got 1e\\+200": ([[0, 0, 0]], [[1] * 6], AXES * 1e200, None),
    "`rays` must have lengths from 1e-60 to 1e\\+60; got 1e-200": ([[0, 0, 0]], [[1] * 6], AXES * 1e-200, None),
    "`faces` must close around the centre": ([[0, 0, 0]], [[1] * 6], AXES, [[0, 2, 4]]),
    r"`faces` must be in 0..5; got 6": ([[0, 0, 0]], [[1] * 6], AXES, [[0, 2, 6]]),
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_errors(words):
    centers, distances, rays, faces = WRONG[words]
    with pytest.raises(ValueError, match=words):
        star_polyhedra_kernels(centers, distances, rays, faces=faces)
