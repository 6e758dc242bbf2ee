"""Faces and vertices against brute force over pairs of planes in rationals: none too many, none left out."""

from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from scipy.spatial.transform import Rotation

from voxkernel.exact import exact_kernel
from voxkernel.halfspaces import HalfSpaces


def integer_planes(rng):
    normals = rng.integers(-3, 4, (rng.integers(6, 40), 3))
    normals = normals[normals.any(axis=1)].astype(float)
    return box(2 ** int(rng.integers(0, 4)), normals, rng.integers(0, 6, len(normals)).astype(float))


def box(half, normals, offsets):
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    return np.concatenate([normals, cube]), np.concatenate([offsets, np.full(6, float(half))])


def nearly_coplanar(rng):
    base = rng.normal(size=(5, 3))
    normals = np.repeat(base, 5, axis=0) + 10.0 ** -rng.integers(3, 16) * rng.normal(size=(25, 3))
    return box(4, normals, np.ones(25) + 10.0 ** -rng.integers(6, 17) * rng.normal(size=25))


def tangent_cone(rng):
    """Many planes through one point and one line, exactly."""
    normals = rng.integers(-4, 5, (30, 3)).astype(float)
    normals[:, 2] = np.abs(normals[:, 2]) + 1
    normals[15:, 1] = 0
    return box(3, normals, normals @ [0.0, 0.0, 1.0])


def duplicates_and_parallels(rng):
    normals = rng.normal(size=(10, 3))
    factors = 2.0 ** rng.integers(-3, 4, 30)
    which = rng.integers(0, 10, 30)
    offsets = np.where(rng.random(30) < 0.7, 1.0, 1.0 + 2.0**-50)
    return box(4, normals[which] * factors[:, None], offsets * factors)


def far_away(rng):
    normals = rng.normal(size=(30, 3))
    center = rng.uniform(5e5, 5e6, 3)
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    normals = np.concatenate([normals, cube])
    return normals, normals @ center + 1e-3 * rng.uniform(0.5, 1.5, len(normals))


def slit(rng):
    normals = rng.normal(size=(20, 3))
    normal = rng.normal(size=3)
    width = 10.0 ** -rng.integers(1, 13)
    tilted = np.array([normal, -normal + 0.1 * width * rng.normal(size=3)])
    return box(2, np.concatenate([normals, tilted]), np.concatenate([np.ones(20), [0.3 + width, -0.3]]))


def needle(rng):
    angles = rng.uniform(0, 2 * np.pi, 20)
    width = 10.0 ** -rng.integers(2, 9)
    normals = np.column_stack([np.cos(angles), np.sin(angles), 0.1 * width * rng.normal(size=20)])
    rotation = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    return box(2, normals @ rotation.T, np.full(20, width))


FAMILIES = [integer_planes, nearly_coplanar, tangent_cone, duplicates_and_parallels, far_away, slit, needle]


def faces_of(planes, vertices):
    """Planes (as oracle planes) on which vertices span a polygon, each with its vertices."""
    found = {}
    for p in oracle.tightest(planes):
        on = [v for v in vertices if oracle.side(p, v) == 0]
        if len(on) >= 3 and oracle._dimension(tuple(on)) == 2:
            found[p] = set(on)
    return found


def check(kernel, planes):
    """`planes` are the oracle's, one for each facet id."""
    truth = oracle.kernel(planes)
    assert kernel.dimension == truth.dimension
    corners = kernel.exact_vertices()
    assert len(corners) == len(truth.vertices)
    assert set(corners) == set(truth.vertices)
    if truth.dimension < 3:
        return
    expected = faces_of(planes, truth.vertices)
    got = {}
    for facet, ring in zip(kernel.face_facets.tolist(), kernel.faces, strict=True):
        assert facet == planes.index(planes[facet])  # the first of those that are the same
        assert planes[facet] not in got
        got[planes[facet]] = {corners[i] for i in ring}
    assert got == expected
    low, high = kernel.volume_bounds
    assert Fraction(low) <= truth.volume <= Fraction(high)
    assert high - low <= 1e-7 * high
    assert kernel.volume == pytest.approx(float(truth.volume), rel=1e-8)
    largest = max(abs(float(v)) for p in corners for v in p)
    exact = np.array([[float(v) for v in p] for p in corners])
    assert np.abs(kernel.vertices - exact).max() <= 1e-9 * largest
    edges = {tuple(sorted(e)) for ring in kernel.faces for e in zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True)}  # fmt: skip # noqa: E501
    assert len(corners) - len(edges) + len(kernel.faces) == 2


def check_planes(normals, offsets):
    planes = [oracle.plane(n, d) for n, d in zip(normals, offsets, strict=True)]
    check(exact_kernel(HalfSpaces.from_planes(normals, offsets)), planes)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(6))
def test_faces_of_planes(family, seed):
    check_planes(*family(np.random.default_rng([seed, FAMILIES.index(family)])))


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_faces_of_many_planes(family):
    for seed in range(400):
        check_planes(*family(np.random.default_rng([100 + seed, FAMILIES.index(family)])))


def rotated(surface, seed):
    vertices, faces = surface
    return vertices @ Rotation.random(random_state=seed).as_matrix().T, faces


def slit_box(width):
    """A box with a groove so narrow that the kernel is a slit: two walls that nearly meet."""
    return shapes.box((-1, -1, -width), (1, 1, width))


SURFACES = {
    "cube": shapes.cube(),
    "box of thickness 1e-10": slit_box(1e-10),
    "box of thickness 1e-13": slit_box(1e-13),
    "star": shapes.spiky(),
    "icosphere": shapes.icosphere(1),
    "far": (shapes.cube()[0] * 1e-3 + [5e6, -3e6, 2e6], shapes.cube()[1]),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("seed", range(3))
def test_faces_of_rotated_surfaces(name, seed):
    """Flat sides split into triangles are not flat any more when they are rotated, and every sliver counts."""
    vertices, faces = rotated(SURFACES[name], seed)
    planes = oracle.corner_planes(vertices, faces)
    if len(planes) <= 80:
        check(exact_kernel((vertices, faces)), planes)


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_faces_of_many_rotated_surfaces(name):
    for seed in range(40):
        test_faces_of_rotated_surfaces(name, 1000 + seed)


@pytest.mark.parametrize("scale", [1e-57, 1e-50, 1e57])
@pytest.mark.parametrize("make", [shapes.spiky, shapes.cube, shapes.icosphere])
def test_vertices_of_surfaces_of_any_size(make, scale):
    """Coordinates are rounded once, also where products of three numbers are beyond the range of doubles."""
    vertices, faces = rotated(make(), 3)
    kernel, unit = exact_kernel((vertices * scale, faces)), exact_kernel((vertices, faces))
    exact = np.array([[float(v) for v in p] for p in kernel.exact_vertices()])
    assert np.abs(kernel.vertices - exact).max() <= 1e-14 * scale
    assert kernel.volume == pytest.approx(unit.volume * scale**3, rel=1e-12)


@pytest.mark.parametrize("size", [1e-200, 1e-150, 1e50])
def test_vertices_of_planes_of_any_size(size, rng):
    normals = rng.normal(size=(20, 3)) * 10.0 ** rng.integers(-100, 100, (20, 1))
    lengths = np.linalg.norm(normals, axis=1)
    kernel = exact_kernel(HalfSpaces.from_planes(normals, lengths * size))
    assert kernel.dimension == 3
    exact = np.array([[float(v) for v in p] for p in kernel.exact_vertices()])
    assert np.abs(kernel.vertices - exact).max() <= 1e-13 * size
