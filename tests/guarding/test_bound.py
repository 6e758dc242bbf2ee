"""The bound on the number of guards: no random guard and what it sees is ever excluded, and integers prove it."""

from itertools import combinations

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._core import SightTree, clearances, find_cover
from voxkernel.guarding.bound import Cells, _cover_of, proven_share
from voxkernel.guarding.clock import Clock
from voxkernel.guarding.outside import outside_grid
from voxkernel.guarding.sight import look_at
from voxkernel.halfspaces import HalfSpaces

COMB = shapes.prism([(0, 0), (7, 0), (7, 4), (6, 4), (6, 1), (4, 1), (4, 4), (3, 4), (3, 1), (1, 1), (1, 4), (0, 4)])
ENDLESS = Clock(None, None)
MESHES = {
    "comb": COMB,
    "torus": shapes.torus(),
    "far": (COMB[0] + 1e4, COMB[1]),
    "small": (COMB[0] * 1e-6, COMB[1]),
    "hollow": shapes.joined(
        shapes.box((0, 0, 0), (3, 3, 3)),
        (shapes.box((1, 1, 1), (2, 2, 2))[0], shapes.box()[1][:, ::-1].copy()),
    ),
    "crossing": shapes.joined(shapes.box((0, 0, 0), (2, 2, 2)), shapes.box((1, 1, 1), (3, 3, 3))),
    "two": shapes.two_boxes(),
}


def looked_at(mesh):
    surface = voxkernel.as_mesh(mesh)
    return look_at(surface, HalfSpaces.from_mesh(surface), "inside", 1)


@pytest.mark.parametrize("name", MESHES)
def test_no_random_guard_sees_what_its_cell_excludes(name, rng):
    sight = looked_at(MESHES[name])
    spots = sight.samples(200, rng)
    cells = Cells(sight, outside_grid(sight, 24, ENDLESS), spots, ENDLESS)
    for _ in range(2):
        points = sight.low + rng.random((4000, 3)) * (sight.high - sight.low)
        points = np.ascontiguousarray(points[sight.allowed(points)][:150])
        assert len(points) > 30
        words = sight.sets_seen(points, spots)
        seen = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little")[:, : len(spots)].astype(bool)
        for point, row in zip(points, seen, strict=True):
            holds = (np.abs(point - cells.centers) <= cells.halves[:, None]).all(axis=1)
            assert holds.any() or not row.any()
            assert (cells.sets[holds] | ~row).all()
        cells.split(np.argsort(-cells.halves, kind="stable")[:60])
    assert cells.sets.mean() < 0.9  # something is excluded


def test_clearances_are_bounds_from_below_also_of_slivers(rng):
    vertices = rng.normal(size=(60, 3))
    faces = np.arange(60).reshape(-1, 3)
    vertices[2::3] = vertices[0::3] + 0.5 * (vertices[1::3] - vertices[0::3]) + 10.0 ** rng.uniform(-18, 0, (20, 1))
    points = rng.normal(size=(200, 3)) * 2
    found = np.empty(200)
    clearances(SightTree(vertices, faces), points, found)
    weights = rng.dirichlet([0.5, 0.5, 0.5], 4000)
    near = np.full(200, np.inf)
    for f in faces:
        places = weights @ vertices[f]
        near = np.minimum(near, np.linalg.norm(points[:, None] - places[None], axis=2).min(axis=1))
    assert (found <= near + 1e-12).all()
    assert (near - found < 0.15).all()


def test_find_cover_is_exhaustive(rng):
    for _ in range(20):
        sets = rng.random((9, 40)) < 0.3
        for count, need in ((1, 18), (2, 28), (3, 34)):
            best = max(sets[list(c)].any(axis=0).sum() for c in combinations(range(9), count))
            cover = _cover_of(sets, count, need)
            assert (len(cover) > 0) == (best >= need)
            assert not len(cover) or sets[cover].any(axis=0).sum() >= need
    words = np.ascontiguousarray(rng.integers(0, 2**63, (50, 4)).astype(np.uint64)).reshape(-1)
    assert find_cover(words, 4, 5, 256, 20).tolist() == [-1]


def test_a_share_is_proven_in_integers():
    sets = np.array([[1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], bool)
    assert proven_share(sets, 4, np.array([1, 1, 1, 1])) == 2.0
    assert proven_share(sets, 4, np.array([1, 1, 2, 2])) == 3.0
    assert proven_share(sets, 3, np.array([1, 1, 2, 2])) == 2.0
    assert 1.3 < proven_share(sets, 4, np.array([0, 3, 1, 0])) < 4 / 3
    assert proven_share(sets, 4, np.zeros(4, np.int64)) == 0.0


@pytest.mark.parametrize(("name", "at_least"), [pytest.param("torus", 3, marks=pytest.mark.slow), ("two", 2)])
def test_known_bounds_are_met_and_never_above_a_confirmed_number(name, at_least):
    found = voxkernel.guards(MESHES[name], bound=True)
    assert found.is_reached
    assert found.at_least == at_least
    assert found.at_least <= len(found)
    bound = found.bound
    assert bound.at_least_for_samples >= at_least
    assert 0.0 < bound.error_probability <= 1e-3
    assert found.to_dict()["bound"]["at_least"] == at_least


def test_a_star_needs_one_for_certain():
    found = voxkernel.guards(shapes.cube(), bound=True)
    assert found.at_least == 1
    assert found.bound.error_probability == 0.0
