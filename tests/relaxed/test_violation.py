"""`violation`, `best_center` and `violation_grid` against brute force and by hand."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import voxkernel
from voxkernel import best_center, exact_kernel, violation, violation_grid
from voxkernel.halfspaces import HalfSpaces

SQUARE = ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)])


def exact_count(surface, points):
    """Share of the facets with an area that each point violates, in rationals."""
    planes = [p for p in oracle.corner_planes(*surface) if p is not None]
    return np.array([sum(oracle.side(p, oracle.point(x)) > 0 for p in planes) / len(planes) for x in points])


# ---------------------------------------------------------------- violation


def test_cube_from_outside():
    surface = shapes.cube()
    points = [(0.5, 0.5, 0.5), (2, 0.5, 0.5), (2, 2, 0.5), (2, 2, 2), (1, 1, 1), (1, 1, 2)]
    assert violation(surface, points) == pytest.approx([0, 1 / 6, 1 / 3, 1 / 2, 0, 1 / 6], abs=1e-15)


@settings(max_examples=40)
@given(shapes.integer_meshes(), st.integers(0, 2**32 - 1))
def test_every_sign_is_exact(surface, seed):
    """Half-integer points often lie on planes of integer meshes."""
    rng = np.random.default_rng(seed)
    low, high = surface[0].min(axis=0) - 1, surface[0].max(axis=0) + 1
    points = np.concatenate([rng.integers(2 * low, 2 * high + 1, (60, 3)) / 2, surface[0][:20]])
    found = violation(surface, points, weights="count")
    assert found == pytest.approx(exact_count(surface, points), abs=1e-14)


def test_area_weights_against_the_sweep(rng):
    surface = shapes.spiky(2)
    points = rng.uniform(-1.5, 1.5, (500, 3))
    assert violation(surface, points) == pytest.approx(oracle.violation(*surface, points), abs=1e-12)


def test_batch_agrees_with_single_points_and_threads(rng):
    surface = shapes.spiky(2)
    points = rng.normal(size=(70_000, 3))
    found = violation(surface, points)
    assert (violation(surface, points, threads=2) == found).all()
    some = rng.integers(0, len(points), 50)
    assert np.concatenate([violation(surface, points[[i]]) for i in some]).tolist() == found[some].tolist()


def test_points_far_from_each_other_and_repeated():
    surface = shapes.cube()
    points = np.array([(1e300, 0, 0), (1e-300, 1e-300, 1e-300), (-1e200, 0.5, 0.5)] * 10 + [(0.5, 0.5, 0.5)] * 40)
    found = violation(surface, points)
    assert found[:3] == pytest.approx([1 / 6, 0, 1 / 6])
    assert (found[30:] == 0).all()
    assert np.ptp(found[:30].reshape(10, 3), axis=0).max() == 0


def test_weights():
    surface = shapes.cube()  # faces 8 and 9, 6 and 7 of the box are its sides +y and +x
    point = [(2, 0.5, 0.5)]
    side = [f for f in range(12) if violation(surface, point, weights=np.eye(12)[f])[0] == 1]
    assert len(side) == 2
    weights = np.zeros(12)
    weights[side[0]], weights[(side[1] + 1) % 12] = 3, 1
    assert violation(surface, point, weights=weights) == pytest.approx([0.75])
    assert violation(surface, point, weights=weights * 1e300) == pytest.approx([0.75])
    assert violation(surface, point, facets=side) == [1]
    assert violation(surface, point, facets=side, weights=np.ones(12)) == [1]


def test_polygon_weights_are_shared_by_their_planes():
    vertices, polygons = shapes.prism_polygons([(0, 0), (1, 0), (1, 1), (0, 1)])
    mesh = voxkernel.TriangleMesh.from_polygons(vertices, polygons)
    assert violation(mesh, [(0.5, 0.5, 2)], weights="count") == pytest.approx([1 / 6])
    bent = np.array(vertices)
    bent[-1, 2] += 0.5  # the top is two planes now
    mesh = voxkernel.TriangleMesh.from_polygons(bent, polygons)
    assert violation(mesh, [(0.5, 0.5, 9)], weights="count") == pytest.approx([1 / 6])


def test_facets_with_weight_zero_do_not_count():
    surface = shapes.two_boxes()
    weights = np.r_[np.ones(12), np.zeros(12)]
    assert violation(surface, [(0.5, 0.5, 0.5)], weights=weights) == [0]
    assert best_center(surface, weights=weights).violation_bounds == (0, 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"weights": "volume"}, "`weights` must be 'area', 'count' or an array"),
        ({"weights": np.ones(3)}, r"`weights` must have shape \(12,\), one for each facet; got \(3,\)"),
        ({"weights": -np.ones(12)}, "`weights` must be finite and >= 0"),
        ({"weights": np.full(12, np.nan)}, "`weights` must be finite and >= 0"),
        ({"weights": np.zeros(12)}, "`weights` must have one above 0; got only zeros"),
        ({"threads": 0}, r"`threads` must be in 1\.\.256; got 0"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(ValueError, match=message):
        violation(shapes.cube(), [(0, 0, 0)], **options)


def test_no_points():
    assert violation(shapes.cube(), np.empty((0, 3))).shape == (0,)
    with pytest.raises(ValueError, match=r"`points` must have shape \(n, 3\)"):
        violation(shapes.cube(), [0, 0, 0])


def test_half_spaces_as_surface():
    planes = HalfSpaces.from_planes([[1, 0, 0], [-1, 0, 0], [0, 1, 0]], [1, 0, 0], weights=[1, 2, 1])
    assert violation(planes, [(0.5, 0, 0), (2, 0, 0), (-1, 1, 0), (1, 0, 5)]) == pytest.approx([0, 0.25, 0.75, 0])


def test_one_facet_and_one_plane():
    one = ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    assert violation(one, [(0, 0, -1), (5, 5, 0), (0, 0, 1e-300)]).tolist() == [0, 0, 1]
    assert violation(SQUARE, [(0, 0, 1), (0, 0, 0)]).tolist() == [1, 0]


# ---------------------------------------------------------------- best_center


def test_two_boxes():
    """Each point violates at least one of x <= 1 and x >= 3: one side of twelve."""
    found = best_center(shapes.two_boxes())
    low, high = found.violation_bounds
    assert low <= 1 / 12 <= high
    assert high - low < 1e-12
    assert found.reason == ""
    assert violation(shapes.two_boxes(), found.point[None]) == pytest.approx([1 / 12])


@pytest.mark.parametrize("name", shapes.KNOWN)
def test_zero_exactly_where_the_kernel_is_not_empty(name):
    make, _ = shapes.KNOWN[name]
    found, kernel = best_center(make()), exact_kernel(make())
    low, high = found.violation_bounds
    assert (high == 0) == (low == 0) == (kernel.dimension >= 0)
    if kernel.dimension >= 0:
        planes = HalfSpaces.from_mesh(voxkernel.as_mesh(make()))
        clearance = (planes.offsets - planes.normals @ found.point).min()
        assert clearance == pytest.approx(kernel.clearance, abs=1e-12)


@pytest.mark.parametrize("slit", [-1e-3, -1e-12, -1e-300])
def test_lower_bound_is_above_zero_for_the_thinnest_gap(slit):
    low, high = best_center(shapes.s_tetromino(slit)).violation_bounds
    assert 0 < low <= high


@settings(max_examples=15)
@given(shapes.integer_meshes(), st.integers(0, 2**32 - 1))
def test_bounds_hold_on_dense_samples(surface, seed):
    found = best_center(surface)
    low, high = found.violation_bounds
    assert low <= high
    assert (high == 0) == (exact_kernel(surface).dimension >= 0)
    assume(found.domain is not None)
    assert found.reason or high - low <= 1e-4 + 1e-12
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(len(found.domain.vertices), 0.3), 3000)
    inside = np.concatenate([weights @ found.domain.vertices, rng.permutation(surface[0])[:200]])
    assert violation(surface, inside).min() >= low - 1e-12


def test_bounds_on_a_coarse_minimum_without_volume():
    """Two squares back to back and a far one across: both backs are faced only from their plane."""
    back = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
    wall = [(4, 0, -1), (4, 2, -1), (4, 2, 1), (4, 0, 1)]
    other = [(5, 0, -1), (5, 0, 1), (5, 2, 1), (5, 2, -1)]
    faces = [(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (8, 9, 10), (8, 10, 11)]
    found = best_center((back + wall + other, faces))
    low, high = found.violation_bounds
    assert low == pytest.approx(0.25, abs=1e-4)  # wall or other
    assert high == pytest.approx(0.25, abs=1e-4)


def test_gaps():
    surface = shapes.torus()
    coarse, fine = best_center(surface, gap=0.05), best_center(surface, gap=1e-6)
    assert coarse.gap <= 0.05 + 1e-12
    assert fine.gap <= 1e-6 + 1e-12
    assert coarse.violation_bounds[0] <= fine.violation_bounds[0] <= fine.violation_bounds[1]
    assert fine.violation_bounds[1] <= coarse.violation_bounds[1]
    relative = best_center(surface, relative_gap=0.1)
    assert relative.gap <= 0.1 * relative.violation_bounds[1] + 1e-12
    assert relative.n_cells <= fine.n_cells
    assert best_center(surface, relative_gap=0.1, gap=1.0).n_cells <= relative.n_cells


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gap": 0}, "`gap` must be > 0; got 0"),
        ({"relative_gap": 1.0}, "`relative_gap` must be below 1; got 1"),
        ({"relative_gap": -0.5}, "`relative_gap` must be > 0"),
        ({"domain": "sphere"}, "`domain` must be one of"),
        ({"threads": 0}, r"`threads` must be in 1\.\.256; got 0"),
    ],
)
def test_bad_gaps(options, message):
    with pytest.raises(ValueError, match=message):
        best_center(shapes.torus(), **options)


def test_the_domain_counts():
    """Of a box without lid the best points are above it; in the box domain as well as in the ball."""
    surface = shapes.two_boxes()
    right = HalfSpaces.from_planes(np.r_[np.eye(3), -np.eye(3)], [4, 1, 1, -3, 0, 0])
    found = best_center(surface, domain=right)
    assert found.domain.kind == "planes"
    assert found.violation_bounds == pytest.approx((1 / 12, 1 / 12), abs=1e-12)
    far = HalfSpaces.from_planes(np.r_[np.eye(3), -np.eye(3)], [9, 1, 1, -8, 0, 0])
    assert best_center(surface, domain=far).violation_bounds == pytest.approx((1 / 6, 1 / 6), abs=1e-12)
    with pytest.raises(ValueError, match="`domain` must be given for half-spaces; got None"):
        best_center(HalfSpaces.from_mesh(voxkernel.as_mesh(surface)))


@pytest.mark.parametrize("surface", [SQUARE, (SQUARE[0], [(0, 1, 2)]), (SQUARE[0], [*SQUARE[1], (0, 2, 1), (0, 3, 2)])])
def test_flat_input(surface):
    """All on one plane, also from both sides: its points violate nothing."""
    found = best_center(surface, domain=(np.r_[np.eye(3), -np.eye(3)], [3, 3, 3] * 2))
    assert found.violation_bounds == (0, 0)
    assert np.isfinite(found.point).all()


def test_threads_change_nothing(rng):
    """Of more planes than a list of planes holds at first, in a domain that cuts."""
    vertices, faces = shapes.icosphere(5)
    surface = vertices + 0.04 * rng.normal(size=vertices.shape), faces  # folded: no point faces all of it
    one, two = (best_center(surface, gap=0.01, domain="box", threads=n) for n in (1, 2))
    assert one.violation_bounds[0] > 0.01
    assert one.to_dict() == two.to_dict()


def test_deterministic():
    one, two = best_center(shapes.torus()), best_center(shapes.torus())
    assert (one.point == two.point).all()
    assert one.to_dict() == two.to_dict()
    assert "violation_bounds" in repr(one)


# ---------------------------------------------------------------- real shapes


def test_asteroids_in_order(data_dir):
    """Castalia is star-shaped, Bennu and Eros nearly, 67P has two lobes."""
    names = ("castalia", "bennu", "eros", "churyumov-gerasimenko")
    bounds = [best_center(data_dir / "asteroids" / f"{n}.ply", relative_gap=0.5).violation_bounds for n in names]
    assert bounds[0] == (0, 0)
    for (_, high), (low, _) in pairwise(bounds):
        assert high < low
    assert 0.02 < bounds[3][0] <= bounds[3][1] < 0.05


# ---------------------------------------------------------------- violation_grid


def test_field_of_values(rng):
    surface = shapes.torus()
    field = violation_grid(surface, depth=5, tolerance=0.4)
    ijk = field.to_ijk()
    assert len(ijk)
    values = field.values_at(ijk)
    exact = violation(surface, field.index_to_world(ijk))
    assert np.abs(values - exact).max() < 1e-6
    assert values.max() <= 0.4
    assert field.background == 1
    # Every centre of the domain with a small value is there.
    points = rng.uniform(-2.5, 2.5, (3000, 3))
    ijk = np.rint(field.world_to_index(points)).astype(np.int64)
    centres = field.index_to_world(ijk)
    domain = best_center(surface).domain
    inside = (centres @ domain.normals.T < domain.offsets - 1e-9).all(axis=1)
    assert (field.is_active(ijk)[inside] == (violation(surface, centres) <= 0.4)[inside]).mean() > 0.999


def test_field_has_tiles_where_nothing_changes():
    field = violation_grid(shapes.cube(), depth=6, tolerance=0.5, domain=(np.r_[np.eye(3), -np.eye(3)], [4, 4, 4] * 2))
    assert field.tile_count > 0
    sides = field.tile_values * 6
    assert np.abs(sides - np.round(sides)).max() < 1e-6
    assert set(np.round(sides).astype(int)) <= {0, 1, 2, 3}


def test_field_near_the_minimum():
    surface = shapes.torus()
    least = best_center(surface).violation_bounds[1]
    field = violation_grid(surface, depth=4, margin=0.05, frame="principal")
    assert field.values_at(field.to_ijk()).max() <= least + 0.05 + 1e-6
    with pytest.raises(ValueError, match="`margin` must not be given together with `tolerance`"):
        violation_grid(surface, tolerance=0.1, margin=0.1)


def test_fixed_point_bound(rng):
    """The stated bound on the rounding of weights, against rationals."""
    from voxkernel.relaxed.facet_weights import UNITS, weigh

    weights = np.exp(rng.normal(0, 20, 300))
    planes = HalfSpaces.from_planes(rng.normal(size=(300, 3)), np.ones(300), weights=weights)
    weighed = weigh(planes)
    total = sum(Fraction(float(w)) for w in weights)
    for chosen in (rng.random((20, 300)) < 0.5, np.eye(300, dtype=bool)[:20]):
        for mask in chosen:
            true = sum((Fraction(float(w)) for w in weights[mask]), Fraction(0)) / total
            units = int(weighed.weights[mask].sum())
            assert abs(units - true * UNITS) <= weighed.slack
            low, high = weighed.share_bounds(units, units)
            assert low <= true <= high
