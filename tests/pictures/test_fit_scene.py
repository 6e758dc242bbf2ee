"""How far surfaces are off in pictures: known distances, the bar, what is grey, and pages of many scans."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import JointRegistration
from voxkernel.pictures import registration_picture, together_picture
from voxkernel.pictures.fit_scene import bar_colors, before_panel, fit_of, plain_layer, view_of
from voxkernel.pictures.parts import heading
from voxkernel.registration import prepare_surface

GREY = (185, 190, 196)


def plate(height, half=1.0, n=12):
    """A square in the plane z = height, its facets upward."""
    side = np.linspace(-half, half, n)
    x, y = np.meshgrid(side, side, indexing="ij")
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (v.ravel() for v in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    points = np.column_stack([x.ravel(), y.ravel(), np.full(n * n, height)])
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def test_distance_of_two_plates_is_their_gap():
    fit = fit_of([plate(0.0), plate(0.03)], 0.1)
    for distances in fit.distances:
        np.testing.assert_allclose(distances, 0.03, atol=1e-6)
    assert fit.unexplained == 0.0
    assert fit.shares.sum() == pytest.approx(1.0)
    assert fit.end == pytest.approx(0.05)  # rounded up to 1, 2 or 5
    assert fit.shares[np.searchsorted(fit.edges, 0.03) - 1] == pytest.approx(1.0)


def test_what_is_far_or_faces_the_other_way_is_unexplained():
    points, faces = plate(0.03)
    assert fit_of([plate(0.0), (points, faces[:, ::-1])], 0.1).unexplained == pytest.approx(1.0)
    assert fit_of([plate(0.0), plate(0.3)], 0.1).unexplained == pytest.approx(1.0)
    # A plate of half the size explains about a quarter of the larger one.
    fit = fit_of([plate(0.0, n=81), plate(0.0, half=0.5, n=41)], 1e-3)
    assert fit.unexplained == pytest.approx(0.75 * 4 / (4 + 1), abs=0.03)


def test_units_do_not_matter():
    one = fit_of([plate(0.0), plate(0.03)], 0.1)
    two = fit_of([(1e4 * p, f) for p, f in (plate(0.0), plate(0.03))], 1e3)
    np.testing.assert_allclose(two.edges, 1e4 * one.edges, rtol=1e-9)
    np.testing.assert_allclose(two.shares, one.shares, atol=1e-6)


def test_bar_begins_dark_ends_light_and_nan_is_grey():
    colors = bar_colors(np.array([0.0, 1.0, 7.0, np.nan]))
    assert colors[0].sum() < colors[1].sum()
    assert colors[1].tolist() == colors[2].tolist()
    assert tuple(colors[3]) == GREY


def test_open_surfaces_are_seen_from_their_front():
    view, up = view_of([plate(0.0)])
    assert view[2] > 0.5
    assert np.linalg.norm(view) == pytest.approx(1.0)
    assert abs(up[2]) < 0.1


def test_surfaces_that_lie_far_apart_are_moved_beside_each_other():
    view, up = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    near = [plain_layer(*plate(z), "#000000", "plate") for z in (0.0, 0.3)]
    vertices, faces = plate(0.0)
    far = [plain_layer(vertices + k * np.array([500.0, 70.0, 0.0]), faces, "#000000", "plate") for k in range(5)]
    assert before_panel("before", near, 2.9, view, up).layers == tuple(near)
    panel = before_panel("before", far, 2.9, view, up)
    assert panel.name.startswith("before, moved beside each other: all take 2.02e+03")
    middles = np.stack([layer.vertices.mean(axis=0) for layer in panel.layers])
    gaps = np.abs(middles[:, None] - middles)[:, :, :2].max(axis=2)[np.triu_indices(5, 1)]
    assert gaps.min() == pytest.approx(2.12)  # plates of 2, and a gap
    assert np.ptp(np.concatenate([layer.vertices for layer in panel.layers]), axis=0).max() < 7.0
    for layer, given in zip(panel.layers, far, strict=True):
        shift = layer.vertices - given.vertices
        np.testing.assert_allclose(shift, np.broadcast_to(shift[0], shift.shape), atol=1e-9)


def test_long_captions_are_broken_between_words():
    words = " ".join(["reason"] * 60)
    text = heading("title", words)["text"]
    assert text.count("reason") == 60
    assert text.count("<br>") == 3
    pillow = pytest.importorskip("PIL.ImageDraw")
    image = pytest.importorskip("PIL.Image").new("RGB", (400, 50))
    pen = pillow.Draw(image)
    from voxkernel.pictures.png import broken

    lines = broken(pen, words, 20, 400)
    assert " ".join(lines) == words
    assert len(lines) > 3
    assert broken(pen, "", 20, 400) == [""]


def joint(poses, apart):
    groups = (tuple(i for i in range(len(poses)) if i not in apart),)
    return JointRegistration(np.array(poses), 0, groups, apart, ("",) * len(poses), (), 0.2, 0.1)


def test_page_of_many_scans(tmp_path):
    nothing = np.full((4, 4), np.nan)
    found = joint([np.eye(4), np.eye(4), nothing], (2,))
    scans = [plate(0.0), plate(0.01), shapes.cube()]
    together_picture(tmp_path / "p.html", scans, found, names=["one", "<two>", "three"], title="<many>")
    page = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert "&lt;many&gt;" in page
    assert "three: belongs to nothing" in page
    assert "mesh units" in page
    with pytest.raises(ValueError, match="`surfaces` must be the 3 that were registered; got 1"):
        together_picture(tmp_path / "p.html", scans[:1], found)
    with pytest.raises(ValueError, match=r"`path` must end in \.png or \.html"):
        together_picture(tmp_path / "p.jpg", scans, found)
    with pytest.raises(ValueError, match="`found` must hold scans that belong together; got none"):
        together_picture(tmp_path / "p.png", scans[:1], joint([nothing], (0,)))


def test_a_picture_takes_what_register_took(tmp_path):
    """Files, arrays and meshes as well as prepared surfaces; the picture is the same."""
    pytest.importorskip("pyvista")
    source, target = voxkernel.as_mesh(shapes.l_prism()), shapes.l_prism()
    source.write(tmp_path / "l.ply")
    ready = prepare_surface(source)
    found = voxkernel.register(source, target)
    pairs = {"prepared": (ready, ready), "given": (tmp_path / "l.ply", target)}
    for name, pair in pairs.items():
        registration_picture(tmp_path / f"{name}.png", *pair, found, size=(600, 800))
    assert (tmp_path / "prepared.png").read_bytes() == (tmp_path / "given.png").read_bytes()
    with pytest.raises(voxkernel.MeshReadError, match=r"none\.ply"):
        registration_picture(tmp_path / "a.png", tmp_path / "none.ply", target, found)


@pytest.mark.parametrize("found", [None, np.eye(4)])
def test_what_is_no_registration_is_one_line(found, tmp_path):
    with pytest.raises(TypeError, match=r"^`found` must be a Registration, what `register` gives; got \w+$"):
        registration_picture(tmp_path / "a.png", plate(0.0), plate(0.1), found)
    assert not any(tmp_path.iterdir())
