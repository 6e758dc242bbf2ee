"""What stands below a picture is true: the bar is as long as it says, the colours are those of what is drawn."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._palette import UNSEEN, distinct_color, hex_of
from voxkernel.pictures import surface_picture
from voxkernel.pictures.furniture import bar_length, legend_of
from voxkernel.pictures.scene import KERNEL, RELAXED, SURFACE, WITNESS, make_scene

pytest.importorskip("pyvista")
image_of = pytest.importorskip("PIL.Image").open
SIZE = (700, 500)


def pixels(path):
    return np.asarray(image_of(path).convert("RGB")).astype(int)


def has(image, color):
    """Whether a colour fills a square, as in a legend."""
    rgb = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.abs(image - rgb).max(axis=2) <= 1).sum()) > 50


@pytest.mark.parametrize(
    ("room", "wanted"), [(1.0, 1.0), (0.99, 0.5), (0.2, 0.2), (7.0, 5.0), (4.9e-7, 2e-7), (1999.0, 1000.0)]
)
def test_bars_are_round(room, wanted):
    assert bar_length(room) == pytest.approx(wanted, rel=1e-12)


def test_a_pixel_is_as_large_as_it_says():
    """The outline of a ball of radius 1: two units across, and a little more, because it is seen from near by."""
    from voxkernel.pictures.png import _draw

    mesh = voxkernel.as_mesh(shapes.icosphere(3))
    radius = float(np.linalg.norm(mesh.vertices, axis=1).max())
    view = _draw(make_scene(mesh, None), SIZE)
    wide = np.flatnonzero((view.image.astype(int).sum(axis=2) < 740).any(axis=0))
    assert (wide[-1] - wide[0]) * view.units_per_pixel == pytest.approx(2.0 * radius, rel=0.03)


def test_exact_and_relaxed_kernels_never_look_alike(tmp_path):
    mesh = voxkernel.as_mesh(shapes.l_prism())
    exact, relaxed = voxkernel.exact_kernel(mesh), voxkernel.voxel_kernel(mesh, tolerance=0.2, depth=4)
    names = {}
    for name, kernel in (("exact", exact), ("relaxed", relaxed)):
        surface_picture(tmp_path / f"{name}.png", mesh, kernel, size=SIZE)
        surface_picture(tmp_path / f"{name}.html", mesh, kernel)
        below = pixels(tmp_path / f"{name}.png")[-50:]
        assert has(below, SURFACE)
        assert has(below, KERNEL) == (name == "exact")
        assert has(below, RELAXED) == (name == "relaxed")
        names[name] = [words for _, words in legend_of(make_scene(mesh, kernel))]
        page = (tmp_path / f"{name}.html").read_text()  # the page says the same, in the same colours
        assert all(f'"name":"{words}"' in page for words in names[name])
        assert (RELAXED in page) == (name == "relaxed")
    assert names["exact"] == ["surface", "kernel", "deepest point"]
    assert names["relaxed"] == ["surface", "relaxed kernel, 20 % of the area turned away", "domain: hull"]


def test_the_legend_names_the_proof():
    mesh = voxkernel.as_mesh(shapes.two_boxes())
    assert (WITNESS, "facets of the proof") in legend_of(make_scene(mesh, voxkernel.exact_kernel(mesh)))


@pytest.mark.parametrize("up", [[0, 0, 1], [0, -3, 0], [1, 2, 3]])
def test_up_is_up(up):
    mesh = voxkernel.as_mesh(shapes.height_field(n=4))
    unit = np.array(up) / np.linalg.norm(up)
    scene = make_scene(mesh, voxkernel.exact_kernel(mesh), up=unit)
    assert np.linalg.norm(scene.view) == pytest.approx(1.0)
    assert scene.up @ scene.view == pytest.approx(0.0, abs=1e-12)
    assert scene.up @ unit > 0.9
    assert abs(np.cross(scene.up, scene.view) @ unit) < 1e-12  # no part of it points aside


def test_all_pictures_take_what_points_up(tmp_path):
    """Seen from the side, what is highest in the world is highest in the picture."""
    from voxkernel.pictures.camera import as_up
    from voxkernel.pictures.fit_scene import view_of

    mesh = voxkernel.as_mesh(shapes.l_prism())
    for axis in np.eye(3):
        view, upward = view_of([(mesh.vertices, mesh.faces)], as_up(7.0 * axis))
        assert upward @ axis > 0.9
        assert upward @ view == pytest.approx(0.0, abs=1e-12)
    assert as_up(None) is None
    assert as_up([0.0, 3e200, 4e200]) == pytest.approx([0.0, 0.6, 0.8])


@pytest.mark.parametrize("suffix", [".png", ".html"])
def test_guards_have_axes_a_scale_and_names(tmp_path, suffix):
    from voxkernel.pictures import guards_picture

    found = voxkernel.guards(shapes.l_prism(), coverage=0.99)
    guards_picture(tmp_path / f"a{suffix}", found, up=(0, 1, 0))
    if suffix == ".html":
        page = (tmp_path / "a.html").read_text()
        assert all(f'"name":"{name}"' in page for name in ("guard 0", "unseen"))
        assert "mesh units" in page
    else:
        below = pixels(tmp_path / "a.png")[-90:]
        assert has(below, hex_of(distinct_color(0)))
        assert has(below, hex_of(UNSEEN))
    with pytest.raises(ValueError, match="`up` must be a direction of three numbers; got "):
        guards_picture(tmp_path / f"b{suffix}", found, up=(0, 0))
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("up", [[0, 0, 0], [1, 2], [0, 0, np.nan]])
def test_up_must_be_a_direction(tmp_path, up):
    with pytest.raises(ValueError, match="`up` must be a direction of three numbers; got "):
        surface_picture(tmp_path / "a.png", shapes.cube(), None, up=up)
    assert not list(tmp_path.iterdir())
