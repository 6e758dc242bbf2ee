"""Surfaces whose axes differ by many powers of ten: the right answer, or one line that says to rescale."""

import itertools
from fractions import Fraction
from math import inf, isqrt

import numpy as np
import oracle
import pytest
import shapes

import voxkernel
from voxkernel.errors import MeshError
from voxkernel.measures import visible_fraction
from voxkernel.relaxed import best_center, violation

NEAR = (1e-60, 1e-12, 1.0, 1e12, 1e59)  # spans differ by up to 2**-300 or a little more
FAR = (1e-300, 1e-160, 1.0, 1e12, 1e60, 1e150)
TRIPLES = [s for s in itertools.product(NEAR, repeat=3) if max(s) / min(s) < 1e90]
FAR_TRIPLES = [s for s in itertools.product(FAR, repeat=3) if max(s) / min(s) > 1e91 or max(s) > 1e61 or max(s) < 1e-61]
BODIES = {
    "cube": shapes.cube(),
    "tetrahedron": shapes.tetrahedron(),
    "l_prism": shapes.l_prism(),
    "s_tetromino": shapes.s_tetromino(),
    "open_box": shapes.open_box(),
    "spiky": shapes.spiky(1),
}
FUNCTIONS = {
    "exact_kernel": voxkernel.exact_kernel,
    "voxel_kernel": lambda body: voxkernel.voxel_kernel(body, depth=4),
    "voxel_kernel_relaxed": lambda body: voxkernel.voxel_kernel(body, depth=4, tolerance=0.05),
    "starshapeness": voxkernel.starshapeness,
    "best_center": best_center,
    "violation": lambda body: violation(body, body[0][:1]),
    "defect_profile": lambda body: voxkernel.defect_profile(body, depth=3),
    "spherical_map": voxkernel.spherical_map,
    "register": lambda body: voxkernel.register(body, body),
    "kernel_moments": lambda body: voxkernel.kernel_moments(voxkernel.exact_kernel(body)),
    "kernel_points": lambda body: voxkernel.kernel_points(voxkernel.exact_kernel(body)),
    "visible_fraction": lambda body: visible_fraction(body, body[0].mean(axis=0), n_samples=100),
}


def scaled(name, scales):
    vertices, faces = BODIES[name]
    return np.asarray(vertices, dtype=np.float64) * np.array(scales), faces


def true_violation(vertices, faces, point):
    """The share of the area that turns its back, from integers."""
    areas = []
    turned = 0
    for plane, row in zip(oracle.corner_planes(vertices, faces), faces, strict=True):
        a, b, c = (oracle.point(vertices[i]) for i in row)
        u, v = [q - p for p, q in zip(a, b, strict=True)], [q - p for p, q in zip(a, c, strict=True)]
        normal = [u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)]
        square = sum(x * x for x in normal)
        areas.append(isqrt((square.numerator << 2400) // square.denominator))
        if plane is not None and oracle.side(plane, oracle.point(point)) > 0:
            turned += areas[-1]
    return Fraction(turned, sum(areas))


def check_exact(vertices, faces):
    """Dimension and volume are those that rationals find."""
    kernel = voxkernel.exact_kernel((vertices, faces))
    lower, upper = kernel.volume_bounds
    assert lower <= kernel.volume <= upper
    planes = [p for p in oracle.corner_planes(vertices, faces) if p is not None]
    if kernel.domain is not None:
        domain = kernel.domain
        assert kernel.unclipped_dimension == 3
        assert (domain.normals @ vertices.T <= domain.offsets[:, None]).all()
        return
    truth = oracle.kernel(planes)
    assert kernel.dimension == truth.dimension
    assert Fraction(lower) <= truth.volume
    assert upper == inf or truth.volume <= Fraction(upper)
    if truth.dimension == 3 and float(truth.volume) > 1e-290:
        assert upper - lower <= 1e-6 * upper


@pytest.mark.parametrize("name", ["cube", "tetrahedron", "l_prism", "s_tetromino", "open_box"])
def test_volumes_and_dimensions(name):
    triples = TRIPLES[::5] if name in ("cube", "tetrahedron") else TRIPLES[::10]
    triples = triples[::5] if name == "open_box" else triples
    for scales in triples:
        check_exact(*scaled(name, scales))


@pytest.mark.parametrize("name", ["cube", "l_prism", "s_tetromino", "open_box", "spiky"])
def test_shares_of_the_area(name):
    rng = np.random.default_rng(1)
    for scales in TRIPLES[::5] if name != "spiky" else TRIPLES[::30]:
        vertices, faces = scaled(name, scales)
        points = np.concatenate([vertices[:2], rng.uniform(-0.5, 1.5, (4, 3)) * scales])
        found = violation((vertices, faces), points)
        truth = [float(true_violation(vertices, faces, p)) for p in points]
        assert np.abs(found - truth).max() <= 1e-14


@pytest.mark.parametrize("scales", [(1e-60, 1.0, 1.0), (1e-60, 1e-60, 1.0), (1e12, 1e-60, 1.0), (1e-12, 1e59, 1e59)])
@pytest.mark.parametrize("name", ["cube", "s_tetromino"])
def test_verdict_and_voxels(name, scales):
    vertices, faces = scaled(name, scales)
    truth = oracle.mesh_kernel(vertices, faces)
    verdict = "star-shaped" if truth.dimension == 3 else "degenerate" if truth.dimension >= 0 else "not star-shaped"
    found = voxkernel.starshapeness((vertices, faces))
    assert found.verdict == verdict
    low, high = best_center((vertices, faces)).violation_bounds
    assert 0.0 <= low <= high
    assert (high == 0.0) == (truth.dimension >= 0)
    voxels = voxkernel.voxel_kernel((vertices, faces), depth=4)
    lower, upper = voxels.volume_bounds
    assert Fraction(lower) <= truth.volume <= Fraction(upper)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_every_function_is_right_or_says_so(function):
    """Warnings are errors here; one triple of each kind."""
    triples = TRIPLES[5::50] if function != "register" else TRIPLES[5:6]
    for name, scales in itertools.product(("cube", "open_box"), triples):
        FUNCTIONS[function](scaled(name, scales))


@pytest.mark.parametrize("scales", [(1e-12, 1e12, 1e-60), (1e59, 1e-12, 1e-30)])
def test_needles_slide_on_themselves(scales):
    body = scaled("cube", scales)
    found = voxkernel.register(body, body)
    assert np.isfinite(found.T_target_source).all()
    assert found.ambiguous


@pytest.mark.parametrize("function", FUNCTIONS)
def test_axes_that_differ_too_much(function):
    for scales in FAR_TRIPLES[:: len(FAR_TRIPLES) // 15]:
        with pytest.raises(MeshError, match=r"^`vertices` must .* \(rescale first\)$"):
            FUNCTIONS[function](scaled("cube", scales))


@pytest.mark.parametrize("scales", FAR_TRIPLES[::9])
def test_facts_and_repair_take_any_axes(scales):
    vertices, faces = scaled("cube", scales)
    facts = voxkernel.as_mesh((vertices, faces)).facts()
    assert facts.is_closed
    assert facts.is_outward
    fixed = voxkernel.repair((vertices, faces), orient=True, merge_duplicates=True)
    assert len(fixed.mesh.faces) == 12


@pytest.mark.parametrize("scales", [(1.0, 1.0, 1e-20), (1.0, 1e-20, 1e-20), (1e-60, 1e-12, 1.0), (1e59, 1e59, 1e-30)])
def test_points_of_thin_kernels_are_few(scales):
    kernel = voxkernel.exact_kernel(scaled("cube", scales))
    points = voxkernel.kernel_points(kernel, n_points=100)
    assert 1 <= len(points.interior) <= 25_600
    assert points.interior_weights.sum() == pytest.approx(kernel.volume, rel=1e-9)
    assert (points.interior >= -1e-9 * np.array(scales).max()).all()


def test_a_small_facet_beside_a_large_body():
    """One corner moved by 1e-300: the spans are still those of the cube."""
    vertices, faces = scaled("cube", (1.0, 1e12, 1e-12))
    vertices[np.flatnonzero(vertices[:, 0] == 0.0)[0], 0] = 1e-300
    check_exact(vertices, faces)
