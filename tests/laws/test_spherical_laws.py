"""What must hold of every spherical map: solid angles add up, move with the surface, and are harmonic."""

import numpy as np
import pytest
import shapes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import voxkernel
from voxkernel.spherical.boundary_angle import Boundary, solid_angles

SEEDS = st.integers(0, 2**32 - 1)


def total(mesh, x):
    return solid_angles(mesh, np.asarray(x, float), np.full(len(mesh.faces), 2, np.int8))[1]


def opened(surface, rng):
    """Without some facets, at least one left."""
    vertices, faces = surface
    keep = rng.random(len(faces)) < 0.7
    keep[rng.integers(len(faces))] = True
    return shapes.mesh(vertices, faces[keep])


@settings(max_examples=20)
@given(shapes.convex_meshes())
def test_convex_surfaces_fill_the_sphere_from_every_kernel_point(surface):
    for center in ("deepest", "centroid"):
        seen = voxkernel.spherical_map(surface, center=center)
        assert seen.solid_angle == pytest.approx(4 * np.pi, abs=1e-9)
        assert seen.hidden_fraction == 0


@settings(max_examples=20)
@given(shapes.radial_meshes(), SEEDS)
def test_angle_moves_with_the_surface_and_does_not_scale(surface, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = opened(surface, rng)
    turn, shift = shapes.random_rotation(rng), rng.normal(size=3)
    x = rng.normal(size=3) * 0.1
    before = total(voxkernel.as_mesh((vertices, faces)), x)
    after = total(voxkernel.as_mesh((shapes.moved(4 * vertices, turn, shift), faces)), turn @ (4 * x) + shift)
    assert np.exp(0.5j * after) == pytest.approx(np.exp(0.5j * before), abs=1e-6)


@settings(max_examples=20)
@given(shapes.radial_meshes(), SEEDS)
def test_angle_does_not_depend_on_the_triangulation_or_the_order(surface, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = opened(surface, rng)
    mesh = voxkernel.as_mesh((vertices, faces))
    x = rng.normal(size=3) * 0.1
    for other in (shapes.subdivided(vertices, faces), shapes.shuffled(vertices, faces, rng)):
        assert np.exp(0.5j * total(voxkernel.as_mesh(other), x)) == pytest.approx(
            np.exp(0.5j * total(mesh, x)), abs=1e-6
        )


@settings(max_examples=20)
@given(shapes.radial_meshes(), SEEDS)
def test_angle_is_the_boundarys_and_harmonic(surface, seed):
    rng = np.random.default_rng(seed)
    mesh = voxkernel.as_mesh(opened(surface, rng))
    boundary = Boundary.of(mesh)
    x = rng.normal(size=3) * 0.1
    assert np.exp(0.5j * boundary.angle(x)) == pytest.approx(np.exp(0.5j * total(mesh, x)), abs=1e-6)
    hessian = boundary.derivatives(x)[1]
    assert abs(np.trace(hessian)) <= 1e-9 * (1 + np.abs(hessian).max())


@settings(max_examples=10)
@given(shapes.convex_meshes(), SEEDS)
def test_no_kernel_point_covers_more_than_the_best_one(surface, seed):
    rng = np.random.default_rng(seed)
    surface = opened(surface, rng)
    best = voxkernel.spherical_map(surface)
    mesh = voxkernel.as_mesh(surface)
    assume(best.certificate is not None and best.kernel.dimension == 3)
    corners = best.kernel.vertices
    inside = best.kernel.deepest_point
    for w in rng.dirichlet(np.full(len(corners), 0.2), 30):
        x = inside + 0.99 * (w @ corners - inside)
        assert total(mesh, x) <= best.solid_angle + 1e-6
