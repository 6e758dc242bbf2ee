"""Few points that see a surface: known answers, laws, and every error."""

from itertools import pairwise

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.demo_shapes import torus, urchin

COMB = shapes.prism([(0, 0), (7, 0), (7, 4), (6, 4), (6, 1), (4, 1), (4, 4), (3, 4), (3, 1), (1, 1), (1, 4), (0, 4)])


def turned(mesh):
    return mesh[0], mesh[1][:, ::-1].copy()


def sees(vertices, faces, point, spot, face):
    """Whether a point sees a spot: facing, and no other facet crosses the segment; by plain numpy."""
    a, b, c = vertices[faces[face]]
    if np.cross(b - a, c - a) @ (point - a) >= 0:
        return False
    along = spot - point
    corner = vertices[faces[:, 0]]
    u, v = vertices[faces[:, 1]] - corner, vertices[faces[:, 2]] - corner
    p = np.cross(along, v)
    det = (u * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = point - corner
        x = (s * p).sum(axis=1) / det
        q = np.cross(s, u)
        y = (q @ along) / det
        t = (v * q).sum(axis=1) / det
    hit = (x >= 0) & (y >= 0) & (x + y <= 1) & (t > 0) & (t < 1 - 1e-9)
    hit[face] = False
    return not hit.any()


@pytest.mark.parametrize("mesh", [shapes.cube(), shapes.l_prism(), shapes.star_prism(), shapes.uv_sphere()])
def test_a_star_shaped_surface_gets_one_guard_exactly(mesh):
    found = voxkernel.guards(mesh)
    assert len(found) == 1
    assert found.seen == found.certified == found.facing_bound == 1.0
    assert found.seen_bounds == (1.0, 1.0)
    assert found.is_reached
    assert voxkernel.exact_kernel(mesh).contains(found.points)[0]
    assert (found.first_seen == 0).all()


def test_three_teeth_of_a_comb_take_three_guards():
    found = voxkernel.guards(COMB, coverage=0.999, bound=True)
    assert len(found) == 3
    assert found.is_reached
    assert found.seen_bounds[0] >= 0.999
    assert 2 <= found.at_least <= 3


def test_seen_is_what_an_independent_check_sees():
    mesh = voxkernel.as_mesh(COMB)
    found = voxkernel.guards(mesh, max_guards=2)
    assert not found.is_reached
    assert "`max_guards` is 2" in found.reason
    rng = np.random.default_rng(3)
    ids = rng.choice(len(mesh.faces), 1500, p=mesh.facet_areas / mesh.facet_areas.sum())
    weights = rng.dirichlet([1, 1, 1], len(ids))
    spots = np.einsum("ik,ikj->ij", weights, mesh.vertices[mesh.faces[ids]])
    pairs = list(zip(spots, ids, strict=True))
    seen = [any(sees(mesh.vertices, mesh.faces, g, spot, f) for g in found.points) for spot, f in pairs]
    assert np.mean(seen) == pytest.approx(found.seen, abs=4 * 0.5 / np.sqrt(1500))
    assert found.certified <= found.seen_bounds[0] + 1e-12
    assert found.seen <= found.facing_bound


def test_the_same_seed_gives_the_same_guards_and_threads_do_not_matter():
    one, two = voxkernel.guards(COMB, coverage=0.8), voxkernel.guards(COMB, coverage=0.8, threads=2)
    assert np.array_equal(one.points, two.points)
    assert one.to_dict() == two.to_dict()
    assert not np.array_equal(one.points, voxkernel.guards(COMB, coverage=0.8, rng=1).points)


@pytest.mark.parametrize(("scale", "shift"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (2.0**150, 0.0)])
def test_units_and_places_far_away(scale, shift):
    vertices, faces = COMB
    found = voxkernel.guards((vertices * scale + shift, faces), coverage=0.999)
    assert len(found) == 3
    assert found.certified > 0.99


def test_bodies_get_guards_of_their_own():
    small = shapes.box((10, 0, 0), (10.1, 0.1, 0.1))
    found = voxkernel.guards(shapes.joined(shapes.cube(), small))
    assert len(found) == 2
    assert found.bodies.tolist() == [0, 1]
    assert found.certified == 1.0


def test_a_cavity_belongs_to_the_body_around_it():
    hollow = shapes.joined(shapes.box((0, 0, 0), (3, 3, 3)), turned(shapes.box((1, 1, 1), (2, 2, 2))))
    found = voxkernel.guards(hollow, coverage=0.95)
    assert set(found.bodies.tolist()) == {0}
    assert 2 <= len(found) <= 8
    assert found.is_reached
    inside = ((found.points > 1) & (found.points < 2)).all(axis=1)
    assert not inside.any()


def test_a_shell_inside_that_faces_outwards_is_a_body_and_hides_what_is_behind_it():
    shells = shapes.joined(shapes.box((0, 0, 0), (3, 3, 3)), shapes.box((1, 1, 1), (2, 2, 2)))
    found = voxkernel.guards(shells, coverage=0.99)
    assert found.is_reached
    assert set(found.bodies.tolist()) == {0, 1}
    within = ((found.points > 1) & (found.points < 2)).all(axis=1)
    assert (within == (found.bodies == 1)).all()


def test_what_nobody_inside_can_see_is_a_reason():
    """Facets of two boxes that cross hide each other as they lie: an answer, and no error."""
    crossing = shapes.joined(shapes.box((0, 0, 0), (2, 2, 2)), shapes.box((1, 1, 1), (3, 3, 3)))
    found = voxkernel.guards(crossing, coverage=1.0, max_guards=6)
    assert found.is_reached or found.reason


def test_open_surfaces_have_guards_in_the_ball():
    found = voxkernel.guards(shapes.open_hemisphere())
    assert len(found) == 1
    assert found.is_reached
    assert found.seen_bounds[1] == 1.0
    bumpy = voxkernel.guards(shapes.height_field(lambda x, y: 0.2 * np.sin(9 * x) * np.cos(7 * y), 24))
    assert bumpy.is_reached


@pytest.mark.parametrize(
    "mesh",
    [
        (np.eye(3), [[0, 1, 2]]),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]]),
    ],
    ids=["a triangle", "a flat sheet", "both sides of one"],
)
def test_flat_surfaces_are_seen_whole(mesh):
    found = voxkernel.guards(mesh)
    assert found.is_reached
    assert found.certified == 1.0
    assert len(found) == (2 if len(mesh[0]) == 3 and len(mesh[1]) == 2 else 1)
    assert voxkernel.star_cover(found).verify()


def test_all_of_a_torus_takes_three():
    """Coverage 1: what fresh samples leave unseen is looked at until nothing is."""
    found = voxkernel.guards(torus(n_major=24, n_minor=12), coverage=1.0)
    assert found.is_reached
    assert found.seen == 1.0
    assert 3 <= len(found) <= 4


def test_outside_is_a_scan_plan():
    found = voxkernel.guards(shapes.cube(), side="outside", distance=2.0, coverage=0.99)
    assert found.is_reached
    assert len(found) in (2, 3, 4)
    outside = np.maximum(np.maximum(-found.points, found.points - 1.0), 0.0)
    assert np.linalg.norm(outside, axis=1) == pytest.approx(2.0, rel=1e-2)
    assert found.certified == 1.0
    assert voxkernel.star_cover(found).verify()


def test_candidates_are_the_only_places():
    places = np.array([[0.5, 0.5, 0.5], [5, 0.5, 0.5], [0.5, 3, 0.5], [3.5, 3, 0.5], [6.5, 3, 0.5], [9, 9, 9]])
    found = voxkernel.guards(COMB, candidates=places, coverage=0.999)
    assert len(found) >= 3
    assert {tuple(p) for p in found.points} <= {tuple(p) for p in places[:5]}
    poor = voxkernel.guards(COMB, candidates=places[:1])
    assert not poor.is_reached
    assert "no point that was tried sees more" in poor.reason
    assert "`candidates`" not in poor.reason
    outside = voxkernel.guards(COMB, candidates=places[5:])
    assert len(outside) == 0
    assert outside.reason.startswith("1 of 1 `candidates` are not where guards may be; ")
    assert outside.seen == outside.certified == outside.facing_bound == 0.0


def test_facing_bound_is_a_bound_and_first_seen_is_the_first():
    mesh = voxkernel.as_mesh(torus(n_major=20, n_minor=10))
    found = voxkernel.guards(mesh, max_guards=1)
    turned_away = voxkernel.violation(mesh, found.points)[0]
    assert found.facing_bound == pytest.approx(1.0 - turned_away, abs=1e-12)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    expected = [0 if sees(mesh.vertices, mesh.faces, found.points[0], m, i) else -1 for i, m in enumerate(middles)]
    assert found.first_seen.tolist() == expected


def test_degenerate_facets_hide_nothing_and_are_seen_by_none():
    vertices, faces = shapes.cube()
    found = voxkernel.guards((vertices, np.concatenate([faces, [[0, 0, 1], [1, 1, 0]]])))
    assert found.certified == 1.0
    assert found.first_seen.tolist() == [0] * 12 + [-1, -1]


def test_a_time_limit_returns_the_best_so_far_and_says_so():
    found = voxkernel.guards(urchin(3), coverage=0.999, time_limit=1e-9)
    assert not found.is_reached or len(found) == 1
    comb = voxkernel.guards(COMB, coverage=0.999, time_limit=1e-9)
    assert comb.is_reached or "the time limit is over" in comb.reason
    assert len(comb) >= 1
    assert comb.seen > 0.3


def test_progress_is_told():
    told = []
    voxkernel.guards(COMB, coverage=0.95, progress=told.append)
    assert {p.stage for p in told} == {"search", "confirm", "certify"}
    assert told[-1].n_guards >= 2
    assert "guards see" in str(told[0])
    assert all(a.seconds <= b.seconds for a, b in pairwise(told))


def test_progress_may_interrupt():
    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        voxkernel.guards(COMB, progress=stop)


@pytest.mark.parametrize(
    ("mesh", "options", "error", "words"),
    [
        (COMB, {"coverage": 0.0}, ValueError, "`coverage` must be > 0; got 0"),
        (COMB, {"coverage": 1.5}, ValueError, r"`coverage` must be in \(0, 1\]; got 1.5"),
        (COMB, {"coverage": np.nan}, ValueError, "`coverage` must be finite; got nan"),
        (COMB, {"coverage": "all"}, TypeError, "`coverage` must be a real number; got str"),
        (COMB, {"max_guards": 0}, ValueError, "`max_guards` must be in 1..10000; got 0"),
        (COMB, {"candidates": []}, ValueError, "`candidates` must hold at least one point; got 0"),
        (COMB, {"candidates": [[np.nan] * 3]}, ValueError, "`candidates` must be finite"),
        (COMB, {"side": "both"}, ValueError, "`side` must be one of 'inside', 'outside'; got 'both'"),
        (COMB, {"distance": 1.0}, ValueError, "`distance` must be left out with `side` 'inside'"),
        (COMB, {"side": "outside", "distance": 0.0}, ValueError, "`distance` must be > 0; got 0"),
        (COMB, {"side": "outside", "bound": True}, ValueError, "`bound` must be False for open surfaces"),
        (COMB, {"time_limit": 0.0}, ValueError, "`time_limit` must be > 0; got 0"),
        (COMB, {"threads": 0}, ValueError, "`threads` must be in 1..256; got 0"),
        (COMB, {"rng": -1}, ValueError, "`rng` must be in 0"),
        (COMB, {"rng": 2**70}, ValueError, "`rng` must be in 0"),
        (COMB, {"rng": None}, TypeError, "`rng` must be an integer; got NoneType"),
        (COMB, {"rng": np.random.default_rng(0)}, TypeError, "`rng` must be an integer; got Generator"),
        (COMB, {"max_guards": 1.5}, TypeError, "`max_guards` must be an integer; got float"),
        (COMB, {"candidates": [1, 2, 3]}, ValueError, r"`candidates` must have shape \(n, 3\); got \(3,\)"),
        (shapes.cube(), {"facets": []}, voxkernel.MeshError, "`facets` must leave a facet with positive area"),
        ((np.arange(9.0).reshape(3, 3), [[0, 1, 2]]), {}, voxkernel.MeshError, "must hold a triangle with positive"),
        (shapes.open_hemisphere(), {"bound": True}, ValueError, "`bound` must be False for open surfaces"),
        (shapes.open_hemisphere(), {"side": "outside"}, ValueError, "`side` must be 'inside' for an open surface"),
        (shapes.inside_out_cube(), {}, voxkernel.MeshError, "counter-clockwise seen from outside; got an enclosed"),
        (shapes.cube_with_flipped_face(), {}, voxkernel.MeshError, "`surface` must have an inner side; got"),
        (shapes.moebius_band(), {}, voxkernel.MeshError, "`surface` must have an inner side; got"),
        (([], []), {}, voxkernel.MeshError, "must"),
        (([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), {}, voxkernel.MeshError, "must be finite; got nan"),
    ],
)
def test_bad_input_is_refused_in_one_line(mesh, options, error, words):
    with pytest.raises(error, match=words) as caught:
        voxkernel.guards(mesh, **options)
    assert "\n" not in str(caught.value)
