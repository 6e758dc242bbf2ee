"""Exact signs of planes at a point, against the rational oracle."""

from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.predicates import exact_slacks, planes_not_clear, touched_and_violated
from voxkernel.mesh import as_mesh


def halfspaces_of(surface):
    return HalfSpaces.from_mesh(as_mesh(surface))


def lattice_point(planes, point):
    return planes.world_to_lattice(tuple(Fraction(x) for x in point))


def assert_signs(planes, surface, point):
    truth = np.array([oracle.side(p, point) for p in oracle.corner_planes(*surface) if p is not None])
    exact = lattice_point(planes, point)
    slacks = exact_slacks(planes, range(len(planes)), exact)
    assert [(s < 0) - (s > 0) for s in slacks] == truth.tolist()
    touched, violated = touched_and_violated(planes, exact)
    assert touched.tolist() == np.flatnonzero(truth == 0).tolist()
    assert violated.tolist() == np.flatnonzero(truth == 1).tolist()
    assert set(np.flatnonzero(truth >= 0)) <= set(planes_not_clear(planes, exact).tolist())


rationals = st.fractions(-9, 9, max_denominator=12)


@settings(max_examples=60)
@given(shapes.integer_meshes(), st.tuples(rationals, rationals, rationals))
def test_signs_are_those_of_the_oracle(surface, point):
    assert_signs(halfspaces_of(surface), surface, point)


@settings(max_examples=40)
@given(shapes.integer_meshes(), st.integers(0, 2**32 - 1), st.sampled_from([1e-9, 1.0, 1e9]))
def test_signs_at_the_corners_of_a_rotated_surface(surface, seed, size):
    """Corners lie on their facets' planes exactly, whatever rounding says."""
    rng = np.random.default_rng(seed)
    vertices = shapes.moved(surface[0], shapes.random_rotation(rng), rng.normal(size=3)) * size
    planes = halfspaces_of((vertices, surface[1]))
    point = oracle.point(vertices[rng.integers(len(vertices))])
    assert_signs(planes, (vertices, surface[1]), point)


def test_one_part_in_two_to_the_300():
    planes = halfspaces_of(shapes.cube())
    step = Fraction(1, 2**300)
    for height, n_touched, n_violated in ((1 - step, 0, 0), (1, 2, 0), (1 + step, 0, 2)):
        point = lattice_point(planes, (Fraction(1, 2), Fraction(1, 3), height))
        touched, violated = touched_and_violated(planes, point)
        assert (len(touched), len(violated)) == (n_touched, n_violated)


@pytest.mark.parametrize("power", [100, 400, 2000])
def test_points_beyond_the_range_of_squares_and_of_doubles(power):
    planes = halfspaces_of(shapes.cube())
    point = lattice_point(planes, (Fraction(2) ** power, 0, 0))
    touched, violated = touched_and_violated(planes, point)
    normals = np.array([p[:3] for p in planes.integer_planes(range(12))], dtype=float)
    assert violated.tolist() == np.flatnonzero(normals[:, 0] > 0).tolist()
    assert len(touched) == 4  # the two triangles of y = 0 and of z = 0


def test_a_far_off_point_is_not_paid_for_plane_by_plane():
    planes = halfspaces_of(shapes.icosphere(2))
    point = lattice_point(planes, (Fraction(50), 0, 0))
    touched, violated = touched_and_violated(planes, point, limit=10)
    every = [i for i, s in enumerate(exact_slacks(planes, range(len(planes)), point)) if s < 0]
    assert len(every) > 100
    assert len(touched) == 0
    assert len(violated) == 10
    assert set(violated) <= set(every)
