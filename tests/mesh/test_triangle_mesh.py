import dataclasses
from fractions import Fraction

import numpy as np
import pytest
import shapes
from hypothesis import assume, given
from hypothesis import strategies as st
from tables import read_rows

from voxkernel.errors import MeshError
from voxkernel.mesh import TriangleMesh, as_mesh
from voxkernel.mesh.polygons import triangle_areas
from voxkernel.mesh.zero_area import exact_integers, has_area, is_degenerate

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def triangles(pair):
    return TriangleMesh.from_triangles(*pair)


def signed_area(mesh, facet, direction):
    """Area of a facet's triangles along a direction; negative triangles count negative."""
    corners = mesh.vertices[mesh.faces[mesh.facet_ids == facet]]
    return 0.5 * (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ direction)


# ---------------------------------------------------------------- construction


def test_from_triangles_keeps_the_input():
    vertices, faces = shapes.cube()
    mesh = TriangleMesh.from_triangles(vertices, faces.astype(np.uint16), source="a cube")
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)
    np.testing.assert_array_equal(mesh.plane_corners, faces)
    np.testing.assert_array_equal(mesh.facet_ids, np.arange(len(faces)))
    np.testing.assert_array_equal(mesh.plane_facets, np.arange(len(faces)))
    np.testing.assert_allclose(mesh.plane_areas, 0.5)
    assert mesh.n_input_facets == mesh.n_facets == 12
    assert repr(mesh) == "TriangleMesh(8 vertices, 12 faces, 12 facets, source='a cube')"


def test_arrays_are_frozen_copies():
    vertices, faces = shapes.cube()
    mesh = TriangleMesh.from_triangles(vertices, faces)
    vertices[:], faces[:] = 7.0, 0  # still writeable, and not shared
    assert mesh.vertices.max() == 1.0
    for name in ("vertices", "faces", "facet_ids", "plane_corners", "plane_facets", "plane_areas"):
        assert not getattr(mesh, name).flags.writeable, name
    with pytest.raises(dataclasses.FrozenInstanceError):
        mesh.vertices = None
    assert mesh.plane_areas is mesh.plane_areas
    assert mesh.facts() is mesh.facts()


@pytest.mark.parametrize(
    ("vertices", "faces", "kind", "text"),
    [
        (SQUARE, [[0, 1, 4]], MeshError, r"`faces` must be in 0\.\.3; got 4"),
        (SQUARE, [[0, 1, -1]], MeshError, r"`faces` must be in 0\.\.3; got -1"),
        (SQUARE, [[0, 1, 2, 3]], MeshError, r"`faces` must have shape \(m, 3\); got \(1, 4\)"),
        (SQUARE, [0, 1, 2], MeshError, r"`faces` must have shape \(m, 3\); got \(3,\)"),
        (SQUARE, [[0.0, 1.0, 2.0]], TypeError, "`faces` must be an array of integers"),
        (SQUARE, np.zeros((0, 3), int), MeshError, "`faces` must hold at least one triangle; got 0"),
        (SQUARE, [], MeshError, "at least one triangle"),
        (SQUARE, [[0, 1, 1], [2, 2, 2]], MeshError, "positive area; got 2 without"),
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], MeshError, r"`vertices` must have shape \(n, 3\)"),
        ([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], [[0, 1, 2]], MeshError, "finite; got nan in row 1"),
        ([[0, 0, 0], [np.inf, 0, 0], [0, 1, 0]], [[0, 1, 2]], MeshError, "finite; got inf in row 1"),
        ([], [[0, 1, 2]], MeshError, "`faces` must be in"),
        (["a"], [[0, 1, 2]], TypeError, "`vertices` must be an array of real numbers"),
    ],
)
def test_from_triangles_refuses(vertices, faces, kind, text):
    with pytest.raises(kind, match=text) as info:
        TriangleMesh.from_triangles(vertices, faces)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize(
    ("polygons", "kind", "text"),
    [
        ([[0, 1, 2], [0, 1]], MeshError, "at least 3 corners each; got 2 in polygon 1"),
        ([[0, 1, 2, 9]], MeshError, r"`polygons` must be in 0\.\.3; got 9"),
        ([], MeshError, "at least one polygon; got 0"),
        ([[0, 1, 2.5, 3]], TypeError, "array of integers"),
        ([0, 1, 2], TypeError, "got a flat sequence"),
        (7, TypeError, "sequence of index sequences"),
        (np.zeros((2, 4)), TypeError, "array of integers"),
        ([[0, 0, 1, 1]], MeshError, "positive area; got 1 without"),
    ],
)
def test_from_polygons_refuses(polygons, kind, text):
    with pytest.raises(kind, match=text):
        TriangleMesh.from_polygons(SQUARE, polygons)


def test_from_polygons_refuses_a_bad_tolerance():
    with pytest.raises(ValueError, match="`planarity_rtol` must be >= 0"):
        TriangleMesh.from_polygons(SQUARE, [[0, 1, 2, 3]], planarity_rtol=-1.0)


def test_polygons_that_are_triangles_make_the_same_mesh():
    vertices, faces = shapes.cube()
    mesh = TriangleMesh.from_polygons(vertices, faces.tolist())
    np.testing.assert_array_equal(mesh.faces, faces)
    np.testing.assert_array_equal(mesh.plane_corners, faces)


@pytest.mark.parametrize("shape", [shapes.truncated_octahedron, shapes.notched_cube_polygons])
def test_polygonal_solids(shape):
    vertices, polygons = shape()
    mesh = TriangleMesh.from_polygons(vertices, polygons)
    assert mesh.n_facets == mesh.n_input_facets == len(polygons) == len(mesh.plane_corners)
    assert len(mesh.nonplanar_facets) == 0
    assert len(mesh.faces) == sum(len(polygon) - 2 for polygon in polygons)
    facts = mesh.facts()
    assert facts.is_closed
    assert facts.is_oriented
    assert facts.is_outward
    assert len(facts.degenerate_facets) == 0
    sums = np.bincount(mesh.facet_ids, weights=triangle_areas(mesh.vertices, mesh.faces))
    np.testing.assert_allclose(mesh.plane_areas, sums)
    for row, facet in zip(mesh.plane_corners, mesh.plane_facets, strict=True):
        assert set(row.tolist()) <= set(polygons[facet])
        p, q, r = mesh.vertices[row]
        normal = np.cross(q - p, r - p)
        normal /= np.linalg.norm(normal)
        assert signed_area(mesh, facet, normal).min() > 0.0
        np.testing.assert_allclose(signed_area(mesh, facet, normal).sum(), sums[facet])


CONCAVE = {
    "arrow": [(0, 0), (4, 0), (1, 1), (0, 4)],
    "arrow from its notch": [(1, 1), (0, 4), (0, 0), (4, 0)],
    "comb": [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (5, 1), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (0, 3)],
    "flat corners": [(0, 0), (1, 0), (2, 0), (4, 0), (4, 2), (4, 4), (2, 4), (0, 4), (0, 2)],
    "concave with flat corners": [(0, 0), (2, 0), (4, 0), (4, 4), (3, 4), (2, 4), (2, 2), (0, 2), (0, 1)],
    "five-fold star": [
        (np.cos(a) * r, np.sin(a) * r)
        for a, r in zip(np.pi / 5 * np.arange(10), [2.0, 0.6] * 5, strict=True)
    ],
    "hook": [(0, 0), (6, 0), (6, 6), (1, 6), (1, 3), (3, 3), (3, 4), (2, 4), (2, 5), (5, 5), (5, 1), (0, 1)],
}


@pytest.mark.parametrize("name", CONCAVE)
@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("turned", [False, True])
def test_concave_polygons(name, backward, turned, rng):
    outline = np.array(CONCAVE[name], dtype=float)
    x, y = outline.T
    area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    rotation = shapes.random_rotation(rng) if turned else np.eye(3)
    points = np.c_[outline, np.zeros(len(outline))] @ rotation.T + (rng.normal(size=3) if turned else 0.0)
    order = np.arange(len(points))
    if backward:
        order, area = order[::-1], -area
    normal, area = rotation[:, 2] * np.sign(area), abs(area)
    mesh = TriangleMesh.from_polygons(points, [order])
    assert mesh.faces.shape == (len(order) - 2, 3)
    assert set(mesh.faces.reshape(-1).tolist()) == set(order.tolist())
    parts = signed_area(mesh, 0, normal)
    assert parts.min() > -1e-12 * area
    np.testing.assert_allclose(parts.sum(), area)
    assert len(mesh.plane_corners) == 1
    p, q, r = mesh.vertices[mesh.plane_corners[0]]
    assert np.cross(q - p, r - p) @ normal > 0.1 * area
    facts = mesh.facts()  # no seam is left open: the border is exactly the polygon
    assert facts.n_boundary_edges == len(order)
    assert facts.n_nonmanifold_edges == 0


@given(st.integers(0, 2**32 - 1), st.integers(4, 12))
def test_star_shaped_polygons_keep_their_area(seed, n):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    radius = rng.uniform(0.3, 1.0, n)
    outline = np.c_[radius * np.cos(angle), radius * np.sin(angle), 0 * angle]
    x, y = outline[:, 0], outline[:, 1]
    area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    mesh = TriangleMesh.from_polygons(outline, [list(range(n))])
    assert abs(mesh.plane_areas[0] - abs(area)) <= 1e-12
    parts = signed_area(mesh, 0, np.array([0, 0, np.sign(area)]))
    assert parts.sum() == pytest.approx(abs(area))
    assume(np.diff(angle).max() < np.pi and angle[0] + 2 * np.pi - angle[-1] < np.pi)  # then it is simple
    assert parts.min() >= 0.0


def test_plane_corners_are_well_spread():
    """Sixty corners, three of them nearly on a line at the start: the plane does not come from those."""
    angle = 2 * np.pi * np.arange(60) / 60
    ring = np.c_[np.cos(angle), np.sin(angle), np.zeros(60)]
    mesh = TriangleMesh.from_polygons(ring, [np.arange(60)])
    p, q, r = ring[mesh.plane_corners[0]]
    assert np.cross(q - p, r - p)[2] > 1.9  # a right-angled triangle on the diameter has 2


def test_nonplanar_polygons_are_cut_and_reported():
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0.25], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    polygons = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4)]
    mesh = TriangleMesh.from_polygons(vertices, polygons)
    assert mesh.nonplanar_facets.tolist() == [0]
    assert mesh.facts().nonplanar_facets.tolist() == [0]
    assert mesh.plane_facets.tolist() == [0, 0, 1, 2]
    assert mesh.facet_ids.tolist() == [0, 0, 1, 1, 2, 2]
    np.testing.assert_array_equal(mesh.plane_corners[:2], mesh.faces[:2])
    np.testing.assert_allclose(mesh.plane_areas[:2], triangle_areas(mesh.vertices, mesh.faces[:2]))
    loose = TriangleMesh.from_polygons(vertices, polygons, planarity_rtol=0.5)
    assert len(loose.nonplanar_facets) == 0
    assert len(loose.plane_corners) == 3


def test_planarity_is_relative_to_the_polygon():
    flat = np.array(SQUARE, dtype=float)
    for size in (1e-6, 1.0, 1e9):
        bent = size * (flat + np.outer([0, 0, 1, 0], [0, 0, 1e-6]))
        assert len(TriangleMesh.from_polygons(bent, [range(4)]).nonplanar_facets) == 1
        assert len(TriangleMesh.from_polygons(bent, [range(4)], planarity_rtol=1e-5).nonplanar_facets) == 0


def test_mixed_sizes_keep_their_order():
    vertices, polygons = shapes.truncated_octahedron()
    order = np.random.default_rng(3).permutation(len(polygons))
    mesh = TriangleMesh.from_polygons(vertices, [polygons[k] for k in order])
    for facet, k in enumerate(order):
        assert set(mesh.faces[mesh.facet_ids == facet].reshape(-1).tolist()) == set(polygons[k])


def test_collinear_and_crossing_polygons_do_not_fail():
    line = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [0, 1, 0]]
    mesh = TriangleMesh.from_polygons(line, [[0, 1, 2, 3], [0, 1, 4]])
    assert mesh.facts().degenerate_facets.tolist() == [0]
    bow_tie = TriangleMesh.from_polygons([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    assert bow_tie.nonplanar_facets.tolist() == [0]  # its two halves face opposite ways
    assert len(bow_tie.plane_corners) == 2


# ---------------------------------------------------------------- restriction


def test_restricted():
    vertices, polygons = shapes.truncated_octahedron()
    mesh = TriangleMesh.from_polygons(vertices, polygons)
    part = mesh.restricted([5, 2, 5])
    assert np.unique(part.facet_ids).tolist() == [2, 5]
    assert part.plane_facets.tolist() == [2, 5]
    assert part.n_facets == 2
    assert part.n_input_facets == len(polygons)
    assert part.vertices is mesh.vertices
    np.testing.assert_array_equal(part.plane_areas, mesh.plane_areas[[2, 5]])
    mask = np.zeros(len(polygons), dtype=bool)
    mask[[2, 3]] = True
    again = part.restricted(mask)
    assert np.unique(again.facet_ids).tolist() == [2]
    with pytest.raises(MeshError, match="`facets` must be facets of this mesh; got 3"):
        part.restricted([2, 3])
    with pytest.raises(MeshError, match=r"`facets` must be in 0\.\.13; got 14"):
        mesh.restricted([14])
    with pytest.raises(MeshError, match="positive area; got 0 ids"):
        mesh.restricted([])
    with pytest.raises(MeshError, match="as a mask must have shape"):
        mesh.restricted([True])


def test_restricted_keeps_nonplanar_facets():
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0.25], [0, 1, 0], [0, 0, 1], [1, 0, 1]]
    mesh = TriangleMesh.from_polygons(vertices, [(0, 1, 2, 3), (0, 1, 5, 4)])
    assert mesh.restricted([0]).nonplanar_facets.tolist() == [0]
    assert mesh.restricted([1]).nonplanar_facets.tolist() == []


def test_restricted_to_degenerate_facets_is_refused():
    mesh = TriangleMesh.from_triangles([*SQUARE, [2, 0, 0]], [[0, 1, 2], [0, 1, 4]])
    with pytest.raises(MeshError, match="positive area"):
        mesh.restricted([1])


# ---------------------------------------------------------------- exactly zero area


def test_zero_area_against_fractions():
    rng = np.random.default_rng(1)
    points = rng.integers(-3, 4, (60, 3)).astype(float)
    direction, start = rng.normal(size=3), rng.normal(size=3)
    near = start + rng.normal(size=(60, 1)) * direction  # collinear up to rounding
    extreme = rng.choice([0.0, 1.0, 3.0, 5e-324, 1e-200, 1e200, 1.7e308], (60, 3))
    for cloud in (points, near, points * 1e-160, points * 3e150, extreme, points / 7.0):
        faces = rng.integers(0, 60, (400, 3))
        expected = []
        for a, b, c in faces:
            p, q, r = ([Fraction(x) for x in cloud[k].tolist()] for k in (a, b, c))
            u, v = [y - x for x, y in zip(p, q, strict=True)], [y - x for x, y in zip(p, r, strict=True)]
            expected.append(all(u[i] * v[i - 1] == u[i - 1] * v[i] for i in range(3)))
        np.testing.assert_array_equal(is_degenerate(cloud, faces), expected)
        assert has_area(cloud, faces) == (not all(expected))


def test_a_triangle_too_thin_for_floats_has_area():
    vertices = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, np.nextafter(3, 4)]])
    mesh = TriangleMesh.from_triangles(vertices, [[0, 1, 2]])
    assert len(mesh.facts().degenerate_facets) == 0
    tiny = TriangleMesh.from_triangles(np.array(SQUARE) * 1e-200, [[0, 1, 2]])
    assert tiny.plane_areas[0] == 0.0  # underflow, and yet not degenerate
    assert len(tiny.facts().degenerate_facets) == 0


def test_exact_integers():
    values = np.array([0.0, 1.0, -2.5, 0.1, 5e-324, -1e300])
    integers = exact_integers(values)
    scale = Fraction(0.1) / integers[3]
    assert [k * scale for k in integers] == [Fraction(x) for x in values.tolist()]


# ---------------------------------------------------------------- facts


CLOSED = {
    "cube": (shapes.cube, 1.0, 6.0, 0, 1),
    "tetrahedron": (shapes.tetrahedron, 1 / 6, 1.5 + np.sqrt(3) / 2, 0, 1),
    "l_prism": (shapes.l_prism, 3.0, 14.0, 0, 1),
    "two_boxes": (shapes.two_boxes, None, None, None, 2),
    "torus": (shapes.torus, None, None, 1, 1),
    "icosphere": (shapes.icosphere, None, None, 0, 1),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_solids(name):
    make, volume, area, genus, parts = CLOSED[name]
    mesh = triangles(make())
    facts = mesh.facts()
    assert facts.is_closed
    assert facts.is_oriented
    assert facts.is_outward is True
    assert len(facts.boundary_loops) == 0
    assert facts.n_boundary_edges == facts.n_nonmanifold_edges == facts.n_duplicate_facets == 0
    assert facts.genus == genus
    assert facts.n_components == parts
    assert facts.euler_characteristic == 2 * parts - 2 * (genus or 0)
    if volume is not None:
        assert facts.volume == pytest.approx(volume)
        assert facts.area == pytest.approx(area)
    assert "\n" not in repr(facts)


def test_far_from_the_origin_nothing_is_lost():
    vertices, faces = shapes.cube()
    shift = np.array([2.0**30, -(2.0**31), 2.0**29])
    facts = TriangleMesh.from_triangles(vertices + shift, faces).facts()
    assert facts.volume == 1.0
    assert facts.area == 6.0
    np.testing.assert_array_equal(facts.area_centroid, shift + 0.5)
    np.testing.assert_array_equal(facts.bbox, [shift, shift + 1])
    assert facts.diagonal == pytest.approx(np.sqrt(3))


@pytest.mark.parametrize("size", [2.0**-300, 2.0**-340, 2.0**340, 2.0**500])
def test_tiny_and_huge_surfaces(size):
    vertices, polygons = shapes.truncated_octahedron()
    small = TriangleMesh.from_polygons(vertices, polygons)
    mesh = TriangleMesh.from_polygons(vertices * size, polygons)
    np.testing.assert_array_equal(mesh.plane_corners, small.plane_corners)
    np.testing.assert_array_equal(mesh.faces, small.faces)
    np.testing.assert_array_equal(mesh.plane_areas, small.plane_areas * size * size)
    facts = mesh.facts()
    assert facts.area == small.facts().area * size * size
    assert facts.diagonal == small.facts().diagonal * size
    assert facts.is_outward
    np.testing.assert_array_equal(facts.area_centroid, small.facts().area_centroid * size)


def test_sizes_that_floats_cannot_square():
    vertices, faces = shapes.cube()
    mesh = TriangleMesh.from_triangles((vertices - 0.5) * 1.7e308, faces)
    facts = mesh.facts()
    assert facts.is_outward
    assert facts.area == facts.volume == np.inf
    assert len(facts.degenerate_facets) == 0
    np.testing.assert_allclose(facts.area_centroid / 1.7e308, 0.0, atol=1e-15)


def test_open_surfaces():
    facts = triangles(shapes.open_box()).facts()
    assert not facts.is_closed
    assert facts.is_oriented
    assert facts.is_outward is None
    assert facts.genus is None
    assert np.isnan(facts.volume)
    assert len(facts.boundary_loops) == 1
    (loop,) = facts.boundary_loops
    assert facts.n_boundary_edges == len(loop) == 4
    faces = {tuple(np.roll(face, -k)[:2]) for face in shapes.open_box()[1] for k in range(3)}
    assert all((a, b) in faces for a, b in zip(loop, np.roll(loop, -1), strict=True))


def test_boundary_loops_are_simple_at_a_pinch():
    """Two triangles that share only a corner: two loops of three edges."""
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
    facts = TriangleMesh.from_triangles(vertices, [[0, 1, 2], [0, 3, 4]]).facts()
    assert sorted(map(len, facts.boundary_loops)) == [3, 3]
    assert facts.n_components == 1


def test_boundary_loops_of_an_unoriented_surface():
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    facts = TriangleMesh.from_triangles(vertices, [[0, 1, 2], [0, 3, 2]]).facts()
    assert not facts.is_oriented
    assert [sorted(loop.tolist()) for loop in facts.boundary_loops] == [[0, 1, 2, 3]]


def test_every_boundary_edge_is_in_one_loop(rng):
    vertices, faces = shapes.icosphere(2)
    faces = faces[rng.random(len(faces)) < 0.6]
    facts = TriangleMesh.from_triangles(vertices, faces).facts()
    edges = [
        tuple(sorted(edge))
        for loop in facts.boundary_loops
        for edge in zip(loop, np.roll(loop, -1), strict=True)
    ]
    assert len(edges) == len(set(edges)) == facts.n_boundary_edges
    for loop in facts.boundary_loops:
        assert len(set(loop.tolist())) == len(loop)


def test_orientation():
    assert triangles(shapes.inside_out_cube()).facts().is_outward is False
    flipped = triangles(shapes.cube_with_flipped_face()).facts()
    assert flipped.is_closed
    assert not flipped.is_oriented
    assert flipped.is_outward is None
    assert np.isnan(flipped.volume)
    moebius = triangles(shapes.moebius_band()).facts()
    assert not moebius.is_oriented
    assert len(moebius.boundary_loops) == 1
    inner, faces = shapes.cube()
    hollow = shapes.joined((inner * 3, faces), (inner + 1, faces[:, ::-1]))
    facts = triangles(hollow).facts()
    assert facts.is_outward is False  # the cavity faces inward
    assert facts.volume == pytest.approx(26.0)


def test_is_outward_is_decided_exactly():
    """A sheet with two sides has volume exactly 0; one ulp of thickness makes it a solid."""
    vertices = np.array([[0.1, 0.2, 0.3], [1.1, 0.7, 0.9], [0.4, 1.3, 0.8], [0.5, 0.7, 0.6]])
    sheet = np.array([[0, 1, 2], [0, 2, 1]])
    assert TriangleMesh.from_triangles(vertices, sheet).facts().is_outward is False
    solid = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    cross = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    on = vertices[0] + ((vertices[1] - vertices[0]) + (vertices[2] - vertices[0])) / 4
    for lift in (-1e-15, 1e-15):
        vertices[3] = on + lift * cross
        p, q, r, s = ([Fraction(x) for x in row] for row in vertices.tolist())
        u, v, w = ([b - a for a, b in zip(p, other, strict=True)] for other in (q, r, s))
        exact = sum(
            u[i] * (v[(i + 1) % 3] * w[(i + 2) % 3] - v[(i + 2) % 3] * w[(i + 1) % 3]) for i in range(3)
        )
        facts = TriangleMesh.from_triangles(vertices, solid).facts()
        assert facts.is_outward is (exact > 0)


def test_nonmanifold_edges_and_vertices():
    facts = triangles(shapes.cubes_sharing_an_edge()).facts()
    assert facts.n_nonmanifold_edges == 1
    assert facts.n_boundary_edges == 0
    assert not facts.is_closed
    fins = triangles(shapes.three_faces_on_an_edge()).facts()
    assert fins.n_nonmanifold_edges == 1
    vertices, faces = shapes.tetrahedron()
    apex = vertices[faces[0, 0]]
    mirrored = 2 * apex - vertices
    other = faces[:, ::-1] + len(vertices)
    other[other == faces[0, 0] + len(vertices)] = faces[0, 0]
    pinched = TriangleMesh.from_triangles(np.r_[vertices, mirrored], np.r_[faces, other]).facts()
    assert pinched.is_closed
    assert pinched.is_outward is True
    assert pinched.n_components == 1
    assert pinched.euler_characteristic == 3
    assert pinched.genus is None
    assert pinched.n_unreferenced_vertices == 1


def test_degenerate_and_duplicate_facets():
    vertices = [*SQUARE, [2, 0, 0], [9, 9, 9]]
    faces = [[0, 1, 2], [0, 1, 4], [2, 0, 1], [2, 1, 0], [3, 3, 0], [0, 2, 3]]
    facts = TriangleMesh.from_triangles(vertices, faces).facts()
    assert facts.degenerate_facets.tolist() == [1, 4]
    assert facts.n_duplicate_facets == 2
    assert facts.n_unreferenced_vertices == 1
    assert facts.n_facets == 6
    polygons = [(0, 1, 2, 3), (1, 2, 3, 0), (0, 1, 2), (2, 1, 0)]
    assert TriangleMesh.from_polygons(SQUARE, polygons).facts().n_duplicate_facets == 2


def test_collapsed_triangles_do_not_open_a_surface():
    vertices, faces = shapes.cube()
    a, b = faces[0, :2]
    facts = TriangleMesh.from_triangles(vertices, [*faces, [a, b, b]]).facts()
    assert facts.is_closed
    assert facts.euler_characteristic == 2
    assert facts.degenerate_facets.tolist() == [12]


# ---------------------------------------------------------------- conversions


def test_conversions():
    mesh = triangles(shapes.l_prism())
    vertices, faces = mesh.to_arrays()
    vertices[0], faces[0] = 5.0, 0
    assert mesh.vertices[0].max() < 5.0
    for other in (mesh.to_open3d(), mesh.to_polydata()):
        back = as_mesh(other)
        np.testing.assert_array_equal(back.vertices, mesh.vertices)
        np.testing.assert_array_equal(back.faces, mesh.faces)


@pytest.mark.parametrize("suffix", [".ply", ".off", ".obj"])
def test_write_keeps_every_bit(tmp_path, rng, suffix):
    scale = 10.0 ** rng.uniform(-300, 300, (50, 3))
    vertices = np.vstack([rng.normal(size=(50, 3)) * scale, [[5e-324, -0.0, 1 / 3]]])
    mesh = TriangleMesh.from_triangles(vertices, rng.integers(0, 51, (80, 3)))
    path = tmp_path / f"body{suffix}"
    mesh.write(path)
    back = as_mesh(path)
    assert back.vertices.tobytes() == mesh.vertices.tobytes()
    np.testing.assert_array_equal(back.faces, mesh.faces)
    assert back.source == str(path)


def test_write_stl_and_unknown_suffix(tmp_path):
    mesh = triangles(shapes.l_prism())
    mesh.write(tmp_path / "body.stl")
    back = as_mesh(str(tmp_path / "body.stl"))
    assert back.facts().is_closed
    assert back.facts().volume == pytest.approx(mesh.facts().volume)
    with pytest.raises(ValueError, match=r"`path` must end in one of \.glb \.obj \.off \.ply \.stl \.vtp; got"):
        mesh.write(tmp_path / "body.xyz")
    big = TriangleMesh.from_triangles(np.array(SQUARE) * 1e39, [[0, 1, 2]])
    with pytest.raises(ValueError, match="must fit in float32"):
        big.write(tmp_path / "big.stl")


# ---------------------------------------------------------------- real data


# Counted otherwise in manifest.csv; each entry is proven below.
COLLAPSED = "open/ir_leeperrysmith_head.ply"
PINCHED = "faces/real_leeperrysmith_face.ply"


def test_facts_agree_with_the_manifest(data_dir):
    for row in read_rows(data_dir / "manifest.csv"):
        facts = as_mesh(data_dir / row["file"]).facts()
        got = {
            "vertices": facts.n_vertices,
            "faces": facts.n_faces,
            "degenerate_faces": len(facts.degenerate_facets),
            "boundary_loops": len(facts.boundary_loops),
            "nonmanifold_edges": facts.n_nonmanifold_edges,
            "bodies": facts.n_components,
            "euler": facts.euler_characteristic,
        }
        expected = {name: int(row[name]) for name in got}
        if row["file"] == COLLAPSED:
            assert (got.pop("nonmanifold_edges"), got.pop("euler")) == (4, 4)
            assert (expected.pop("nonmanifold_edges"), expected.pop("euler")) == (10, 7)
        if row["file"] == PINCHED:
            assert (got.pop("boundary_loops"), expected.pop("boundary_loops")) == (9, 8)
        assert got == expected, row["file"]
        assert facts.is_closed == (row["watertight"] == "True") == (row["topology"] == "closed")
        assert facts.is_oriented
        assert row["orientation"] == "ok"
        assert facts.is_outward is (True if facts.is_closed else None)
        assert facts.diagonal == pytest.approx(float(row["diag"]), rel=1e-5)
        if facts.is_closed:
            assert facts.volume == pytest.approx(float(row["mesh_volume"]), rel=1e-8)


def test_manifest_counts_the_edges_of_collapsed_triangles(data_dir):
    """Six triangles of this head name a vertex twice; counting their edges gives the manifest's numbers."""
    faces = as_mesh(data_dir / COLLAPSED).faces
    collapsed = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    assert collapsed.sum() == 6
    for some, numbers in ((faces, (10, 7)), (faces[~collapsed], (4, 4))):
        edges = np.sort(np.stack([some, np.roll(some, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        unique, n_faces = np.unique(edges, axis=0, return_counts=True)
        euler = len(np.unique(some)) - len(unique) + len(some)
        assert (int((n_faces > 2).sum()), euler) == numbers


def test_manifest_counts_two_loops_that_touch_as_one(data_dir):
    """One boundary vertex of this face has four boundary edges: two simple loops touch there."""
    loops = as_mesh(data_dir / PINCHED).facts().boundary_loops
    times = np.unique(np.concatenate(loops), return_counts=True)[1]
    assert len(loops) == 9
    assert sorted(times)[-2:] == [1, 2]


def test_polyhedral_cells(data_dir):
    for row in read_rows(data_dir / "polyhedral" / "cells.csv"):
        mesh = as_mesh(data_dir / row["file"])
        facts = mesh.facts()
        assert (facts.n_vertices, facts.n_facets) == (int(row["vertices"]), int(row["faces"]))
        assert len(mesh.plane_corners) == facts.n_facets
        assert len(facts.nonplanar_facets) == len(facts.degenerate_facets) == 0
        assert facts.is_closed
        assert facts.is_outward is (row["orientation"] == "outward")
        assert facts.volume == pytest.approx(float(row["volume"]), abs=1e-12)


def test_asteroids(data_dir):
    for row in read_rows(data_dir / "asteroids" / "manifest.csv"):
        facts = as_mesh(data_dir / "asteroids" / row["file"]).facts()
        assert (facts.n_vertices, facts.n_faces) == (int(row["vertices"]), int(row["faces"]))
        assert facts.is_closed
        assert facts.is_outward
        assert facts.genus == 0
        assert facts.volume == pytest.approx(float(row["mesh_volume"]), rel=1e-12)


def test_smooth_faces_are_read(data_dir):
    for path in sorted((data_dir / "faces_smooth").glob("*.ply")):
        facts = as_mesh(path).facts()
        assert facts.is_oriented
        assert not facts.is_closed
