"""Kernels that are tiny beside their surface: the volume bounds hold the volume that rationals find."""

from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes

import voxkernel
from voxkernel.demo_shapes import urchin
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import as_mesh


def star(n_facets, seed):
    """A surface around the origin with a bumpy radius and about `n_facets` facets."""
    rng = np.random.default_rng(seed)
    n_rings = max(2, round((n_facets / 4) ** 0.5))
    vertices, faces = shapes.uv_sphere(n_rings + 1, max(3, n_facets // (2 * n_rings)))
    vertices = vertices @ shapes.random_rotation(rng).T
    return vertices * rng.uniform(0.85, 1.15, (len(vertices), 1)), faces


def exact_volume(vertices, faces):
    """Volume of the kernel in rationals: the facets nearest the deepest point cut first, all of them are tried."""
    point = voxkernel.exact_kernel((vertices, faces)).deepest_point
    normals, offsets, _ = oracle.float_planes(vertices, faces)
    slack = offsets - normals @ point
    planes = [p for p in oracle.corner_planes(vertices, faces[np.argsort(slack)]) if p is not None]
    used = vertices[np.unique(faces)]
    solid = oracle.clipped(planes, used.min(axis=0) - 1, used.max(axis=0) + 1)
    return oracle.solid_volume(solid)


def check(vertices, faces):
    """Bounds hold the truth, are narrow, and every corner is as near the half-spaces as the result says."""
    truth = exact_volume(vertices, faces)
    kernel = voxkernel.exact_kernel((vertices, faces))
    assert truth > 0
    assert kernel.dimension == 3
    lower, upper = (Fraction(b) for b in kernel.volume_bounds)
    assert lower <= truth <= upper
    assert upper - lower <= truth / 10**7
    exact = [oracle.point(v) for v in kernel.vertices]
    for plane in oracle.corner_planes(vertices, faces[:: max(1, len(faces) // 64)]):
        length = Fraction(float(np.linalg.norm([float(Fraction(v, max(map(abs, plane[:3])))) for v in plane[:3]])))
        over = max(sum(a * x for a, x in zip(plane, (*p, -1), strict=True)) for p in exact)
        size = Fraction(float(np.abs(kernel.vertices).max() + np.abs(vertices).max())) / 2**46
        assert over / (length * max(map(abs, plane[:3]))) <= Fraction(kernel.max_residual) + size


@pytest.mark.parametrize("factor", [1e2, 1e3, 1e4, 1e5, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("n_facets", [25, 400])
def test_one_vertex_moved_out(n_facets, factor):
    vertices, faces = star(n_facets, seed=n_facets)
    vertices[np.argmax(np.linalg.norm(vertices, axis=1))] *= factor
    check(vertices, faces)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("factor", [1e2, 1e3, 1e4, 1e5, 1e6, 1e8, 1e10, 1e12])
def test_one_vertex_of_many_moved_out(factor, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = star((25, 200, 1000, 5000, 10_000)[seed % 5], seed)
    vertices[rng.integers(len(vertices))] *= factor
    check(vertices, faces)


@pytest.mark.parametrize(
    ("factor", "subdivisions"), [(1e3, 3), *(pytest.param(f, 4, marks=pytest.mark.slow) for f in (1e3, 1e5))]
)
def test_urchin_with_one_spike_far_out(factor, subdivisions):
    vertices, faces = urchin(subdivisions=subdivisions).to_arrays()
    vertices[np.argmax(np.linalg.norm(vertices, axis=1))] *= factor
    check(vertices, faces)


@pytest.mark.parametrize("n_facets", [25, 1600])
@pytest.mark.parametrize("factor", [1e-2, 1e-4, 1e-6, 1e-9, 1e-12])
def test_small_body_beside_a_large_facet(n_facets, factor):
    """A star of size `factor` and one triangle of size 1 that cuts it through the middle."""
    vertices, faces = star(n_facets, seed=n_facets)
    far = np.array([[-1.0, -2.0, 0.25], [2.5, -1.5, 0.5], [-0.5, 3.0, 0.125]])
    far[:, 2] *= factor
    vertices = np.concatenate([vertices * factor, far])
    faces = np.concatenate([faces, [[len(vertices) - 3, len(vertices) - 2, len(vertices) - 1]]])
    truth = exact_volume(vertices, faces)
    kernel = voxkernel.exact_kernel((vertices, faces), domain=None)
    assert truth > 0
    lower, upper = (Fraction(b) for b in kernel.volume_bounds)
    assert lower <= truth <= upper
    assert upper - lower <= truth / 10**7


@pytest.mark.parametrize("offset", [(1e2, 1e2, 1e2), (1e5, 1e5, 1e5), (5e5, 5e6, 0.0)])
def test_unreferenced_vertex_changes_nothing(offset):
    """A stray (0, 0, 0) far from the surface, as of exports in map coordinates."""
    vertices, faces = urchin(subdivisions=2).to_arrays()
    vertices = vertices + np.array(offset)
    alone = voxkernel.exact_kernel((vertices, faces))
    stray = voxkernel.exact_kernel((np.concatenate([vertices, np.zeros((1, 3))]), faces))
    assert stray.volume_bounds == alone.volume_bounds
    assert np.array_equal(stray.vertices, alone.vertices)
    assert np.array_equal(HalfSpaces.from_mesh(as_mesh((vertices, faces))).origin, _origin_with_stray(vertices, faces))
    check(vertices, faces)


def _origin_with_stray(vertices, faces):
    return HalfSpaces.from_mesh(as_mesh((np.concatenate([vertices, np.zeros((1, 3))]), faces))).origin
