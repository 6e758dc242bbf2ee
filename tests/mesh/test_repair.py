import dataclasses

import numpy as np
import pytest
import shapes

from voxkernel.errors import MeshError
from voxkernel.mesh import RepairChange, TriangleMesh, repair


def test_without_options_nothing_happens():
    mesh = TriangleMesh.from_triangles(*shapes.cube())
    result = repair(mesh)
    assert result.mesh is mesh
    assert result.changes == ()
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.mesh = None


def test_a_step_that_finds_nothing_returns_the_input():
    vertices, polygons = shapes.truncated_octahedron()
    mesh = TriangleMesh.from_polygons(vertices, polygons)
    result = repair(mesh, orient=True, merge_duplicates=True, decimate_to=1000)
    assert result.mesh is mesh  # its polygons are still there
    assert [change.step for change in result.changes] == ["merge_duplicates", "orient", "decimate_to"]
    assert "turned 0 triangles" in str(result.changes[1])
    assert "\n" not in repr(result)


@pytest.mark.parametrize("make", [shapes.cube, shapes.torus, shapes.two_boxes, shapes.icosphere])
def test_orient_scrambled_solids(make, rng):
    vertices, faces = make()
    wrong = faces.copy()
    turn = rng.random(len(faces)) < 0.4
    wrong[turn] = wrong[turn][:, [0, 2, 1]]
    result = repair((vertices, wrong), orient=True)
    facts = result.mesh.facts()
    assert facts.is_oriented
    assert facts.is_outward
    turned = (result.mesh.faces != wrong).any(axis=1)
    np.testing.assert_array_equal(turned, turn)
    np.testing.assert_array_equal(result.mesh.faces[~turn], faces[~turn])  # order and corners kept
    (change,) = result.changes
    assert change == RepairChange(
        "orient", f"turned {turn.sum()} triangles", len(vertices), len(vertices), len(faces), len(faces)
    )
    assert "(repaired: orient)" in result.mesh.source


def test_orient_turns_each_part_outward():
    vertices, faces = shapes.joined(shapes.inside_out_cube(), (shapes.cube()[0] + 5, shapes.cube()[1]))
    facts = repair((vertices, faces), orient=True).mesh.facts()
    assert facts.is_outward
    assert facts.volume == pytest.approx(2.0)


def test_orient_open_surfaces_keeps_the_side_of_most_area():
    vertices, faces = shapes.height_field()
    wrong = faces.copy()
    wrong[: len(faces) // 3] = wrong[: len(faces) // 3, ::-1]
    result = repair((vertices, wrong), orient=True)
    np.testing.assert_array_equal(np.sort(result.mesh.faces, axis=1), np.sort(faces, axis=1))
    p, q, r = (vertices[result.mesh.faces[:, k]] for k in range(3))
    assert (np.cross(q - p, r - p)[:, 2] > 0).all()


def test_orient_leaves_a_moebius_band_alone():
    mesh = TriangleMesh.from_triangles(*shapes.moebius_band())
    result = repair(mesh, orient=True)
    assert result.mesh is mesh
    assert "parts without two sides" in result.changes[0].text


def test_orient_with_nonmanifold_edges():
    vertices, faces = shapes.cubes_sharing_an_edge()
    wrong = faces.copy()
    wrong[0] = wrong[0, ::-1]
    result = repair((vertices, wrong), orient=True)
    assert result.mesh.facts().is_oriented
    np.testing.assert_array_equal(np.sort(result.mesh.faces, axis=1), np.sort(faces, axis=1))


def test_merge_duplicates():
    vertices, faces = shapes.l_prism()
    soup = vertices[faces].reshape(-1, 3)
    ids = np.arange(len(soup)).reshape(-1, 3)
    extra = np.r_[ids, ids[:1], ids[1:2, [1, 2, 0]], ids[2:3, ::-1], [[0, 0, 1]]]
    result = repair((soup, extra), merge_duplicates=True)
    (change,) = result.changes
    assert (change.n_vertices_before, change.n_vertices_after) == (len(soup), len(vertices))
    assert (change.n_faces_before, change.n_faces_after) == (len(faces) + 4, len(faces) + 1)
    assert f"merged {len(soup) - len(vertices)} vertices" in change.text
    assert "dropped 1 collapsed and 2 repeated triangles" in change.text
    np.testing.assert_array_equal(result.mesh.vertices[result.mesh.faces[:-1]], vertices[faces])
    assert repair((soup, ids), merge_duplicates=True).mesh.facts().is_closed


def test_close_holes():
    vertices, faces = shapes.open_box()
    mesh = TriangleMesh.from_triangles(vertices, faces)
    n = mesh.facts().n_boundary_edges
    kept = repair(mesh, close_holes=n - 1) if n > 3 else None
    if kept is not None:
        assert kept.mesh is mesh
        assert "with 0 triangles" in kept.changes[0].text
    result = repair(mesh, close_holes=n)
    assert result.mesh.facts().is_closed
    assert result.mesh.facts().is_outward
    assert result.changes[0].n_faces_after - result.changes[0].n_faces_before == n - 2
    assert not mesh.facts().is_closed  # the input is as it was


def test_remesh_smooth_decimate():
    mesh = TriangleMesh.from_triangles(*shapes.icosphere(2))
    result = repair(mesh, remesh_edge_length=0.15, smooth_steps=2, decimate_to=100)
    assert [change.step for change in result.changes] == ["remesh_edge_length", "smooth_steps", "decimate_to"]
    remeshed, smoothed, decimated = result.changes
    assert remeshed.n_faces_after > 2 * remeshed.n_faces_before
    assert smoothed.n_faces_before == smoothed.n_faces_after == remeshed.n_faces_after
    assert "coordinates moved by up to" in smoothed.text
    assert decimated.n_faces_after == len(result.mesh.faces) <= 100
    assert result.mesh.facts().is_closed
    a, b = (result.mesh.vertices[result.mesh.faces[:, k]] for k in (0, 1))
    assert np.linalg.norm(a - b, axis=1).max() < 1.0


@pytest.mark.parametrize(
    ("options", "kind", "text"),
    [
        ({"close_holes": 2}, ValueError, r"`close_holes` must be in 3\.\."),
        ({"close_holes": True}, TypeError, "`close_holes` must be an integer"),
        ({"remesh_edge_length": 0}, ValueError, "`remesh_edge_length` must be > 0; got 0"),
        ({"remesh_edge_length": "x"}, TypeError, "`remesh_edge_length` must be a real number"),
        ({"smooth_steps": -1}, ValueError, r"`smooth_steps` must be in 0\.\."),
        ({"decimate_to": 0}, ValueError, r"`decimate_to` must be in 1\.\."),
        ({"decimate_to": 1.5}, TypeError, "`decimate_to` must be an integer"),
    ],
)
def test_wrong_options(options, kind, text):
    with pytest.raises(kind, match=text):
        repair(shapes.cube(), **options)


def test_a_step_that_cannot_work_says_so():
    text = "`close_holes` must be given a surface PyMeshLab can handle.*manifold"
    with pytest.raises(MeshError, match=text) as info:
        repair(shapes.three_faces_on_an_edge(), close_holes=20)
    assert "\n" not in str(info.value)
