"""`exact_kernel` beyond the laws: domains, certificates, depth, thin kernels with many faces, odd input."""

import dataclasses
from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection
from scipy.spatial.transform import Rotation

import voxkernel
from voxkernel.halfspaces import HalfSpaces, find_feasibility


def scipy_depth(planes):
    """Largest clearance by HiGHS over all rows."""
    rows = np.column_stack([planes.normals, np.ones(len(planes))])
    answer = linprog([0, 0, 0, -1], A_ub=rows, b_ub=planes.offsets, bounds=[(None, None)] * 4)
    return answer.x[3]


@pytest.mark.parametrize("make", [shapes.spiky, shapes.star_prism, shapes.icosphere, shapes.ellipsoid, shapes.l_prism])
def test_deepest_point_is_the_deepest(make):
    surface = make()
    kernel = voxkernel.exact_kernel(surface)
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh(surface))
    slack = planes.offsets - planes.normals @ kernel.deepest_point
    assert slack.min() == pytest.approx(kernel.clearance, rel=1e-9)
    assert kernel.clearance == pytest.approx(scipy_depth(planes), rel=1e-7)


@pytest.mark.parametrize("make", [shapes.spiky, shapes.star_prism, shapes.icosphere, shapes.plus_cross])
def test_faces_close_and_lie_on_their_facets(make):
    surface = make()
    kernel = voxkernel.exact_kernel(surface)
    edges = [(a, b) for f in kernel.faces for a, b in zip(f, np.roll(f, -1), strict=True)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)
    assert len(kernel.vertices) - len(edges) // 2 + len(kernel.faces) == 2  # Euler
    vertices, triangles = surface
    for ring, facet in zip(kernel.faces, kernel.face_facets, strict=True):
        p, q, r = vertices[triangles[facet]]
        normal = np.cross(q - p, r - p)
        normal /= np.linalg.norm(normal)
        assert np.abs((kernel.vertices[ring] - p) @ normal).max() < 1e-9
        a, b, c = kernel.vertices[ring[:3]]
        assert np.cross(b - a, c - b) @ normal > 0
    assert kernel.max_residual < 1e-12


def test_kernel_as_a_mesh_is_its_own_kernel():
    kernel = voxkernel.exact_kernel(shapes.spiky())
    mesh = kernel.to_mesh()
    assert mesh.facts().is_closed
    assert mesh.facts().volume == pytest.approx(kernel.volume, rel=1e-12)
    again = voxkernel.exact_kernel(mesh)
    assert again.volume == pytest.approx(kernel.volume, rel=1e-9)


def test_moments_of_a_box():
    kernel = voxkernel.exact_kernel(shapes.box((0, 0, 0), (1, 2, 4)))
    assert kernel.centroid == pytest.approx([0.5, 1, 2])
    assert kernel.inertia == pytest.approx(8 / 12 * np.diag([1, 4, 16]), abs=1e-12)
    assert kernel.area == pytest.approx(2 * (2 + 4 + 8))
    assert kernel.volume_bounds[0] <= 8 <= kernel.volume_bounds[1]


@pytest.mark.parametrize("filtered", [True, False])
@pytest.mark.parametrize(
    ("make", "kind"),
    [
        (shapes.spiky, "solid"),
        (shapes.torus, "empty"),
        (shapes.two_boxes, "empty"),
        (shapes.saw_prism, "flat"),
        (shapes.notched_cube, "flat"),
        (shapes.cube_with_flipped_face, "flat"),
    ],
)
def test_certificates(make, kind, filtered):
    proof = voxkernel.exact_kernel(make()).certificate
    assert proof.kind == kind
    assert proof.verify(filtered=filtered)
    if proof.multipliers:
        assert len(proof.facet_ids) <= 4 or kind == "flat"
        more = (proof.multipliers[0] + 1, *proof.multipliers[1:])
        assert not dataclasses.replace(proof, multipliers=more).verify()
        assert not dataclasses.replace(proof, facet_ids=proof.facet_ids[::-1]).verify()
    if proof.points:
        off = tuple(v + 100 for v in proof.points[0])
        assert not dataclasses.replace(proof, points=(off, *proof.points[1:])).verify()
    wrong = {"solid": "flat", "flat": "solid", "empty": "solid"}[kind]
    assert not dataclasses.replace(proof, kind=wrong).verify()


def test_certificate_as_plain_numbers():
    proof = voxkernel.exact_kernel(shapes.saw_prism()).certificate.to_dict()
    assert proof["dimension"] == 1
    assert all(isinstance(Fraction(v), Fraction) for p in proof["points"] for v in p)


@pytest.mark.parametrize("make", [shapes.torus, shapes.two_boxes, shapes.inside_out_cube])
def test_empty_in_three_passes(make):
    assert find_feasibility(HalfSpaces.from_mesh(voxkernel.as_mesh(make()))).passes <= 3


def test_open_box_in_every_domain():
    """A box without lid: the kernel is the half-infinite box above its floor."""
    surface = shapes.open_box()
    low, high = surface[0].min(0), surface[0].max(0)
    box = voxkernel.exact_kernel(surface, domain="box")
    assert box.volume == pytest.approx(np.prod(high - low))
    assert box.cut_by_domain
    assert not box.is_bounded
    assert (box.face_facets < 0).sum() == 1  # only the lid comes from the domain
    ball = voxkernel.exact_kernel(surface)
    assert ball.domain.kind == "ball"
    assert ball.cut_by_domain
    assert ball.volume > box.volume
    planes = np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([high + 5, 5 - low])
    wide = voxkernel.exact_kernel(surface, domain=planes)
    sides = np.delete(high - low, 2)
    tall = max(wide.vertices[:, k].max() - wide.vertices[:, k].min() for k in range(3))
    assert wide.volume == pytest.approx(np.prod(sides) * tall)


def test_domain_that_misses_the_kernel():
    surface = shapes.cube()
    away = np.concatenate([np.eye(3), -np.eye(3)]), np.array([12, 12, 12, -11, -11, -11.0])
    kernel = voxkernel.exact_kernel(surface, domain=away)
    assert kernel.dimension == -1
    assert kernel.unclipped_dimension == 3
    assert kernel.cut_by_domain
    assert kernel.is_bounded
    assert kernel.certificate.verify()
    assert min(kernel.certificate.facet_ids) < 0
    assert kernel.unclipped_certificate.verify()
    inside = HalfSpaces.from_mesh(voxkernel.as_mesh(surface))
    assert (inside.normals @ kernel.unclipped_point < inside.offsets).all()


def test_domain_that_holds_the_kernel_does_not_cut_it():
    kernel = voxkernel.exact_kernel(shapes.l_prism(), domain="hull")
    free = voxkernel.exact_kernel(shapes.l_prism())
    assert kernel.volume == pytest.approx(free.volume)
    assert not kernel.cut_by_domain
    assert kernel.is_bounded


@pytest.mark.parametrize(
    ("domain", "error", "text"),
    [
        ("sphere", ValueError, "`domain` must be one of 'ball', 'hull', 'box'; got 'sphere'"),
        (7, TypeError, "`domain` must be 'ball', 'hull', 'box', a Domain"),
        ((np.eye(3), np.ones(3)), ValueError, "bound a finite volume"),
    ],
)
def test_bad_domains(domain, error, text):
    with pytest.raises(error, match=text):
        voxkernel.exact_kernel(shapes.cube(), domain=domain)


@pytest.mark.parametrize("domain", ["hull", "box"])
def test_flat_surface_has_no_hull(domain):
    flat = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    with pytest.raises(ValueError, match="lies in one plane"):
        voxkernel.exact_kernel(flat, domain=domain)
    assert voxkernel.exact_kernel(flat).unclipped_dimension == 3


def test_unbounded_half_spaces_need_a_domain():
    with pytest.raises(ValueError, match="`domain` must be given"):
        voxkernel.exact_kernel(HalfSpaces.from_planes([[1, 0, 0], [-1, 0, 0]], [1, 1]))


def test_restricted_facets():
    vertices, faces = shapes.l_prism()
    whole = voxkernel.exact_kernel((vertices, faces), domain="hull")
    part = np.arange(len(faces)) % 2 == 0
    smaller = voxkernel.exact_kernel((vertices, faces), facets=part, domain="hull")
    assert smaller.volume >= whole.volume
    own = smaller.face_facets[smaller.face_facets >= 0]
    assert set(own.tolist()) <= set(np.flatnonzero(part).tolist())
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh((vertices, faces)))
    assert not planes.select(part).bounds_volume


def tangent_planes(n, stretch, rotation):
    rng = np.random.default_rng(5)
    u = rng.normal(size=(n, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    return u, (u / stretch) @ rotation.T


@pytest.mark.parametrize("thickness", [1e-2, 1e-6, 1e-10])
def test_thin_kernels_with_many_faces(thickness):
    """An affine image of a round polytope: same faces, volume times the determinant."""
    stretch = np.array([1, 1, thickness])
    u, normals = tangent_planes(400, stretch, np.eye(3))
    known = ConvexHull(HalfspaceIntersection(np.column_stack([u, -np.ones(400)]), np.zeros(3)).intersections).volume
    kernel = voxkernel.exact_kernel(HalfSpaces.from_planes(normals, np.ones(400)))
    assert kernel.volume == pytest.approx(known * thickness, rel=1e-12)
    assert len(kernel.face_facets) == 400
    assert kernel.volume_bounds[0] <= known * thickness * (1 + 1e-12)
    assert kernel.volume_bounds[1] >= known * thickness * (1 - 1e-12)


@pytest.mark.parametrize("size", [1e-4, 1e-8])
def test_small_kernel_of_a_large_surface(size):
    """Planes that touch a small ball far from the origin, as exact doubles."""
    rotation = Rotation.random(random_state=3).as_matrix()
    u, normals = tangent_planes(200, np.ones(3), rotation)
    far = np.array([0.75, -0.5, 0.25])
    planes = HalfSpaces.from_planes(normals, normals @ far + size)
    kernel = voxkernel.exact_kernel(planes)
    assert kernel.dimension == 3
    assert kernel.clearance == pytest.approx(size, rel=0.1)
    known = ConvexHull(HalfspaceIntersection(np.column_stack([u, -np.ones(200)]), np.zeros(3)).intersections).volume
    assert kernel.volume == pytest.approx(known * size**3, rel=1e-5)


def test_half_spaces_and_mesh_agree():
    surface = shapes.spiky()
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh(surface))
    one, two = voxkernel.exact_kernel(surface), voxkernel.exact_kernel(planes)
    assert (one.vertices == two.vertices).all()
    assert one.volume == two.volume


def test_polygons_keep_one_plane_each():
    vertices, polygons = shapes.truncated_octahedron()
    mesh = voxkernel.TriangleMesh.from_polygons(vertices, polygons)
    kernel = voxkernel.exact_kernel(mesh)
    assert sorted(kernel.face_facets.tolist()) == list(range(len(polygons)))
    score = voxkernel.starshapeness(mesh)
    assert score.ratio == 1.0


@pytest.mark.parametrize("seed", range(4))
def test_degenerate_dual_hulls_stay_whole(seed):
    """A smooth regular face: many dual points nearly coplanar, triangles of the hull without area."""
    from voxkernel.demo_shapes import face
    from voxkernel.exact.dual_hull import polyhedron_around, relevant_rows
    from voxkernel.exact.inner_point import inner_point

    mesh = face()
    rotation = Rotation.random(random_state=seed).as_matrix() if seed else np.eye(3)
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh((mesh.vertices @ rotation.T, mesh.faces)))
    planes = planes.with_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, 9.0))
    inside = find_feasibility(planes)
    point = inner_point(planes, inside)
    solid = polyhedron_around(planes, point, relevant_rows(planes, point, inside.working_set))
    edges = len(solid.ring) // 2
    assert len(solid.vertices) - edges + len(solid.rows) == 2


@pytest.mark.parametrize("make", [shapes.cube, shapes.spiky, shapes.s_tetromino, shapes.torus])
def test_ids_have_64_bits_and_are_made_once(make):
    kernel = voxkernel.exact_kernel(make())
    for ids in (kernel.face_vertices, kernel.vertex_rows):
        assert ids.dtype == np.int64
        assert not ids.flags.writeable
    assert kernel.face_vertices is kernel.face_vertices
    assert kernel.vertex_rows is kernel.vertex_rows
    assert kernel.vertex_rows.shape == ((len(kernel.vertices) if kernel.dimension == 3 else 0), 3)


def torus_around_a_point():
    """Two octahedra, edges halved and corners on spheres, cut open along two edges and joined crosswise there."""
    vertices, faces = shapes.subdivided(*shapes.octahedron())
    vertices = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    slits = np.array([[1, 1, 0], [-1, -1, 0]]) / np.sqrt(2)
    is_end = (np.abs(vertices).max(axis=1) == 1) & (vertices[:, 2] == 0)
    on_slit = (np.abs(vertices[:, None] - slits).max(axis=2) < 1e-9).any(axis=1)
    is_below = vertices[faces].sum(axis=1)[:, 2] < 0
    sheets = [np.where((on_slit[faces] & is_below[:, None]) != sheet, len(vertices), 0) for sheet in (False, True)]
    return np.concatenate([vertices, 1.1 * vertices]), np.concatenate([faces + ~is_end[faces] * s for s in sheets])


def test_counts_of_vertices_edges_and_faces_decide_nothing():
    """A torus goes round a point twice, through itself, and every facet of it faces that point."""
    surface = torus_around_a_point()
    facts = voxkernel.as_mesh(surface).facts()
    assert (facts.genus, facts.n_components, facts.is_closed) == (1, 1, True)
    kernel, truth = voxkernel.exact_kernel(surface), oracle.mesh_kernel(*surface)
    assert kernel.dimension == truth.dimension == 3
    assert kernel.certificate.verify()
    assert set(kernel.exact_vertices()) == set(truth.vertices)
    assert kernel.volume == pytest.approx(float(truth.volume), rel=1e-12)
    assert kernel.volume > 2.9


def test_result_is_frozen_and_plain():
    kernel = voxkernel.exact_kernel(shapes.cube())
    with pytest.raises(dataclasses.FrozenInstanceError):
        kernel.volume = 2
    with pytest.raises(ValueError, match="read-only"):
        kernel.vertices[0] = 0
    assert "dimension=3" in repr(kernel)
    assert kernel.to_dict()["certificate"]["kind"] == "solid"
    empty = voxkernel.exact_kernel(shapes.torus()).to_dict()
    assert empty["centroid"] is None
    assert empty["clearance"] is None
    with pytest.raises(voxkernel.VoxKernelError, match="must have faces to become a mesh"):
        voxkernel.exact_kernel(shapes.torus()).to_mesh()


@pytest.mark.parametrize("turn", [np.eye(3), np.array([[2, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 4.0])
def test_flat_sides_are_merged_first(turn):
    """A cube of 12,288 facets in six planes, and with a corner cut off: faces are named by their first facets."""
    vertices, faces = shapes.cube()
    for _ in range(5):
        vertices, faces = shapes.subdivided(vertices, faces)
    low = vertices.min(axis=0)
    points = (vertices - low) @ turn.T  # multiples of 1/128, turned: every side is exactly a plane
    kernel = voxkernel.exact_kernel((points, faces))
    size = abs(np.linalg.det(turn)) * np.prod(vertices.max(axis=0) - low)
    assert (len(kernel.vertices), len(kernel.face_facets)) == (8, 6)
    assert kernel.volume == pytest.approx(size, rel=1e-12)
    assert kernel.certificate.verify()
    assert len(kernel.certificate.halfspaces) == len(faces)
    groups = kernel.certificate.halfspaces.coplanar_groups()
    assert sorted(kernel.face_facets.tolist()) == np.unique(groups).tolist()
