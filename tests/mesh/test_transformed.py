"""Arrays made of a mesh's vertices, and affine images of it, on shapes with known answers."""

import dataclasses

import numpy as np
import pytest
import shapes

from voxkernel.errors import MeshError
from voxkernel.mesh import TriangleMesh

MIRROR = np.diag([1.0, 1.0, -1.0])


def cube():
    return TriangleMesh.from_triangles(*shapes.cube())


def polygons():
    """Six squares and eight hexagons of edge sqrt(2): area 6 * 2 + 8 * 3 sqrt(3), volume 32."""
    return TriangleMesh.from_polygons(*shapes.truncated_octahedron())


# ---------------------------------------------------------------- derived arrays


def test_cube():
    mesh = cube()
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert mesh.volume == 1.0
    assert mesh.facet_areas.tolist() == [0.5] * 12
    outward = mesh.vertices[mesh.faces].mean(axis=1) - 0.5
    axis = np.abs(outward).argmax(axis=1)
    expected = np.zeros((12, 3))
    expected[np.arange(12), axis] = np.sign(outward[np.arange(12), axis])
    np.testing.assert_array_equal(mesh.facet_normals, expected)
    assert mesh.used_vertices is mesh.vertices


def test_rows_are_those_of_the_triangles_of_polygons():
    mesh = polygons()
    assert len(mesh.facet_areas) == len(mesh.facet_normals) == len(mesh.faces) == 6 * 2 + 8 * 4
    np.testing.assert_allclose(mesh.facet_areas.sum(), 12 + 24 * 3**0.5, rtol=1e-15)
    np.testing.assert_allclose(np.bincount(mesh.facet_ids, mesh.facet_areas), mesh.plane_areas, rtol=1e-15)
    assert mesh.volume == pytest.approx(32, rel=1e-15)


def test_vertices_that_are_not_used_count_nowhere():
    vertices, faces = shapes.cube()
    for stray in ([1e300, -1e300, 0], [1e-300, 1e250, 7]):
        mesh = TriangleMesh.from_triangles(np.concatenate([[stray], vertices]), faces + 1)
        assert np.array_equal(mesh.used_vertices, vertices)
        for name in ("bounds", "facet_areas", "facet_normals", "plane_areas"):
            assert np.array_equal(getattr(mesh, name), getattr(cube(), name)), name


@pytest.mark.parametrize("exponent", [-300, -30, 0, 400])
def test_normals_have_the_same_bits_at_every_size(exponent):
    vertices, faces = shapes.spiky(1)
    mesh, scaled = (TriangleMesh.from_triangles(v, faces) for v in (vertices, np.ldexp(vertices, exponent)))
    assert np.array_equal(mesh.facet_normals, scaled.facet_normals)
    np.testing.assert_allclose(np.linalg.norm(mesh.facet_normals, axis=1), 1.0, rtol=4e-16)
    assert np.array_equal(np.ldexp(mesh.facet_areas, 2 * exponent), scaled.facet_areas)


def test_a_triangle_without_area_has_no_normal():
    mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 3]])
    assert mesh.facet_normals.tolist() == [[0, 0, 0], [0, 0, 1]]
    assert mesh.facet_areas.tolist() == [0.0, 0.5]


def test_an_open_surface_has_no_volume():
    assert np.isnan(TriangleMesh.from_triangles(*shapes.open_box()).volume)
    assert TriangleMesh.from_triangles(*shapes.inside_out_cube()).volume == -1.0


@pytest.mark.parametrize("name", ["bounds", "facet_areas", "facet_normals", "used_vertices"])
def test_made_once_read_only_and_not_carried_over(name):
    mesh = cube()
    array = getattr(mesh, name)
    assert getattr(mesh, name) is array
    assert not array.flags.writeable
    other = dataclasses.replace(mesh, vertices=3.0 * mesh.vertices[:, [1, 2, 0]])
    fresh = TriangleMesh.from_triangles(other.vertices, other.faces)
    assert np.array_equal(getattr(other, name), getattr(fresh, name))


# ---------------------------------------------------------------- transformed


@pytest.mark.parametrize("make", [cube, polygons])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_volume_and_areas_of_a_scaled_surface(make, sign):
    mesh = make()
    image = mesh.transformed(np.diag([2.0 * sign, 2.0, 2.0, 1.0]))
    assert image.volume == 8.0 * mesh.volume
    assert image.facts().is_outward
    assert np.array_equal(image.facet_areas, 4.0 * mesh.facet_areas)
    assert np.array_equal(image.plane_areas, 4.0 * mesh.plane_areas)
    assert np.array_equal(image.facet_normals, mesh.facet_normals * [sign, 1.0, 1.0])
    assert np.array_equal(image.facet_ids, mesh.facet_ids)
    assert image.source == mesh.source


@pytest.mark.parametrize("make", [cube, polygons])
def test_the_inside_stays_inside(make, rng):
    for _ in range(20):
        linear, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
        mesh = make()
        image = mesh.transformed(np.column_stack([linear, shift]))
        assert image.facts().is_outward
        assert image.volume == pytest.approx(abs(np.linalg.det(linear)) * mesh.volume, rel=1e-9)
        areas = np.bincount(image.facet_ids, image.facet_areas, minlength=len(image.plane_areas))
        if make is polygons:
            np.testing.assert_allclose(image.plane_areas, areas, rtol=1e-9)
        # the normal of a plane is that of the triangles cut from it
        planes = TriangleMesh.from_triangles(image.vertices, image.plane_corners).facet_normals
        np.testing.assert_allclose(planes[image.facet_ids], image.facet_normals, atol=1e-9)


def test_shapes_of_the_matrix_agree():
    matrix = np.array([[0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 5], [0, 0, 0, 1]])
    mesh = cube()
    for given in (matrix, matrix[:3], matrix.tolist()):
        assert mesh.transformed(given).bounds.tolist() == [[2, 4, 5], [3, 5, 6]]
    assert mesh.transformed(matrix[:3, :3]).bounds.tolist() == [[-1, 0, 0], [0, 1, 1]]


def test_there_and_back_is_the_same_surface():
    mesh = TriangleMesh.from_triangles(*shapes.spiky(1))
    assert np.array_equal(mesh.transformed(np.eye(4)).vertices, mesh.vertices)
    back = mesh.transformed(MIRROR).transformed(MIRROR)
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)


def test_triangles_share_their_arrays_and_nothing_can_be_written():
    for matrix in (np.eye(3), MIRROR):
        image = cube().transformed(matrix)
        assert image.plane_corners is image.faces
        assert not any(a.flags.writeable for a in (image.vertices, image.faces, image.plane_areas))


def test_parts_of_a_surface_keep_their_facets():
    part = polygons().restricted([1, 7])
    image = part.transformed(2.0 * MIRROR)
    assert np.array_equal(image.plane_facets, [1, 7])
    assert np.array_equal(image.plane_areas, 4.0 * part.plane_areas)
    assert image.n_input_facets == part.n_input_facets


def test_the_sign_is_decided_exactly():
    # Determinants 2**16 and -2**16 of products of about 2**120, between which floats see no difference.
    n = 2**60
    for c, sign in ((1, 1), (-1, -1)):
        linear = np.array([[n, n - 2**8, 0], [n + 2**8, n, 0], [0, 0, c]], dtype=np.float64)
        assert n * n - (n + 2**8) * (n - 2**8) == 2**16
        mesh = cube()
        turned = mesh.transformed(linear).faces
        assert np.array_equal(turned, mesh.faces if sign > 0 else mesh.faces[:, [0, 2, 1]])


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(2), r"`matrix` must have shape \(4, 4\), \(3, 4\) or \(3, 3\); got \(2, 2\)"),
        (np.eye(4)[:, :3], r"`matrix` must have shape .*; got \(4, 3\)"),
        ([[1, 0], [0]], "`matrix` must have shape .*; got rows of different lengths"),
        (np.diag([1, np.nan, 1]), "`matrix` must be finite; got nan in row 1"),
        (np.diag([1, 1, np.inf, 1]), "`matrix` must be finite; got inf in row 2"),
        (np.diag([1, 1, 1, 2]), r"`matrix` must be affine, its last row 0 0 0 1; got \[0.0, 0.0, 0.0, 2.0\]"),
        (np.diag([1, 1, 0]), "`matrix` must not be singular; got determinant 0"),
        ([[1, 2, 3], [4, 5, 6], [7, 8, 9]], "`matrix` must not be singular"),
        (1e308 * np.ones((3, 3)) + np.diag([0, 1e300, 2e300]), "`matrix` must keep coordinates finite"),
        (1e-323 * np.eye(3), "`matrix` must leave a facet with positive area"),
    ],
)
def test_matrices_that_are_refused(matrix, message):
    vertices, faces = shapes.cube()
    mesh = TriangleMesh.from_triangles(0.25 * vertices if "leave" in message else 2.0 * vertices, faces)
    with pytest.raises(MeshError, match=message):
        mesh.transformed(matrix)


def test_a_matrix_of_other_things_is_a_type_error():
    with pytest.raises(TypeError, match="`matrix` must be an array of real numbers; got dtype complex128"):
        cube().transformed(1j * np.eye(3))
