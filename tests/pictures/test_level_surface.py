"""Relaxed kernels as level surfaces, domain outlines, the centre and up: known shapes, PNG and HTML."""

import importlib
import json
import re

import numpy as np
import pytest
import shapes

from voxkernel import TriangleMesh, as_mesh, best_center, exact_kernel, violation, voxel_kernel
from voxkernel.pictures import surface_picture
from voxkernel.pictures.domain_outline import domain_outline, is_cut_by_domain
from voxkernel.pictures.furniture import legend_of
from voxkernel.pictures.level_surface import level_surface
from voxkernel.pictures.scene import make_scene


@pytest.fixture(scope="module")
def torus():
    pytest.importorskip("pyvista")
    mesh = as_mesh(shapes.torus(n_major=24, n_minor=12))
    tolerance = best_center(mesh).violation_bounds[1] + 0.05
    return mesh, voxel_kernel(mesh, tolerance=tolerance, depth=5)


def test_the_contour_lies_where_the_violation_reaches_the_tolerance(torus):
    mesh, kernel = torus
    vertices, faces = level_surface(mesh, kernel, resolution=24)
    assert len(faces) > 200
    # Half of the points of a smooth level surface are a little inside, half a little outside.
    inside = violation(mesh, vertices) <= kernel.tolerance
    assert 0.1 < inside.mean() < 0.9
    step = float(np.ptp(vertices, axis=0).max()) / 24
    voxels = kernel.to_mesh().vertices
    assert np.abs(np.ptp(vertices, axis=0) - np.ptp(voxels, axis=0)).max() < 3.0 * (step + kernel.voxel_size)


def test_the_contour_is_closed_and_stays_in_the_domain(torus):
    mesh = as_mesh(shapes.height_field(n=6))
    kernel = voxel_kernel(mesh, tolerance=0.3, depth=5)
    assert is_cut_by_domain(kernel, kernel.to_mesh().vertices)
    vertices, faces = level_surface(mesh, kernel, resolution=24)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    step = float(np.ptp(vertices, axis=0).max()) / 24
    beyond = (vertices @ kernel.domain.normals.T - kernel.domain.offsets).max()
    assert beyond < 0.5 * step


def test_what_cannot_be_contoured(torus):
    mesh, kernel = torus
    with pytest.raises(ValueError, match="`kernel` must be relaxed, with a tolerance above 0; got an exact one"):
        level_surface(mesh, voxel_kernel(mesh, depth=3))
    with pytest.raises(ValueError, match="`resolution` must be "):
        level_surface(mesh, kernel, resolution=1)
    empty = voxel_kernel(mesh, tolerance=0.01, depth=4)
    assert empty.is_empty
    assert [len(part) for part in level_surface(mesh, empty)] == [0, 0]


def test_voxels_on_request(torus):
    mesh, kernel = torus
    smooth, blocks = make_scene(mesh, kernel, resolution=20), make_scene(mesh, kernel, resolution=0)
    assert smooth.is_smooth
    assert not blocks.is_smooth
    np.testing.assert_array_equal(blocks.kernel_vertices, kernel.to_mesh().vertices)
    assert not np.isin(smooth.kernel_vertices[:, 0], blocks.kernel_vertices[:, 0]).all()


def test_large_surfaces_are_contoured_more_coarsely_or_shown_as_voxels(torus, monkeypatch):
    mesh, kernel = torus
    scene = importlib.import_module("voxkernel.pictures.scene")
    n_faces = []
    for samples in (33, 17, 15):
        monkeypatch.setattr(scene, "_PAIRS", 1.01 * mesh.n_facets * samples**3)
        made = make_scene(mesh, kernel, resolution=32)
        n_faces.append(len(made.kernel_faces))
        assert made.is_smooth == (samples >= 16)
    assert n_faces[0] == len(level_surface(mesh, kernel, resolution=32)[1])
    assert n_faces[1] == len(level_surface(mesh, kernel, resolution=17)[1])
    assert n_faces[2] == len(kernel.to_mesh().faces)


def test_the_outline_of_a_cube_and_of_a_ball():
    cube = as_mesh(shapes.cube())
    box = exact_kernel(cube, domain="box").domain
    edges = domain_outline(box)
    assert edges.shape == (12, 2, 3)
    lengths = np.linalg.norm(np.diff(edges, axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(lengths, lengths[0])
    ball = exact_kernel(cube, domain="ball").domain
    ends = domain_outline(ball)
    middle = 0.5 * (ball.vertices.min(axis=0) + ball.vertices.max(axis=0))
    radii = np.linalg.norm(ends.reshape(-1, 3) - middle, axis=1)
    np.testing.assert_allclose(radii, radii[0], rtol=1e-9)
    assert radii[0] <= np.linalg.norm(ball.vertices - middle, axis=1).min()


def test_a_domain_is_shown_only_where_it_cuts():
    field = as_mesh(shapes.height_field(n=4))
    cut = exact_kernel(field)
    scene = make_scene(field, cut)
    assert cut.cut_by_domain
    assert len(scene.domain_lines)
    assert "domain: ball" in [words for _, words in legend_of(scene)]
    cube = as_mesh(shapes.cube())
    whole = make_scene(cube, exact_kernel(cube, domain="ball"))
    assert not len(whole.domain_lines)
    assert [words for _, words in legend_of(whole)] == ["surface", "kernel", "deepest point"]
    np.testing.assert_array_equal(whole.center, exact_kernel(cube).deepest_point[None])


def test_voxels_reach_the_border_of_a_domain_of_many_planes(torus, monkeypatch):
    """One plane at a time says what all voxels and all planes at once do."""
    monkeypatch.setattr(importlib.import_module("voxkernel.pictures.domain_outline"), "_PRODUCTS", 1)
    star = as_mesh(shapes.spiky(2))
    found = []
    for kernel in (torus[1], voxel_kernel(star, depth=5, domain="ball"), voxel_kernel(star, depth=5, domain="hull")):
        points = kernel.to_mesh().vertices
        far = (points @ kernel.domain.normals.T - kernel.domain.offsets).max()
        found.append(is_cut_by_domain(kernel, points))
        assert found[-1] == (far > -1.5 * kernel.voxel_size)
    assert set(found) == {True, False}


@pytest.mark.parametrize(
    ("sizes", "source", "up"),
    [
        ((1.0, 3.0, 1.6), "arrays", "y"), ((1.0, 1.6, 3.0), "arrays", "z"), ((1.0, 1.5, 1.5), "arrays", "z"),
        ((1.0, 1.6, 3.0), "figure.glb", "y"),
    ],
)  # fmt: skip
def test_up_is_that_of_the_file_or_the_longer_of_y_and_z(sizes, source, up):
    vertices, faces = shapes.cube()
    mesh = TriangleMesh.from_triangles(np.asarray(vertices, float) * sizes, faces, source=source)
    assert "xyz"[int(np.argmax(np.abs(make_scene(mesh, None).up)))] == up


def test_png_and_html_say_the_same(torus, tmp_path):
    mesh, kernel = torus
    for kind in ("png", "html"):
        surface_picture(tmp_path / f"torus.{kind}", mesh, kernel, size=(500, 400))
    page = (tmp_path / "torus.html").read_text(encoding="utf-8")
    data = page[page.rindex("Plotly.newPlot(") :]
    named = set(re.findall(r'"name":"([^"]+)"', data))
    wanted = {words for _, words in legend_of(make_scene(mesh, kernel, center=np.zeros(3)))}
    assert {json.loads(f'"{name}"') for name in named} >= wanted
    assert "mesh units" in data
    assert '"text":["x","y","z",' in data
