"""Feasibility: the dimension of an intersection, what proves it, and how far it had to look."""

from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from voxkernel._core import deepest_point
from voxkernel.halfspaces import HalfSpaces, find_feasibility
from voxkernel.mesh import as_mesh

ROOM = oracle.box_planes((-5, -5, -5), (5, 5, 5))
plane_rows = st.lists(st.tuples(*[st.integers(-3, 3)] * 4).filter(lambda row: any(row[:3])), min_size=1, max_size=12)


def halfspaces(rows):
    array = np.array(rows, dtype=np.float64)
    return HalfSpaces.from_planes(array[:, :3], array[:, 3])


def assert_proven(planes, exact, found):
    """Every claim of a `Feasibility`, checked with the oracle's arithmetic alone."""
    for witness in found.witnesses:
        used = planes.integer_planes(witness.ids)
        assert all(m > 0 for m in witness.multipliers)
        sums = [sum(m * p[k] for m, p in zip(witness.multipliers, used, strict=True)) for k in range(4)]
        assert sums[:3] == [0, 0, 0]
        assert sums[3] < 0 if found.dimension < 0 else sums[3] == 0
    if found.dimension < 0:
        assert found.point is None
        assert len(found.witnesses[0].ids) <= 4
        return
    world = planes.lattice_to_world(found.point)
    assert oracle.is_inside(exact, world)
    assert len(found.directions) == found.dimension
    on = [p for p in exact if oracle.side(p, world) == 0]
    for p in on:  # the relative interior: a plane through the point holds the whole affine hull
        assert all(sum(a * b for a, b in zip(p[:3], w, strict=True)) == 0 for w in found.directions)
    normals = [p[:3] for i in found.witnesses for p in planes.integer_planes(i.ids)]
    if found.dimension < 3:
        assert np.linalg.matrix_rank(np.array(normals, dtype=np.float64)) == 3 - found.dimension


@settings(max_examples=150)
@given(plane_rows, st.booleans())
def test_dimension_and_proof_are_those_of_the_oracle(rows, is_open):
    exact = [oracle.plane(row[:3], row[3]) for row in rows]
    planes = halfspaces(rows if is_open else rows + ROOM)
    found = find_feasibility(planes)
    room = oracle.box_planes((-999,) * 3, (999,) * 3) if is_open else ROOM  # no vertex is farther than 999
    assert found.dimension == oracle.kernel([*exact, *room]).dimension
    assert_proven(planes, exact if is_open else [*exact, *ROOM], found)


@settings(max_examples=40)
@given(
    st.one_of(shapes.central_soups(), shapes.soups(), shapes.polygon_prisms()),
    st.integers(0, 2**32 - 1),
    st.booleans(),
)
def test_rotated_surfaces(surface, seed, is_far):
    """Planes that met in one point miss each other by rounding: more work, same exactness."""
    rng = np.random.default_rng(seed)
    step = rng.normal(size=3) * (1e6 if is_far else 1)
    vertices = shapes.moved(surface[0], shapes.random_rotation(rng), step)
    mesh = as_mesh((vertices, surface[1]))
    planes = HalfSpaces.from_mesh(mesh)
    exact = [p for p in oracle.corner_planes(vertices, surface[1]) if p is not None]
    found = find_feasibility(planes)
    assert found.dimension == oracle.kernel(exact).dimension
    assert_proven(planes, exact, found)


@pytest.mark.parametrize("tilt", [1e-3, 1e-9, 1e-14, 1e-40, 1e-150, 5e-324])
def test_common_points_may_be_as_far_as_doubles_reach(tilt):
    """z <= 0 and z >= 1 - tilt x meet where x >= 1 / tilt only."""
    planes = HalfSpaces.from_planes([[0, 0, 1], [-tilt, 0, -1]], [0, -1])
    found = find_feasibility(planes)
    assert found.dimension == 3
    x, _, z = planes.lattice_to_world(found.point)
    assert z < 0
    assert Fraction(tilt) * x + z > 1
    near = find_feasibility(planes.with_planes([[1, 0, 0]], [999]))
    assert near.dimension == -1


@pytest.mark.parametrize("size", [1e-250, 1e-12, 1.0, 1e12])
def test_lengths_of_explicit_normals_do_not_matter(size):
    rows = np.array([p for p in ROOM], dtype=np.float64)
    planes = HalfSpaces.from_planes(rows[:, :3] * size, rows[:, 3] * size)
    assert planes.offsets == pytest.approx(np.full(6, 5.0), rel=1e-15)
    found = find_feasibility(planes)
    assert found.dimension == 3
    assert found.clearance * planes.scale >= 2.5


def test_offsets_beyond_all_lengths_are_an_error():
    with pytest.raises(ValueError, match=r"`offsets` must be at most 2\*\*200 times the length"):
        HalfSpaces.from_planes([[1, 0, 0], [1e-200, 0, 0]], [1, 1e200])


@pytest.mark.parametrize("n", [10, 300, 3000])
def test_a_deep_point_is_at_least_half_as_deep_as_can_be(n, rng):
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    planes = HalfSpaces.from_planes(np.concatenate([normals, np.eye(3), -np.eye(3)]), np.ones(n + 6))
    found = find_feasibility(planes)
    local = found.local_point
    assert (planes.local_offsets - planes.local_normals @ local).min() == pytest.approx(found.clearance, abs=1e-14)
    assert 0.5 <= found.clearance * planes.scale <= 1 + 1e-12
    assert found.passes <= 3


@pytest.mark.parametrize("lengths", [(1, 1, 1), (1, 1e-3, 1e-6), (1e-2, 1, 1e-7)])
def test_parallel_faces_do_not_send_the_program_in_circles(lengths, rng):
    """Opposite planes prove the optimum by themselves: the other multipliers are zero at every step."""
    for n in (20, 200, 640):
        half = rng.normal(size=(n, 3))
        half /= np.linalg.norm(half, axis=1)[:, None]
        half /= np.array(lengths)
        sizes = np.linalg.norm(half, axis=1)
        normals = np.concatenate([half, -half]) / np.tile(sizes, 2)[:, None]
        middle = rng.uniform(-0.5, 0.5, 3) * lengths
        offsets = 1 / np.tile(sizes, 2) + normals @ middle
        basis, multipliers, point = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
        steps = deepest_point(
            normals, offsets, np.arange(2 * n), 4.0, basis, multipliers, point, 1e-14, 1000
        )  # fmt: skip
        assert steps >= 0
        assert point[3] == pytest.approx((1 / sizes).min(), rel=1e-9)
        assert (normals @ point[:3] + point[3] <= offsets + 1e-13).all()


@pytest.mark.parametrize("fold", [1, 7])
def test_witnesses_name_the_planes_they_were_asked_about(fold):
    """Exactly coplanar copies are merged on the way; ids must still be those of the input."""
    vertices, faces = shapes.s_tetromino(0.0)
    faces = np.concatenate([faces] * fold)
    planes = HalfSpaces.from_mesh(as_mesh((vertices, faces)))
    found = find_feasibility(planes)
    assert found.dimension == 2
    assert_proven(planes, [p for p in oracle.corner_planes(vertices, faces) if p is not None], found)
    assert found.working_set.max() < len(planes)


def test_the_recession_cone_is_what_never_ends():
    surface = shapes.open_box()
    cone = HalfSpaces.from_mesh(as_mesh(surface)).recession_cone()
    found = find_feasibility(cone.with_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.ones(6)))
    assert found.dimension == 1
    assert np.abs(np.array(found.directions[0], dtype=np.float64)).tolist() == [0, 0, 1]
    closed = HalfSpaces.from_mesh(as_mesh(shapes.l_prism())).recession_cone()
    found = find_feasibility(closed.with_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.ones(6)))
    assert found.dimension == 0


def test_highs_agrees_on_random_planes(rng):
    for n in (5, 50):
        for _ in range(10):
            normals = rng.normal(size=(n, 3))
            offsets = rng.uniform(-0.1, 1, n)
            answer = linprog(
                [0, 0, 0, -1],
                A_ub=np.column_stack([normals, np.linalg.norm(normals, axis=1)]),
                b_ub=offsets,
                bounds=[(None, None)] * 3 + [(None, 1)],
            )
            assert abs(answer.x[3]) > 1e-6  # HiGHS stops at 1e-7
            found = find_feasibility(HalfSpaces.from_planes(normals, offsets))
            assert found.dimension == (3 if answer.x[3] > 0 else -1)


def planes_without_common_point(n, rng):
    """Integer normals of which a positive combination vanishes, and no other; offsets below what it allows."""
    while True:
        normals = rng.integers(-9, 10, (n, 3))
        if n == 3:
            normals[:, 2] = normals[:, 0] - normals[:, 1]  # all across one direction
        weights = rng.integers(1, 9, n)
        normals[-1] = -(weights[:-1] @ normals[:-1])
        normals[:-1] *= weights[-1]
        if np.linalg.matrix_rank(normals) == n - 1:
            break
    offsets = rng.integers(-9, 10, n)
    offsets[-1] = -abs(weights[:-1] @ offsets[:-1]) - 1
    return [tuple(map(int, (*row, d))) for row, d in zip(normals, offsets, strict=True)]


@pytest.mark.parametrize("n", [2, 3, 4])
def test_multipliers_by_cofactors_are_those_of_the_linear_program(n, rng):
    from voxkernel.halfspaces.rational_program import as_integers, deepest_rational_point
    from voxkernel.halfspaces.witness import _cofactors

    for _ in range(20):
        planes = planes_without_common_point(n, rng)
        optimum = deepest_rational_point([(p[:3], Fraction(p[3])) for p in planes], 3, unit=Fraction(64))
        found = _cofactors(planes)
        assert optimum.clearance < 0
        assert found == tuple(as_integers([optimum.multipliers[i] for i in sorted(optimum.multipliers)]))
        assert not any(sum(m * p[k] for m, p in zip(found, planes, strict=True)) for k in range(3))
        assert _cofactors([(a, b, c, d + 10**6) for a, b, c, d in planes]) is None
