"""The exact kernel on several threads: what one thread finds, to the last bit."""

import dataclasses
import os
import signal
import threading

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.halfspaces import HalfSpaces


def around_a_ball(n, seed):
    """Planes in general position, each of which bounds the kernel."""
    normals = np.random.default_rng(seed).normal(size=(n, 3))
    return HalfSpaces.from_planes(normals / np.linalg.norm(normals, axis=1)[:, None], np.ones(n))


def corners_of_a_cube(n, seed):
    """Integer planes that support the cube of edge 2, nearly all in a corner or an edge only; many twice and thrice."""
    normals = np.random.default_rng(seed).integers(-40, 41, (n, 3)).astype(float)
    normals = normals[normals.any(axis=1)]
    return HalfSpaces.from_planes(np.concatenate([np.eye(3), -np.eye(3), normals]),
                                  np.concatenate([np.ones(6), np.abs(normals).sum(axis=1)]))  # fmt: skip


def twins(n, seed):
    """Half-spaces that are the same, written in several ways beyond the range in which coplanar ones are merged."""
    few = np.round(2.0**30 * np.random.default_rng(seed).normal(size=(n // 3, 3)))
    rows = np.column_stack([few, np.round(np.linalg.norm(few, axis=1))])
    tiny = np.array([[1e-310, 1.0, 0.0, 1e9]])
    rows = np.concatenate([3.0 * rows, rows, 0.75 * rows, tiny])
    return HalfSpaces.from_planes(rows[:, :3], rows[:, 3])


def bumpy_surface(n, seed):
    """A star-shaped surface some of whose facets bound the kernel."""
    vertices, faces = shapes.uv_sphere(round((n / 4) ** 0.5), round(n**0.5))
    waves = 3 * np.random.default_rng(seed).normal(size=(3, 12))
    return HalfSpaces.from_mesh(
        voxkernel.as_mesh((vertices * (1 + 0.12 * np.cos(vertices @ waves).mean(axis=1))[:, None], faces))
    )


def convex_surface(n, seed):
    """An ellipsoid, whose facets all bound the kernel, in any order."""
    vertices, faces = shapes.ellipsoid(subdivisions=5 + n // 150_000)
    return HalfSpaces.from_mesh(voxkernel.as_mesh(shapes.shuffled(vertices, faces, np.random.default_rng(seed))))


def flat_sides(n, seed):
    """A cube of many facets in six planes, in any order."""
    vertices, faces = shapes.cube()
    while len(faces) < n // 2:
        vertices, faces = shapes.subdivided(vertices, faces)
    return HalfSpaces.from_mesh(voxkernel.as_mesh(shapes.shuffled(vertices, faces, np.random.default_rng(seed))))


MAKERS = [around_a_ball, corners_of_a_cube, twins, bumpy_surface, convex_surface, flat_sides]


def assert_equal(one, other):
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert np.array_equal(a, b), field.name
        elif not field.name.endswith("_proof"):
            assert a == b or field.name == "domain", field.name
    assert one.certificate.to_dict() == other.certificate.to_dict()
    assert one.unclipped_certificate.to_dict() == other.unclipped_certificate.to_dict()


@pytest.mark.parametrize("make", MAKERS)
def test_any_number_of_threads_gives_the_same(make):
    planes = make(24_000, 1)
    one = kernel_of_halfspaces(planes, None)
    known = {"around_a_ball": 24_000, "corners_of_a_cube": 6, "twins": 8_000, "convex_surface": 20_480, "flat_sides": 6}
    assert len(one.face_facets) == known.get(make.__name__, len(one.face_facets))
    for threads in (2, 5):
        assert_equal(one, kernel_of_halfspaces(planes, None, threads=threads))


@pytest.mark.slow
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("seed", range(3))
def test_large_kernels_on_several_threads(make, seed):
    planes = make(300_000, seed)
    one = kernel_of_halfspaces(planes, None)
    for threads in (2, 3, 8):
        assert_equal(one, kernel_of_halfspaces(planes, None, threads=threads))


def test_several_threads_are_left_at_once():
    planes = around_a_ball(1_000_000, 0)  # seconds of work
    before = threading.active_count()
    timer = threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        kernel_of_halfspaces(planes, None, threads=3)
    timer.join()
    assert threading.active_count() <= before
