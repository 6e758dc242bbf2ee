"""Kernels thinner than any tolerance: the dimension is exactly what the doubles say."""

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel.exact import exact_kernel
from voxkernel.measures import starshapeness

SLITS = [-1e-3, -1e-8, 0.0, 1e-10, 1e-8, 1e-6, 1e-3]
VERDICTS = {-1: "not star-shaped", 0: "degenerate", 1: "degenerate", 2: "degenerate", 3: "star-shaped"}


def _assert_as_the_doubles_say(surface, truth):
    found = exact_kernel(surface)
    assert found.dimension == truth.dimension
    assert found.certificate.verify()
    assert found.volume == pytest.approx(float(truth.volume), rel=1e-6, abs=0)
    if truth.centroid is not None:
        size = np.abs(surface[0]).max()
        assert found.centroid == pytest.approx([float(x) for x in truth.centroid], abs=1e-9 * size)
    score = starshapeness(surface)
    assert score.verdict == VERDICTS[truth.dimension]
    assert score.volume == pytest.approx(float(truth.volume), rel=1e-6, abs=0)
    return found


@pytest.mark.parametrize("slit", [*SLITS, -1e-300, 1e-300, 2.0**-52])
def test_straight_tetromino(slit):
    surface = shapes.s_tetromino(slit)
    known = shapes.s_tetromino_kernel(slit)
    truth = oracle.mesh_kernel(*surface)
    assert (truth.dimension, float(truth.volume)) == (known.dimension, known.volume)
    found = _assert_as_the_doubles_say(surface, truth)
    assert found.volume == pytest.approx(known.volume, rel=1e-14, abs=0)
    if known.dimension == 2:
        assert found.area == pytest.approx(1, rel=1e-14)


@pytest.mark.parametrize("slit", SLITS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_rotated_tetromino(slit, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.s_tetromino(slit)
    vertices = shapes.moved(vertices, shapes.random_rotation(rng), rng.normal(size=3))
    truth = oracle.mesh_kernel(vertices, faces)
    if abs(slit) >= 1e-10:  # rounding moves planes by 1e-16 or so
        assert truth.dimension == (3 if slit > 0 else -1)
        assert float(truth.volume) == pytest.approx(max(slit, 0), rel=1e-5)
    _assert_as_the_doubles_say((vertices, faces), truth)


@pytest.mark.parametrize("slit", SLITS)
@pytest.mark.parametrize("turn", [1, 10, 23])
def test_turned_tetromino_far_away(slit, turn):
    """A quarter turn is exact, a large step rounds the slit away: still what the doubles say."""
    vertices, faces = shapes.s_tetromino(slit)
    vertices = shapes.moved(vertices, shapes.quarter_turns()[turn], (1000, -2000, 500))
    _assert_as_the_doubles_say((vertices, faces), oracle.mesh_kernel(vertices, faces))


@pytest.mark.parametrize("slit", [-1e-3, -1e-8, 0.0, 1e-8, 1e-3])
@pytest.mark.parametrize("is_rotated", [False, True])
def test_kernel_thin_in_every_direction(slit, is_rotated, rng):
    vertices, faces = shapes.notched_cube(slit)
    if is_rotated:
        vertices = shapes.moved(vertices, shapes.random_rotation(rng))
    truth = oracle.mesh_kernel(vertices, faces)
    if not is_rotated:
        known = shapes.notched_cube_kernel(slit)
        assert truth.dimension == known.dimension
        assert float(truth.volume) == pytest.approx(known.volume, rel=1e-15)
    _assert_as_the_doubles_say((vertices, faces), truth)


@pytest.mark.parametrize("is_rotated", [False, True])
def test_segment_kernel(is_rotated, rng):
    vertices, faces = shapes.saw_prism()
    if is_rotated:
        vertices = shapes.moved(vertices, shapes.random_rotation(rng))
    _assert_as_the_doubles_say((vertices, faces), oracle.mesh_kernel(vertices, faces))


@pytest.mark.parametrize("step", [-1, 0, 1])
def test_one_unit_in_the_last_place_decides(step):
    """Two boxes whose sides are one double apart, far from the origin."""
    edge = 1000.1
    other = np.nextafter(edge, np.inf * step) if step else edge
    surface = shapes.joined(shapes.box((999, 0, 0), (edge, 1, 1)), shapes.box((other, 0, 0), (1002, 1, 1)))
    truth = oracle.mesh_kernel(*surface)
    assert truth.dimension == {-1: 3, 0: 2, 1: -1}[step]
    _assert_as_the_doubles_say(surface, truth)


@settings(max_examples=20)
@given(
    st.one_of(shapes.central_soups(), shapes.polycubes(), shapes.polygon_prisms()), st.integers(0, 2**32 - 1)
)
def test_flat_and_touching_surfaces_after_any_rotation(surface, seed):
    """Rounding splits what met exactly: planes through one point come to pass 1e-16 from each other."""
    rng = np.random.default_rng(seed)
    vertices = shapes.moved(surface[0], shapes.random_rotation(rng), rng.normal(size=3))
    _assert_as_the_doubles_say((vertices, surface[1]), oracle.mesh_kernel(vertices, surface[1]))
