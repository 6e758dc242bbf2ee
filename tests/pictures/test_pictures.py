import re

import numpy as np
import pytest
import shapes

from voxkernel import HalfSpaces, as_mesh, exact_kernel, voxel_kernel
from voxkernel.demo_shapes import SHAPES
from voxkernel.pictures import interactive_page, surface_picture
from voxkernel.pictures.scene import caption_of, make_scene

SIZE = (360, 280)
NEW_PLOT = re.compile(r'Plotly\.newPlot\(\s*"')  # the call of a page; old plotly.js has the words in a text


def picture(path):
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def orange(pixels):
    r, g, b = np.moveaxis(pixels, -1, 0)
    return int(np.count_nonzero((r > 110) & (r - b > 60) & (g - b > 15)))


def red(pixels):
    r, g, b = np.moveaxis(pixels, -1, 0)
    return int(np.count_nonzero((r > 110) & (r - g > 60) & (r - b > 40) & (abs(g - b) < 25)))


def draw(tmp_path, made, kernel=None, **options):
    path = tmp_path / "p.png"
    surface_picture(path, made, exact_kernel(made) if kernel is None else kernel, size=SIZE, **options)
    pixels = picture(path)
    assert pixels.shape == (SIZE[1], SIZE[0], 3)
    return pixels


def test_solid_kernel_is_drawn_and_nothing_reaches_stderr(tmp_path, capfd):
    pixels = draw(tmp_path, shapes.star_prism(), title="Star")
    assert orange(pixels) > 1000
    assert red(pixels) == 0
    assert (pixels == 255).all(axis=-1).mean() > 0.3
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")


def test_surface_is_translucent(tmp_path):
    """The kernel is inside a closed surface and is seen all the same."""
    pixels = draw(tmp_path, shapes.plus_cross())
    assert orange(pixels) > 300


@pytest.mark.parametrize("name", ["s_tetromino", "cubes_sharing_an_edge", "saw_prism"])
def test_kernels_without_volume_are_drawn(tmp_path, name):
    make, known = shapes.KNOWN[name]
    assert 0 <= known.dimension < 3
    assert orange(draw(tmp_path, make())) > 30


def test_point_kernel_is_drawn(tmp_path):
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    point = exact_kernel(HalfSpaces.from_planes(normals, 0.5 * normals.sum(axis=1)))
    assert point.dimension == 0
    assert point.vertices.tolist() == [[0.5, 0.5, 0.5]]
    assert orange(draw(tmp_path, shapes.cube(), point)) > 30


def test_empty_kernel_shows_its_witness(tmp_path):
    made = shapes.torus()
    pixels = draw(tmp_path, made)
    assert red(pixels) > 200
    assert orange(pixels) == 0
    scene = make_scene(as_mesh(made), exact_kernel(made))
    ids = [i for i in exact_kernel(made).certificate.facet_ids if i >= 0]
    assert sorted(as_mesh(made).facet_ids[scene.witness_faces].tolist()) == sorted(ids)
    assert len(scene.witness_centers) == len(ids)
    np.testing.assert_allclose(np.linalg.norm(scene.witness_inward, axis=1), 1.0)


def test_tiny_kernel_gets_a_close_up(tmp_path):
    """A kernel of a thousandth of the size covers a visible part of the picture."""
    vertices, faces = shapes.cube()
    kernel = exact_kernel((vertices * 1e-3 + 0.5, faces))
    assert orange(draw(tmp_path, shapes.cube(), kernel)) > 500


def test_grid_is_drawn(tmp_path):
    made = shapes.star_prism()
    assert orange(draw(tmp_path, made, voxel_kernel(made, depth=5))) > 500
    empty = voxel_kernel(shapes.torus(n_major=8, n_minor=6), depth=4)
    assert orange(draw(tmp_path, shapes.torus(n_major=8, n_minor=6), empty)) == 0


def test_no_kernel(tmp_path):
    path = tmp_path / "p.png"
    surface_picture(path, shapes.cube(), None, size=SIZE)
    assert orange(picture(path)) == 0


def test_same_input_same_picture(tmp_path):
    np.testing.assert_array_equal(draw(tmp_path, shapes.star_prism()), draw(tmp_path, shapes.star_prism()))


def test_far_from_the_origin_and_tiny(tmp_path):
    vertices, faces = shapes.star_prism()
    near = orange(draw(tmp_path, (vertices, faces)))
    assert orange(draw(tmp_path, (vertices + 1e6, faces))) == pytest.approx(near, rel=0.1)
    assert orange(draw(tmp_path, (vertices * 1e-6, faces))) == pytest.approx(near, rel=0.1)


def test_odd_titles(tmp_path):
    draw(tmp_path, shapes.cube(), title="x" * 500 + "\udcff\n<b>", caption="你 \t & <")


def test_html_is_one_offline_file(tmp_path):
    path = tmp_path / "p.html"
    made = shapes.torus(n_major=8, n_minor=6)
    surface_picture(path, made, exact_kernel(made), title="<script>alert(1)</script>")
    page = path.read_text(encoding="utf-8")
    assert "&lt;script&gt;alert" in page
    assert "<script>alert" not in page
    assert '<script src="' not in page
    assert len(NEW_PLOT.findall(page)) == 1
    assert "facets of the proof" in page


def test_interactive_page_has_a_menu(tmp_path):
    items = [(name, made, exact_kernel(made)) for name, made in (("one", shapes.cube()), ("two", shapes.star_prism()))]
    path = tmp_path / "page.html"
    interactive_page(path, items)
    page = path.read_text(encoding="utf-8")
    assert '"label":"one"' in page
    assert '"label":"two"' in page
    assert len(NEW_PLOT.findall(page)) == 1


def test_errors(tmp_path):
    with pytest.raises(ValueError, match=r"`path` must end in \.png or \.html; got 'p\.jpg'"):
        surface_picture(tmp_path / "p.jpg", shapes.cube(), None)
    for size, got in (((100, 300), r"\(100, 300\)"), ((300, 9000), r"\(300, 9000\)"), ((300,), r"\(300,\)")):
        with pytest.raises(ValueError, match=rf"`size` must be a width and a height from 200 .*; got {got}"):
            surface_picture(tmp_path / "p.png", shapes.cube(), None, size=size)
    with pytest.raises(TypeError, match="`size` must be an array of integers"):
        surface_picture(tmp_path / "p.png", shapes.cube(), None, size=(300.5, 400))
    with pytest.raises(ValueError, match=r"`path` must end in \.html"):
        interactive_page(tmp_path / "p.png", [("a", shapes.cube(), None)])
    with pytest.raises(ValueError, match="`items` must hold at least one surface; got 0"):
        interactive_page(tmp_path / "p.html", [])
    with pytest.raises(OSError, match="no"):
        surface_picture(tmp_path / "no" / "p.html", shapes.cube(), None)


def test_captions():
    cube, torus, flat = (as_mesh(m) for m in (shapes.cube(), shapes.torus(n_major=8, n_minor=6), shapes.s_tetromino()))
    assert caption_of(cube, exact_kernel(cube)) == "star-shaped, kernel volume 1, 100 % of the enclosed volume"
    assert "no point is on the inner side of all" in caption_of(torus, exact_kernel(torus))
    assert caption_of(flat, exact_kernel(flat)) == "degenerate: the kernel is only a flat polygon"
    field = as_mesh(shapes.height_field(n=3))
    assert "inside the ball" in caption_of(field, exact_kernel(field))
    assert caption_of(cube, None) == "12 facets"
    assert "between" in caption_of(cube, voxel_kernel(cube, depth=3))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.name)
def test_demo_shapes(shape):
    """Each is what its sentence says."""
    mesh = shape.make()
    facts, kernel = mesh.facts(), exact_kernel(mesh)
    assert facts.is_oriented
    assert facts.is_closed == (shape.name not in ("face", "hooked"))
    assert facts.is_outward in (True, None)
    assert len(facts.nonplanar_facets) == len(facts.degenerate_facets) == 0
    assert kernel.certificate.verify()
    expected = {"flat": 2, "torus": -1, "comet": -1}.get(shape.name, 3)
    assert kernel.unclipped_dimension == expected
    volume = {"gem": 32.0, "slit": 0.01, "flat": 0.0}
    if shape.name in volume:
        assert kernel.volume == pytest.approx(volume[shape.name], rel=1e-12)
    if shape.name == "face":
        assert not kernel.is_bounded
