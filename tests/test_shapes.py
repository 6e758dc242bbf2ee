"""The shapes are what their names say; their kernels are checked in test_oracle.py."""

from collections import Counter
from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import given, settings


def _edges(faces):
    return Counter((int(face[i]), int(face[i - 2])) for face in faces for i in range(3))


def _is_closed_and_oriented(faces):
    edges = _edges(faces)
    return all(n == edges[b, a] for (a, b), n in edges.items())


def _is_manifold(faces):
    return max(_edges(faces).values()) == 1


VOLUMES = {
    "cube": (shapes.cube, 1),
    "tetrahedron": (shapes.tetrahedron, Fraction(1, 6)),
    "octahedron": (shapes.octahedron, Fraction(4, 3)),
    "l_prism": (shapes.l_prism, 3),
    "star_prism": (shapes.star_prism, 12),
    "plus_cross": (shapes.plus_cross, 7),
    "s_tetromino": (shapes.s_tetromino, 4),
    "s_tetromino_open": (lambda: shapes.s_tetromino(0.25), Fraction(17, 4)),
    "saw_prism": (shapes.saw_prism, 4),
    "notched_cube": (shapes.notched_cube, 6),
    "notched_cube_open": (lambda: shapes.notched_cube(0.5), Fraction(55, 8)),
    "two_boxes": (shapes.two_boxes, 2),
    "crossing_boxes": (shapes.crossing_boxes, 9),
    "cubes_sharing_an_edge": (shapes.cubes_sharing_an_edge, 2),
    "inside_out_cube": (shapes.inside_out_cube, -1),
    "truncated_octahedron": (lambda: shapes.fan(*shapes.truncated_octahedron()), 32),
}


@pytest.mark.parametrize("name", VOLUMES)
def test_closed_solids_enclose_their_volume(name):
    make, volume = VOLUMES[name]
    vertices, faces = make()
    assert vertices.dtype == np.float64
    assert faces.dtype == np.int64
    assert vertices.flags.c_contiguous
    assert faces.flags.c_contiguous
    assert _is_closed_and_oriented(faces)
    assert _is_manifold(faces) == (name != "cubes_sharing_an_edge")
    assert set(np.unique(faces)) == set(range(len(vertices)))
    assert oracle.enclosed_volume(vertices, faces) == volume


@pytest.mark.parametrize(
    ("make", "euler"),
    [
        (shapes.icosphere, 2),
        (shapes.uv_sphere, 2),
        (shapes.ellipsoid, 2),
        (shapes.spiky, 2),
        (shapes.torus, 0),
    ],
)
def test_round_shapes_are_closed_and_outward(make, euler):
    vertices, faces = make()
    assert _is_closed_and_oriented(faces)
    assert _is_manifold(faces)
    assert len(vertices) - len(faces) // 2 == euler
    assert oracle.enclosed_volume(vertices, faces) > 0


@pytest.mark.parametrize("make", [shapes.icosphere, shapes.uv_sphere, shapes.spiky])
def test_radial_shapes_have_the_origin_inside_all_planes(make):
    assert oracle.is_inside(oracle.corner_planes(*make()), (0, 0, 0))


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
def test_icosphere_is_exactly_convex(subdivisions):
    vertices, faces = shapes.icosphere(subdivisions)
    assert len(faces) == 20 * 4**subdivisions
    planes = oracle.corner_planes(vertices, faces)
    exact = [oracle.point(v) for v in vertices]
    neighbour = {(int(f[i - 2]), int(f[i])): f for f in faces for i in range(3)}
    for plane, face in zip(planes, faces, strict=True):
        assert plane is not None
        for i in range(3):  # convex at every edge, so convex
            other = neighbour[int(face[i]), int(face[i - 2])]
            assert all(oracle.side(plane, exact[v]) <= 0 for v in other)


def test_sphere_volume():
    assert float(oracle.enclosed_volume(*shapes.icosphere(4))) == pytest.approx(4 * np.pi / 3, rel=5e-3)
    assert float(oracle.enclosed_volume(*shapes.ellipsoid((3, 2, 1), 4))) == pytest.approx(
        8 * np.pi, rel=5e-3
    )


@pytest.mark.parametrize(
    ("make", "n_loops_edges"),
    [(shapes.height_field, 32), (shapes.open_hemisphere, 16), (shapes.open_box, 4)],
)
def test_open_surfaces(make, n_loops_edges):
    vertices, faces = make()
    edges = _edges(faces)
    assert _is_manifold(faces)
    assert sum((b, a) not in edges for a, b in edges) == n_loops_edges
    assert set(np.unique(faces)) == set(range(len(vertices)))


def test_normals_of_open_surfaces_point_out():
    normals, _, _ = oracle.float_planes(*shapes.height_field())
    assert (normals[:, 2] > 0).all()
    vertices, faces = shapes.open_hemisphere()
    normals, offsets, _ = oracle.float_planes(vertices, faces)
    assert (normals[:, 2] > -1e-15).all()
    assert (offsets > 0.9).all()


def test_bad_surfaces_are_bad():
    edges = _edges(shapes.three_faces_on_an_edge()[1])
    assert edges[0, 1] == 3
    assert not _is_closed_and_oriented(shapes.cube_with_flipped_face()[1])
    faces = shapes.moebius_band()[1]
    undirected = Counter(tuple(sorted(edge)) for edge in _edges(faces).elements())
    assert sorted(Counter(undirected.values()).items()) == [(1, 24), (2, 24)]
    assert not _is_manifold(faces)  # an edge is run through twice in the same direction


def test_polygons_are_exactly_planar_and_closed():
    for vertices, polygons in (
        shapes.truncated_octahedron(),
        shapes.prism_polygons([(0, 0), (3, 0), (3, 1), (0, 2)]),
        shapes.notched_cube_polygons(0.25),
    ):
        edges = Counter((p[i - 1], p[i]) for p in polygons for i in range(len(p)))
        assert all(edges[b, a] == n == 1 for (a, b), n in edges.items())
        for polygon in polygons:
            points = vertices[list(polygon)]
            normal = sum(np.cross(points[i - 1], points[i]) for i in range(len(points)))
            assert (points @ normal == points[0] @ normal).all()


def test_triangulated_refuses_a_clockwise_polygon():
    assert len(shapes.triangulated([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])) == 4
    with pytest.raises(ValueError, match="counter-clockwise"):
        shapes.triangulated([(0, 0), (0, 1), (1, 1), (1, 0)])


def test_rewriting_a_surface_keeps_its_planes(rng):
    surface = shapes.l_prism()
    planes = set(oracle.tightest(oracle.corner_planes(*surface)))
    for other in (
        shapes.subdivided(*surface),
        shapes.with_split_facet(*surface, 3),
        shapes.shuffled(*surface, rng),
        shapes.subdivided(*shapes.subdivided(*surface)),
    ):
        assert _is_closed_and_oriented(other[1])
        assert set(oracle.tightest(oracle.corner_planes(*other))) == planes
        assert oracle.enclosed_volume(*other) == 3


def test_rotations(rng):
    turns = shapes.quarter_turns()
    assert len({turn.tobytes() for turn in turns}) == 24
    for turn in [*turns, shapes.random_rotation(rng)]:
        assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(turn) == pytest.approx(1)
    vertices = shapes.moved(np.array([(1.0, 2.0, 3.0)]), turns[0], (1, 0, 0))
    assert vertices.tolist() == [[2.0, 2.0, 3.0]]


def test_hull_of_flat_points_is_refused():
    assert shapes.hull_of([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]) is None
    corners = shapes.hull_of([*map(tuple, shapes.cube()[0].astype(int))])
    assert corners is not None
    assert oracle.enclosed_volume(*corners) == 1


@settings(max_examples=25)
@given(shapes.convex_meshes())
def test_convex_meshes_are_convex(surface):
    vertices, faces = surface
    planes = oracle.corner_planes(vertices, faces)
    assert None not in planes
    assert all(oracle.is_inside(planes, v) for v in vertices)
    assert _is_closed_and_oriented(faces)


@settings(max_examples=25)
@given(shapes.radial_meshes())
def test_radial_meshes_see_the_origin(surface):
    planes = oracle.corner_planes(*surface)
    assert all(p is not None and oracle.side(p, oracle.point((0, 0, 0))) < 0 for p in planes)
    assert _is_closed_and_oriented(surface[1])


@settings(max_examples=25)
@given(shapes.polygon_prisms())
def test_polygon_prisms_are_closed(surface):
    assert _is_closed_and_oriented(surface[1])
    assert _is_manifold(surface[1])
    assert oracle.enclosed_volume(*surface) > 0


@settings(max_examples=25)
@given(shapes.polycubes())
def test_polycubes_enclose_whole_cubes(surface):
    volume = oracle.enclosed_volume(*surface)
    assert _is_closed_and_oriented(surface[1])
    assert volume == int(volume)
    assert 1 <= volume <= 8


def test_soups_have_kernels_of_every_dimension():
    found = Counter()

    @settings(max_examples=150, derandomize=True)
    @given(shapes.integer_meshes())
    def count(surface):
        found[oracle.mesh_kernel(*surface).dimension] += 1

    count()
    assert set(found) == {-1, 0, 1, 2, 3}
