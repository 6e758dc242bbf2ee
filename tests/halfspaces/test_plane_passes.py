"""Passes over all planes on several threads: what one thread finds, to the last bit."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.plane_passes import largest_heights, reaching_planes, tightest_planes


@pytest.fixture(scope="module")
def mesh():
    vertices, faces = shapes.uv_sphere(130, 260)
    rng = np.random.default_rng(0)
    return voxkernel.as_mesh((vertices * (1 + 0.01 * rng.uniform(-1, 1, (len(vertices), 1))), faces))


@pytest.mark.parametrize("threads", [2, 3, 7])
def test_any_number_of_threads_gives_the_same(mesh, threads):
    one, many = HalfSpaces.from_mesh(mesh), HalfSpaces.from_mesh(mesh, threads=threads)
    assert len(one) > 4 << 14 - 1
    for name in ("local_normals", "local_offsets", "local_errors", "weights", "facet_ids"):
        assert np.array_equal(getattr(one, name), getattr(many, name))
    point = np.array([0.01, -0.02, 0.03])
    ids = tightest_planes(one, point)
    assert np.array_equal(ids, tightest_planes(one, point, threads=threads))
    slack = one.local_offsets - one.local_normals @ point
    assert slack.argmin() in ids
    corners = 0.43 * np.concatenate([np.eye(3), -np.eye(3)])
    found = reaching_planes(one, point, corners, margin=0.01)
    assert 0 < len(found) < len(one)
    assert np.array_equal(found, reaching_planes(one, point, corners, margin=0.01, threads=threads))
    among = np.arange(len(one)) % 3 == 0
    some = reaching_planes(one, point, corners, margin=0.01, among=among, threads=threads)
    assert np.array_equal(some, found[among[found]])
    many = one.local_normals * 0.9  # a large tree of corners is made on several threads, too
    found = reaching_planes(one, point, many)
    assert np.array_equal(found, reaching_planes(one, point, many, threads=threads))


def test_largest_heights_are_those_of_all_products(mesh, rng):
    planes = HalfSpaces.from_mesh(mesh).select(np.arange(3000))
    ids, points = rng.permutation(3000)[:2000], rng.normal(size=(500, 3))
    truth = (planes.local_normals[ids] @ points.T).max(axis=1) - planes.local_offsets[ids]
    assert np.array_equal(largest_heights(planes, ids, points), truth)
    assert largest_heights(planes, ids[:0], points).shape == (0,)


def test_exact_kernel_takes_threads(mesh):
    with pytest.raises(ValueError, match=r"`threads` must be in 1\.\.256; got 0"):
        voxkernel.exact_kernel(mesh, threads=0)
    small = shapes.cube()
    assert voxkernel.exact_kernel(small, threads=4).volume == voxkernel.exact_kernel(small).volume
