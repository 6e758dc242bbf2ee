"""`visible_fraction`: by hand, against the violation, exact in kernels."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import best_center, exact_kernel, visible_fraction


@pytest.mark.parametrize("name", ["cube", "l_prism", "star_prism", "notched_cube", "saw_prism", "s_tetromino"])
def test_all_of_it_from_the_kernel(name):
    surface = shapes.KNOWN[name][0]()
    kernel = exact_kernel(surface)
    point = kernel.vertices[0] if kernel.dimension == 0 else kernel.deepest_point
    found = visible_fraction(surface, np.round(point, 12))
    assert (found.fraction, found.error, found.n_samples) == (1, 0, 0)
    assert found.hidden == 0
    assert found.bounds == (1, 1)


def test_corner_of_the_kernel():
    """On the surface itself, in the planes of some facets."""
    assert visible_fraction(shapes.cube(), (1, 1, 1)).fraction == 1


def test_two_rooms():
    """From the middle of one of two boxes: its own six sides of twelve; the other box shows nothing inside."""
    found = visible_fraction(shapes.two_boxes(), (0.5, 0.5, 0.5))
    assert found.violation == pytest.approx(1 / 12)
    assert found.n_samples == 100_000
    low, high = found.bounds
    assert low <= 0.5 <= high
    assert found.fraction == pytest.approx(0.5, abs=0.003)


def test_one_square_behind_another():
    """An open surface can hide itself from a point of its kernel: exactly three quarters of the wall."""
    near = [(1, -0.5, -0.5), (1, 0.5, -0.5), (1, 0.5, 0.5), (1, -0.5, 0.5)]
    far = [(2, -2, -2), (2, 2, -2), (2, 2, 2), (2, -2, 2)]
    faces = [(0, 2, 1), (0, 3, 2), (4, 6, 5), (4, 7, 6)]
    flipped = [(a, c, b) for a, b, c in faces]
    areas = np.array([1, 16])
    for triangles in (faces, flipped):
        found = visible_fraction((near + far, triangles), (0, 0, 0), n_samples=20_000)
        if found.violation:
            assert found.fraction == 0
            continue
        shadow = 4.0  # twice as far, twice as wide
        assert found.fraction == pytest.approx((areas.sum() - shadow) / areas.sum(), abs=0.003)


def test_hidden_is_at_least_the_violation(rng):
    for surface in (shapes.torus(), shapes.spiky(2)):
        for point in rng.uniform(-1, 1, (10, 3)):
            found = visible_fraction(surface, point, n_samples=2000)
            assert found.hidden >= found.violation - 1e-12
            assert 0 <= found.bounds[0] <= found.fraction <= found.bounds[1] <= 1


def test_error_shrinks_and_covers():
    surface, point = shapes.torus(), (2.0, 0.0, 0.0)
    rough, fine = (visible_fraction(surface, point, n_samples=n) for n in (1000, 200_000))
    assert fine.error < 0.1 * rough.error
    assert abs(rough.fraction - fine.fraction) <= rough.error + fine.error
    again = visible_fraction(surface, point, n_samples=1000, rng=np.random.default_rng(0))
    assert again.to_dict() == rough.to_dict()
    assert visible_fraction(surface, point, n_samples=1000, confidence=0.5).error < rough.error


def test_from_far_away():
    """Nothing faces a point outside a convex shape but the far side, which the near one hides."""
    found = visible_fraction(shapes.icosphere(2), (100.0, 0, 0), n_samples=5000)
    assert found.violation == pytest.approx(0.5, abs=0.05)
    assert found.fraction == pytest.approx(0, abs=0.002)


def test_real_face_from_its_star_center(data_dir):
    mesh = voxkernel.as_mesh(data_dir / "faces" / "ict01_neutral.ply")
    center = best_center(mesh)
    found = visible_fraction(mesh, center.point)
    assert found.violation <= center.violation_bounds[1] + 1e-12
    assert 0.9 < found.fraction < 1 - center.violation_bounds[0]
    assert "VisibleFraction(0.9" in repr(found)
    assert float(found) == found.fraction


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"point": (0, 0)}, r"`point` must have shape \(n, 3\)"),
        ({"point": (0, 0, np.nan)}, "`point` must be finite"),
        ({"n_samples": 0}, "`n_samples` must be in 1"),
        ({"confidence": 1.0}, "`confidence` must be below 1; got 1"),
    ],
)
def test_bad_options(options, message):
    point = options.pop("point", (0.5, 0.5, 0.5))
    with pytest.raises(ValueError, match=message):
        visible_fraction(shapes.cube(), point, **options)
