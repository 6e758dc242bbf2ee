"""Laws of kernels on random integer meshes, where the truth is known in rationals."""

import dataclasses
from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from voxkernel.exact import exact_kernel
from voxkernel.measures import starshapeness
from voxkernel.voxels import voxel_kernel

few = settings(max_examples=12)
some = settings(max_examples=30)
turns = st.sampled_from(shapes.quarter_turns())
steps = st.tuples(*[st.integers(-20, 20)] * 3)
seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)

VERDICTS = {-1: "not star-shaped", 0: "degenerate", 1: "degenerate", 2: "degenerate", 3: "star-shaped"}


def assert_same_kernel(found, truth, *, move=lambda points: points, volume_factor=1.0, rel=1e-12):
    """`found` is `truth`, moved; both are KernelPolytopes."""
    assert found.dimension == truth.dimension
    assert found.volume == pytest.approx(truth.volume * volume_factor, rel=rel, abs=0)
    assert len(found.vertices) == len(truth.vertices)
    assert len(found.faces) == len(truth.faces)
    if truth.dimension >= 0:
        size = 1 + np.abs(move(truth.vertices)).max()
        assert found.centroid == pytest.approx(move(truth.centroid[None])[0], rel=rel, abs=rel * size)


def assert_true_kernel(found, truth, *, rel=1e-9):
    """`found` (KernelPolytope) is `truth` (oracle)."""
    assert found.dimension == truth.dimension
    assert found.volume == pytest.approx(float(truth.volume), rel=rel, abs=0)
    if truth.dimension < 0:
        assert found.vertices.shape == (0, 3)
        assert np.isnan(found.centroid).all()
        return
    exact = np.array([[float(x) for x in v] for v in truth.vertices])
    size = 1 + np.abs(exact).max()
    assert found.centroid == pytest.approx([float(x) for x in truth.centroid], rel=rel, abs=rel * size)
    assert len(found.vertices) == len(exact)
    nearest = np.abs(found.vertices[:, None] - exact[None]).max(axis=2)
    assert nearest.min(axis=0).max() <= rel * size
    assert nearest.min(axis=1).max() <= rel * size


def assert_certificate(found):
    certificate = found.certificate
    assert certificate.verify()
    assert certificate.kind == {-1: "empty", 3: "solid"}.get(found.dimension, "flat")
    if certificate.kind == "empty":
        assert 2 <= len(certificate.facet_ids) <= 4
    if len(certificate.multipliers):
        first, *rest = certificate.multipliers
        assert not dataclasses.replace(certificate, multipliers=(first + 1, *rest)).verify()
        assert not dataclasses.replace(certificate, multipliers=(-first, *rest)).verify()
    if len(certificate.points):
        far = tuple(tuple(x + 1000 for x in p) for p in certificate.points)
        assert not dataclasses.replace(certificate, points=far).verify()


# ---------------------------------------------------------------- exact kernel against the oracle


@pytest.mark.parametrize("name", shapes.KNOWN)
def test_known_kernels(name):
    make, known = shapes.KNOWN[name]
    found = exact_kernel(make())
    assert found.unclipped_dimension == known.dimension
    assert_certificate(found)
    if known.dimension >= 0:
        assert found.is_bounded == known.bounded
    if known.bounded:
        assert found.dimension == known.dimension
        assert not found.cut_by_domain
        assert found.volume == pytest.approx(known.volume, rel=1e-12)
        if known.centroid is not None:
            assert found.centroid == pytest.approx(known.centroid, rel=1e-12)
    else:
        assert found.cut_by_domain
        assert found.domain is not None
        assert found.domain.kind == "ball"


@pytest.mark.parametrize("name", shapes.KNOWN)
def test_known_verdicts(name):
    make, known = shapes.KNOWN[name]
    score = starshapeness(make())
    assert score.verdict == VERDICTS[known.dimension]
    assert (score.reason == "") == (known.dimension == 3)
    assert score.certificate.verify()
    if known.bounded and known.dimension == 3:
        assert score.volume == pytest.approx(known.volume, rel=1e-12)
        assert score.volume_bounds[0] <= score.volume <= score.volume_bounds[1]


@settings(max_examples=80)
@given(shapes.integer_meshes())
def test_exact_kernel_is_the_true_one(surface):
    truth = oracle.mesh_kernel(*surface)
    found = exact_kernel(surface)
    assert_true_kernel(found, truth)
    assert_certificate(found)
    assert not found.cut_by_domain
    if truth.dimension >= 0:
        assert found.is_bounded


@some
@given(shapes.central_soups())
def test_exact_kernel_is_the_true_one_where_kernels_are_thin(surface):
    found = exact_kernel(surface)
    assert_true_kernel(found, oracle.mesh_kernel(*surface))
    assert_certificate(found)


@some
@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 4), min_size=1, max_size=10), st.booleans())
def test_kernel_of_given_half_spaces(rows, doubled):
    from voxkernel.halfspaces import HalfSpaces

    rows = [row for row in rows if any(row[:3])]
    assume(rows)
    planes = [*rows * (1 + doubled), *oracle.box_planes((-5, -5, -5), (5, 5, 5))]
    array = np.array(planes, dtype=np.float64)
    found = exact_kernel(HalfSpaces.from_planes(array[:, :3], array[:, 3]))
    assert_true_kernel(found, oracle.kernel(planes))
    assert_certificate(found)


@some
@given(shapes.integer_meshes())
def test_faces_lie_on_the_facets_that_made_them(surface):
    found = exact_kernel(surface)
    assume(found.dimension == 3)
    vertices, faces = surface
    planes = oracle.corner_planes(vertices, faces)
    assert len(found.vertices) - len({frozenset((int(f[i - 1]), int(f[i]))) for f in found.faces for i in range(len(f))}) + len(found.faces) == 2  # fmt: skip # noqa: E501
    volume = 0.0
    for face, facet in zip(found.faces, found.face_facets, strict=True):
        assert facet >= 0
        a, b, c, d = planes[facet]
        points = found.vertices[face]
        assert points @ np.array([a, b, c], dtype=np.float64) == pytest.approx(d, abs=1e-9 * (1 + abs(d)))
        normal = sum(np.cross(points[i - 1], points[i]) for i in range(len(points)))
        assert normal @ np.array([a, b, c], dtype=np.float64) > 0
        volume += points[0] @ normal / 6
    assert volume == pytest.approx(found.volume, rel=1e-9)


# ---------------------------------------------------------------- equivariance


@some
@given(shapes.integer_meshes(), turns, steps)
def test_kernel_moves_with_the_surface(surface, turn, step):
    vertices, faces = surface
    there = exact_kernel((shapes.moved(vertices, turn, step), faces))
    assert_same_kernel(there, exact_kernel(surface), move=lambda p: shapes.moved(p, turn, step))


@some
@given(shapes.integer_meshes(), st.sampled_from([2.0**-40, 0.25, 3.0, 2.0**30]))
def test_kernel_scales_with_the_surface(surface, factor):
    vertices, faces = surface
    there = exact_kernel((vertices * factor, faces))
    here = exact_kernel(surface)
    assert there.dimension == here.dimension
    assert there.volume == pytest.approx(here.volume * factor**3, rel=1e-12, abs=0)
    if here.dimension >= 0:
        assert there.centroid / factor == pytest.approx(here.centroid, rel=1e-12, abs=1e-11)


@few
@given(shapes.radial_meshes(), seeds)
def test_solid_kernel_follows_any_rotation(surface, rng):
    vertices, faces = surface
    rotation, step = shapes.random_rotation(rng), rng.normal(size=3)
    here, there = exact_kernel(surface), exact_kernel((shapes.moved(vertices, rotation, step), faces))
    assert there.dimension == here.dimension == 3
    assert there.volume == pytest.approx(here.volume, rel=1e-9)
    assert there.centroid == pytest.approx(shapes.moved(here.centroid[None], rotation, step)[0], abs=1e-9)
    moved_inertia = rotation @ here.inertia @ rotation.T
    assert there.inertia == pytest.approx(moved_inertia, rel=1e-7, abs=1e-9 * np.trace(here.inertia))


@few
@given(seeds)
def test_default_domain_moves_with_an_open_surface(rng):
    vertices, faces = shapes.height_field(n=4)
    rotation, step = shapes.random_rotation(rng), rng.normal(size=3)
    here, there = (
        exact_kernel((vertices, faces)),
        exact_kernel((shapes.moved(vertices, rotation, step), faces)),
    )
    assert there.volume == pytest.approx(here.volume, rel=1e-9)
    assert there.centroid == pytest.approx(shapes.moved(here.centroid[None], rotation, step)[0], abs=1e-9)


# ---------------------------------------------------------------- the same surface, written differently


@some
@given(shapes.integer_meshes(), seeds)
def test_order_of_facets_and_vertices_does_not_matter(surface, rng):
    assert_same_kernel(exact_kernel(shapes.shuffled(*surface, rng)), exact_kernel(surface))


@some
@given(shapes.integer_meshes(), st.data())
def test_splitting_a_flat_facet_changes_nothing(surface, data):
    here = exact_kernel(surface)
    facet = data.draw(st.integers(0, len(surface[1]) - 1))
    assert_same_kernel(exact_kernel(shapes.with_split_facet(*surface, facet)), here)
    assert_same_kernel(exact_kernel(shapes.subdivided(*surface)), here)


@few
@given(shapes.polygon_prisms())
def test_prepared_half_spaces_give_the_same_kernel(surface):
    from voxkernel.halfspaces import HalfSpaces
    from voxkernel.mesh import as_mesh

    assert_same_kernel(exact_kernel(HalfSpaces.from_mesh(as_mesh(surface))), exact_kernel(surface))


def test_polygons_and_their_triangles_have_one_kernel():
    from voxkernel.mesh import TriangleMesh

    vertices, polygons = shapes.truncated_octahedron()
    whole = exact_kernel(TriangleMesh.from_polygons(vertices, polygons))
    assert_same_kernel(whole, exact_kernel(shapes.fan(vertices, polygons)))
    assert whole.volume == pytest.approx(32, rel=1e-14)
    assert sorted(whole.face_facets.tolist()) == list(range(14))
    assert sorted(map(len, whole.faces)) == [4] * 6 + [6] * 8


# ---------------------------------------------------------------- order


@some
@given(shapes.integer_meshes(), st.data())
def test_more_facets_never_make_the_kernel_grow(surface, data):
    vertices, faces = surface
    n = data.draw(st.integers(1, len(faces)))
    planes = oracle.box_planes((-9, -9, -9), (10, 10, 10))
    rows = np.array(planes, dtype=np.float64)
    domain = (rows[:, :3], rows[:, 3])
    part_has_area = oracle.tightest(oracle.corner_planes(vertices, faces[:n]))
    assume(part_has_area)
    more = exact_kernel(surface, domain=domain)
    fewer = exact_kernel(surface, facets=np.arange(n), domain=domain)
    assert_true_kernel(fewer, oracle.mesh_kernel(vertices, faces[:n], planes))
    assert fewer.dimension >= more.dimension
    assert more.volume <= fewer.volume * (1 + 1e-12)
    for a, b, c, d in part_has_area:
        assert (more.vertices @ np.array([a, b, c], dtype=np.float64) <= d + 1e-9 * (1 + abs(d))).all()


@some
@given(shapes.convex_meshes())
def test_a_convex_solid_is_its_own_kernel(surface):
    vertices, faces = surface
    found = exact_kernel(surface)
    volume = float(oracle.enclosed_volume(vertices, faces))
    assert found.dimension == 3
    assert found.volume == pytest.approx(volume, rel=1e-12)
    score = starshapeness(surface)
    assert score.ratio == 1.0
    assert score.verdict == "star-shaped"
    assert score.reference == "enclosed volume"
    assert score.reference_volume == pytest.approx(volume, rel=1e-12)


@pytest.mark.parametrize("make", [shapes.cube, shapes.octahedron, shapes.icosphere])
def test_ratio_of_convex_solids_is_one(make):
    assert starshapeness(make()).ratio == 1.0


@some
@given(st.one_of(shapes.polycubes(), shapes.polygon_prisms(), shapes.radial_meshes()))
def test_ratio_and_verdict_are_the_true_ones(surface):
    truth = oracle.mesh_kernel(*surface)
    score = starshapeness(surface)
    assert score.verdict == VERDICTS[truth.dimension]
    assert score.certificate.verify()
    if score.is_closed:
        volume = oracle.enclosed_volume(*surface)
        assert 0 <= score.ratio <= 1
        assert (score.ratio == 1.0) == (truth.volume == volume)
        assert score.ratio == pytest.approx(float(truth.volume / volume), rel=1e-9, abs=0)
    if truth.dimension >= 0:
        assert score.center is not None
        planes = oracle.corner_planes(*surface)
        exact = np.array([p for p in oracle.tightest(planes)], dtype=np.float64)
        assert (exact[:, :3] @ np.asarray(score.center) <= exact[:, 3] + 1e-9).all()
        if truth.dimension == 3:
            assert oracle.is_inside(planes, score.center)


# ---------------------------------------------------------------- grid


def _cells(ijk, masks):
    """Cell ids (n, 3) of leaf masks: word = x, bit = y * 8 + z."""
    bits = np.unpackbits(masks.view(np.uint8).reshape(-1, 8, 8), axis=-1, bitorder="little").reshape(
        -1, 8, 8, 8
    )
    leaf, x, y, z = np.nonzero(bits)
    return ijk[leaf].astype(np.int64) + np.stack([x, y, z], axis=1)


def _assert_grid_encloses(grid, planes, truth, rng):
    """inside cells are in K exactly, no point of K is outside, and the bounds bracket its volume."""
    assert grid.tile_ijk.dtype == np.int32
    assert grid.leaf_inside.dtype == np.uint64
    assert not (grid.leaf_inside & grid.leaf_boundary).any()
    assert (grid.leaf_ijk % 8 == 0).all()
    origin, edge = [Fraction(float(v)) for v in grid.origin], Fraction(float(grid.voxel_size))
    inside = _cells(grid.leaf_ijk, np.ascontiguousarray(grid.leaf_inside))
    boxes = [(lower, 1) for lower in rng.permutation(inside)[:10].tolist()]
    boxes += [
        (lower, 1 << int(log2)) for lower, log2 in zip(grid.tile_ijk.tolist(), grid.tile_log2, strict=True)
    ][:10]
    for lower, width in boxes:
        for corner in range(8):
            ijk = [lower[k] + width * (corner >> k & 1) for k in range(3)]
            assert oracle.is_inside(planes, [origin[k] + ijk[k] * edge for k in range(3)])
    n_tile_cells = int((8 ** grid.tile_log2.astype(np.int64)).sum())
    n_inside = n_tile_cells + len(inside)
    n_boundary = len(_cells(grid.leaf_ijk, np.ascontiguousarray(grid.leaf_boundary)))
    lower, upper = map(Fraction, grid.volume_bounds)
    assert lower <= truth.volume <= upper
    assert float(lower) == pytest.approx(float(n_inside * edge**3), rel=1e-12)
    assert float(upper) == pytest.approx(float((n_inside + n_boundary) * edge**3), rel=1e-12)

    points = np.array(
        [[float(x) for x in p] for p in oracle.sample_points(truth.vertices, rng, 20)]
        + [[float(x) for x in p] for p in truth.vertices]
    ).reshape(-1, 3)
    points = np.concatenate(
        [points, points + rng.normal(scale=0.3, size=points.shape), rng.uniform(-4, 4, (10, 3))]
    )
    for xyz, answer in zip(points, grid.classify(points), strict=True):
        is_inside = oracle.is_inside(planes, xyz)
        assert answer != (-1 if is_inside else 1)


@few
@given(shapes.integer_meshes(), st.integers(3, 6), seeds)
def test_grid_encloses_the_kernel(surface, depth, rng):
    planes = oracle.corner_planes(*surface)
    truth = oracle.kernel(planes)
    _assert_grid_encloses(voxel_kernel(surface, depth=depth), planes, truth, rng)


@pytest.mark.parametrize(
    "name", ["l_prism", "star_prism", "s_tetromino", "saw_prism", "notched_cube", "two_boxes"]
)
@pytest.mark.parametrize("depth", [3, 7])
def test_grid_encloses_known_kernels(name, depth, rng):
    surface = shapes.KNOWN[name][0]()
    planes = oracle.corner_planes(*surface)
    _assert_grid_encloses(voxel_kernel(surface, depth=depth), planes, oracle.kernel(planes), rng)


@few
@given(shapes.integer_meshes())
def test_volume_bounds_tighten_with_depth(surface):
    truth = oracle.mesh_kernel(*surface).volume
    last = (0.0, np.inf)
    for depth in range(3, 8):
        lower, upper = voxel_kernel(surface, depth=depth).volume_bounds
        assert Fraction(lower) <= truth <= Fraction(upper)
        assert lower >= last[0]
        assert upper <= last[1]
        last = (lower, upper)


def test_bounds_reach_the_volume_asked_for():
    grid = voxel_kernel(shapes.star_prism(), rtol=0.02)
    lower, upper = grid.volume_bounds
    assert lower <= 6.0 <= upper
    assert upper - lower <= 0.02 * upper


@few
@given(shapes.radial_meshes(), turns, steps)
def test_grid_bounds_hold_in_the_principal_frame(surface, turn, step):
    vertices, faces = surface
    truth = float(oracle.mesh_kernel(vertices, faces).volume)
    moved = (shapes.moved(vertices, turn, step), faces)
    for mesh in (surface, moved):
        lower, upper = voxel_kernel(mesh, depth=5, frame="principal").volume_bounds
        assert lower <= truth <= upper


def test_grid_and_exact_kernel_share_the_domain():
    surface = shapes.height_field(n=4)
    exact = exact_kernel(surface)
    grid = voxel_kernel(surface, depth=6)
    lower, upper = grid.volume_bounds
    assert lower <= exact.volume <= upper
    assert (grid.classify(exact.vertices) != -1).all()
    assert grid.classify(exact.centroid[None])[0] == 1


# ---------------------------------------------------------------- surfaces that are not what they should be


def test_open_surface_is_star_shaped_wherever_its_kernel_lies():
    # a flat roof cut in two by a tall narrow chimney-like step: the kernel lies far below
    steep = shapes.height_field(lambda x, y: 40 * np.abs(x) + 0 * y, n=2)
    found = exact_kernel(steep, domain="hull")
    score = starshapeness(steep, domain="hull")
    assert found.unclipped_dimension == 3
    assert score.verdict == "star-shaped"
    assert found.dimension in (-1, 0, 1, 2)
    assert score.volume == 0
    assert score.notes


def test_domains_bound_an_unbounded_kernel():
    surface = shapes.open_box()
    found = exact_kernel(surface, domain="box")
    assert found.volume == pytest.approx(1, rel=1e-12)
    assert found.cut_by_domain
    assert not found.is_bounded
    assert (found.face_facets < 0).sum() == 1
    ball = exact_kernel(surface)
    assert ball.domain.kind == "ball"
    assert ball.volume > 1


def test_inconsistent_orientation_is_said():
    score = starshapeness(shapes.cube_with_flipped_face())
    assert score.verdict == "degenerate"
    assert any("oriented" in note for note in score.notes)
    band = starshapeness(shapes.moebius_band())
    assert any("oriented" in note for note in band.notes)


def test_moebius_band_has_the_kernel_of_its_planes():
    surface = shapes.moebius_band()
    truth = oracle.mesh_kernel(*surface, oracle.box_planes((-9, -9, -9), (9, 9, 9)))
    assert exact_kernel(surface).unclipped_dimension == truth.dimension
