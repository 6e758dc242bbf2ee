"""Domains: where kernels are looked for, and what is said about what they cut off."""

from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from voxkernel.errors import MeshError
from voxkernel.exact import exact_kernel
from voxkernel.halfspaces import Domain, HalfSpaces, ball_domain, box_domain, hull_domain, planes_domain
from voxkernel.halfspaces.area_moments import mesh_moments
from voxkernel.halfspaces.domain import as_domain, surface_frame
from voxkernel.mesh import as_mesh
from voxkernel.registration import prepare_surface

CUBE = np.concatenate([np.eye(3), -np.eye(3)])
FAR = 2**4000


def between(low, high):
    return CUBE, np.concatenate([np.full(3, high), np.full(3, -low)]).astype(np.float64)


# ---------------------------------------------------------------- the polytopes


def test_ball_is_a_polytope_around_a_ball():
    mesh = as_mesh(shapes.height_field(n=4))
    ball = ball_domain(mesh)
    center, _ = surface_frame(mesh)
    radius = 1.3 * np.linalg.norm(mesh.vertices - center, axis=1).max()
    assert len(ball.offsets) == 642
    assert np.linalg.norm(ball.normals, axis=1) == pytest.approx(np.ones(642), rel=1e-14)
    assert ball.offsets - ball.normals @ center == pytest.approx(np.full(642, radius), rel=1e-12)
    assert 4 / 3 * np.pi * radius**3 < ball.volume < 1.02 * 4 / 3 * np.pi * radius**3
    slack = ball.offsets[:, None] - ball.normals @ ball.vertices.T
    assert slack.min() > -1e-9
    assert np.abs(slack).min(axis=1).max() < 1e-9  # every plane has corners
    assert (ball.offsets[:, None] > ball.normals @ mesh.vertices.T).all()
    assert ball_domain(mesh, factor=2.6).volume == pytest.approx(8 * ball.volume, rel=1e-12)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-20, 1.0, 1e20]))
def test_ball_moves_with_the_surface(seed, size):
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.height_field(n=3)
    rotation, step = shapes.random_rotation(rng), rng.normal(size=3)
    here = ball_domain(as_mesh((vertices, faces)))
    there = ball_domain(as_mesh((shapes.moved(vertices, rotation, step) * size, faces)))
    assert there.volume == pytest.approx(here.volume * size**3, rel=1e-9)
    # the same set of corners: each has its image among the others
    image = shapes.moved(here.vertices, rotation, step) * size
    gaps = np.linalg.norm(image[:, None] - there.vertices[None], axis=2).min(axis=1)
    assert gaps.max() < 1e-8 * size


def test_frame_of_a_box_are_its_edges():
    vertices, faces = shapes.box((0, 0, 0), (1, 5, 2))
    center, frame = surface_frame(as_mesh((vertices, faces)))
    assert center == pytest.approx([0.5, 2.5, 1.0])
    assert np.abs(frame) == pytest.approx(np.eye(3)[[1, 2, 0]], abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)


def test_frame_ignores_how_facets_are_split():
    surface = shapes.box((1, -1, 0), (2, 2, 5))
    one, two = (surface_frame(as_mesh(s)) for s in (surface, shapes.with_split_facet(*surface, 3)))
    assert one[0] == pytest.approx(two[0])
    assert np.abs(one[1]) == pytest.approx(np.abs(two[1]), abs=1e-12)


def test_moments_of_a_box_and_of_its_parts():
    """Closed forms: a box of edges a, b, c about its middle, whose facets may be cut in four again and again."""
    edges = np.array([1.0, 5.0, 2.0])
    vertices, faces = shapes.box((3, -4, 7), tuple(np.array([3, -4, 7]) + edges))
    pairs = np.array([2 * edges[(k + 1) % 3] * edges[(k + 2) % 3] for k in range(3)])  # of sides across each axis
    second = [pairs[k] * edges[k] ** 2 / 4 + (pairs.sum() - pairs[k]) * edges[k] ** 2 / 12 for k in range(3)]
    for _ in range(6):
        moments = mesh_moments(as_mesh((vertices, faces)))
        about = moments.spread - np.outer(moments.mean, moments.mean)
        assert moments.area == pytest.approx(pairs.sum(), rel=1e-12)
        assert moments.centroid == pytest.approx([3.5, -1.5, 8], abs=1e-12)
        assert about * moments.unit**2 == pytest.approx(np.diag(second) / pairs.sum(), abs=1e-12)
        vertices, faces = shapes.subdivided(vertices, faces)


def test_needles_whose_area_floats_do_not_see_have_a_frame():
    rng = np.random.default_rng(0)
    for _ in range(200):
        start, way = rng.normal(size=(2, 3))
        needle = np.array([start, start + way, start + rng.uniform(0.2, 0.8) * way])
        try:
            mesh = as_mesh((needle, [[0, 1, 2]]))
        except MeshError:  # rounded onto a line
            continue
        if mesh_moments(mesh).area == 0.0:
            break
    center, frame = surface_frame(mesh)
    assert center == pytest.approx(mesh.bounds.mean(axis=0))
    assert np.abs(frame).sum() == 3
    assert ball_domain(mesh).volume > 0
    with pytest.raises(MeshError, match="needles only"):
        prepare_surface(mesh)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_sign_of_an_axis_is_that_of_the_third_moment(up):
    """A long pyramid: most of its area lies near its base, and far from there lies its tip."""
    vertices = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 9 * up]], float)
    surface = shapes.fan(vertices, [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])
    for _ in range(3):
        surface = shapes.subdivided(*surface)
    moments = mesh_moments(as_mesh(surface))
    assert moments.axes(moments.spread)[0] @ (vertices[4] - moments.centroid) > 5


def test_box_and_hull_of_a_prism():
    mesh = as_mesh(shapes.l_prism())
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    box = box_domain(mesh)
    assert (box.kind, box.volume) == ("box", pytest.approx(np.prod(high - low)))
    assert len(box.vertices) == 8
    hull = hull_domain(mesh)
    assert hull.kind == "hull"
    assert hull.volume == pytest.approx(3.5)  # the square of 4 without half of a square of 1
    assert (hull.normals @ mesh.vertices.T <= hull.offsets[:, None] + 1e-12).all()
    assert repr(hull) == "Domain(kind='hull', n_planes=7, volume=3.5)"


def test_vertices_no_facet_uses_count_for_nothing():
    vertices, faces = shapes.open_box()
    mesh = as_mesh((np.concatenate([vertices, [[99, 99, 99]]]), faces))
    for make in (ball_domain, box_domain, hull_domain):
        assert make(mesh).volume == pytest.approx(make(as_mesh((vertices, faces))).volume)


@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.integers(-4, 4)] * 4).filter(lambda row: any(row[:3])), max_size=10))
def test_volume_of_given_planes_is_the_true_one(rows):
    rows = [*rows, *oracle.box_planes((-5, -5, -5), (5, 5, 5))]
    truth = oracle.kernel([oracle.plane(row[:3], row[3]) for row in rows])
    array = np.array(rows, dtype=np.float64)
    if truth.dimension < 3:
        with pytest.raises(ValueError, match="bound a finite volume"):
            planes_domain(array[:, :3], array[:, 3])
        return
    domain = planes_domain(array[:, :3], array[:, 3])
    assert domain.volume == pytest.approx(float(truth.volume), rel=1e-9)
    corners = np.array([[float(x) for x in v] for v in truth.vertices])
    assert np.linalg.norm(domain.vertices[:, None] - corners[None], axis=2).min(axis=1).max() < 1e-9
    assert (domain.offsets == array[:, 3]).all()  # as given: these doubles are exact


# ---------------------------------------------------------------- arguments


def test_every_spelling_of_a_domain():
    mesh = as_mesh(shapes.cube())
    normals, offsets = between(-1, 2)
    given = planes_domain(normals, offsets)
    assert as_domain(None, mesh) is None
    assert as_domain(given, None) is given
    assert [as_domain(kind, mesh).kind for kind in ("ball", "hull", "box")] == ["ball", "hull", "box"]
    for spelling in ((normals, offsets), HalfSpaces.from_planes(normals, offsets)):
        made = as_domain(spelling, None)
        assert isinstance(made, Domain)
        assert made.kind == "planes"
        assert made.volume == pytest.approx(27)


@pytest.mark.parametrize(
    ("domain", "error", "text"),
    [
        ("sphere", ValueError, "`domain` must be one of 'ball', 'hull', 'box'; got 'sphere'"),
        (3.5, TypeError, r"Domain, HalfSpaces or \(normals, offsets\); got float"),
        ((np.eye(3), np.ones(2)), ValueError, "`offsets` must have shape"),
        ((np.eye(3), np.ones(3)), ValueError, "bound a finite volume"),
        (between(1, 1), ValueError, "bound a finite volume"),
        (between(2, 1), ValueError, "bound a finite volume"),
    ],
)
def test_what_is_not_a_domain(domain, error, text):
    with pytest.raises(error, match=text):
        as_domain(domain, as_mesh(shapes.cube()))


def test_names_need_a_mesh():
    with pytest.raises(ValueError, match="`domain` must be given as half-spaces when there is no mesh; got 'ball'"):
        as_domain("ball", None)


@pytest.mark.parametrize("make", [box_domain, hull_domain])
def test_flat_surfaces_bound_nothing(make):
    flat = as_mesh(([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]], [[0, 1, 2], [1, 3, 2]]))
    with pytest.raises(ValueError, match=r"`domain` must have a volume; got the .* in one plane"):
        make(flat)


# ---------------------------------------------------------------- what a domain changes


def assert_domain_facts(surface, domain, facets=slice(None)):
    """Everything a result says about the domain, from the vertices of a kernel cut by an enormous cube."""
    vertices, faces = surface
    planes = oracle.corner_planes(vertices, faces[facets])
    region = [oracle.plane(n, d) for n, d in zip(*domain, strict=True)]
    found = exact_kernel((vertices, faces[facets]), domain=domain)
    truth = oracle.kernel([*planes, *region])
    whole = oracle.kernel([*planes, *oracle.box_planes((-FAR,) * 3, (FAR,) * 3)])
    assert found.dimension == truth.dimension
    assert found.volume == pytest.approx(float(truth.volume), rel=1e-9, abs=0)
    assert found.unclipped_dimension == whole.dimension
    assert found.cut_by_domain == any(oracle.side(p, v) > 0 for p in region for v in whole.vertices)
    assert found.is_bounded == (whole.dimension < 0 or oracle.is_bounded(planes))
    assert (found.unclipped_point is None) == (whole.dimension < 0)
    assert found.certificate.verify()
    assert found.unclipped_certificate.verify()
    return found


corner = st.integers(-3, 2)


@settings(max_examples=40)
@given(
    st.one_of(shapes.soups(), shapes.central_soups()).map(lambda s: (s[0], s[1][12:])),
    st.tuples(corner, corner, corner),
    st.tuples(*[st.integers(1, 6)] * 3),
)
def test_open_soups_in_integer_boxes(surface, low, size):
    """Faces of the box that touch the kernel in a corner, along an edge or a face, and cut nothing off."""
    assume(oracle.tightest(oracle.corner_planes(*surface)))
    low = np.array(low)
    assert_domain_facts(surface, (CUBE, np.concatenate([low + size, -low]).astype(np.float64)))


@settings(max_examples=25)
@given(st.one_of(shapes.polygon_prisms(), shapes.polycubes()), st.data())
def test_parts_of_closed_surfaces(surface, data):
    rows = data.draw(st.lists(st.integers(0, len(surface[1]) - 1), min_size=1, unique=True))
    if oracle.tightest(oracle.corner_planes(surface[0], surface[1][rows])):
        assert_domain_facts(surface, between(-7, 8), rows)


@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("turned", [False, True])
def test_kernels_far_outside_a_slightly_curved_patch(distance, turned, rng):
    """A shallow tent, open below: the kernel begins `distance` under its eaves."""
    vertices, faces = shapes.mesh(
        [(0, 0, 1 / distance), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)],
        [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4)],  # outside is below
    )
    if turned:
        vertices = vertices @ shapes.quarter_turns()[rng.integers(24)].T
    axis = int(np.argmax(np.abs(vertices).sum(0) == np.abs(vertices).sum(0).min()))
    up = np.sign(vertices[0, axis])
    middle = np.zeros(3)
    middle[axis] = up * distance
    cube = CUBE, np.concatenate([middle + distance / 2, distance / 2 - middle])
    found = assert_domain_facts((vertices, faces), cube)
    assert found.dimension == 3
    assert found.deepest_point[axis] * up > distance / 2
    assert found.clearance > distance / 10


def test_a_flat_kernel_on_the_rim_of_the_domain_is_not_cut():
    """The kernel of the tetromino is a square: touch it with a side of a box."""
    surface = shapes.s_tetromino(0.0)
    free = exact_kernel(surface)
    assert free.dimension == 2
    low, high = free.vertices.min(0), free.vertices.max(0)
    flat = int(np.argmin(high - low))
    rim = high.copy()
    rim[flat] += 1
    same = exact_kernel(surface, domain=(CUBE, np.concatenate([rim, -low])))
    assert same.dimension == 2
    assert same.area == pytest.approx(free.area)
    assert not same.cut_by_domain
    half = np.where(np.arange(3) == flat, rim, (low + high) / 2)
    less = exact_kernel(surface, domain=(CUBE, np.concatenate([half, -low])))
    assert less.dimension == 2
    assert less.area == pytest.approx(free.area / 4)
    assert less.cut_by_domain


def test_closed_surfaces_that_enclose_nothing_get_a_domain():
    """The two sides of a triangle are closed, and their kernel is a whole plane."""
    both = shapes.mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 1)])
    assert as_mesh(both).facts().is_closed
    found = exact_kernel(both)
    assert found.domain.kind == "ball"
    assert (found.dimension, found.unclipped_dimension) == (2, 2)
    assert found.cut_by_domain
    assert not found.is_bounded
    assert np.abs(found.vertices[:, 2]).max() == 0
    assert found.area > np.pi * Fraction(1, 4)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1e6])
def test_domains_much_smaller_or_larger_than_the_surface(size):
    surface = shapes.open_box()
    middle = surface[0].mean(axis=0)
    found = assert_domain_facts(surface, (CUBE, np.concatenate([middle + size, size - middle])))
    assert found.dimension == 3
