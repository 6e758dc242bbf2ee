"""The loops about the sphere in the compiled core beside short twins in NumPy and known answers."""

import numpy as np
import pytest
import shapes
from scipy.optimize import minimize

import voxkernel
from voxkernel import _core
from voxkernel.spherical.boundary_angle import Boundary
from voxkernel.spherical.radial_grid import _across

FULL = 4 * np.pi


def angles_of(vertices, faces, center, side=None):
    side = np.full(len(faces), 2, np.int8) if side is None else side
    angles = np.empty(len(faces))
    total, size = _core.triangle_angles(vertices, faces, np.asarray(center, float), side, angles)
    return angles, total, size


def angle_twin(a, b, c):
    """Van Oosterom and Strackee's formula, whole arrays at once."""
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    dots = (u @ v for u, v in ((a, b), (b, c), (c, a)))
    ab, bc, ca = dots
    return 2 * np.arctan2(a @ np.cross(b, c), la * lb * lc + ab * lc + bc * la + ca * lb)


def test_triangle_angles(rng):
    vertices, faces = shapes.spiky()
    for center in rng.normal(scale=0.5, size=(5, 3)):
        angles, total, size = angles_of(vertices, faces, center)
        expected = [angle_twin(*(vertices[f] - center)) for f in faces]
        np.testing.assert_allclose(angles, expected, atol=1e-14)
        assert total == pytest.approx(np.sum(expected), abs=1e-13)
        assert size == pytest.approx(np.abs(expected).sum(), abs=1e-13)


def test_an_octant_is_an_eighth_and_its_side_decides_the_sign():
    vertices, faces = np.eye(3), np.array([[0, 1, 2]])
    for side, share in ((2, 1), (1, 1), (-1, -1), (0, 0)):
        angles, total, size = angles_of(vertices, faces, (0, 0, 0), np.array([side], np.int8))
        assert angles[0] == pytest.approx(share * FULL / 8, abs=1e-15)
        assert (total, size) == (angles[0], abs(angles[0]))


def test_sums_keep_what_small_terms_lose():
    """One large angle and 3000 tiny ones, each below half a unit in the last place of the sum."""
    big, small = np.eye(3), np.array([[1e9, 0, 0], [1e9, 1, 0], [1e9, 0, 1.0]])
    faces = np.concatenate([[[0, 1, 2]], np.tile([3, 4, 5], (3000, 1))])
    angles, total, _ = angles_of(np.concatenate([big, small]), faces, (0, 0, 0))
    assert angles[0] + angles[1] == angles[0]
    assert total == pytest.approx(angles[0] + 3000 * angles[1], rel=2.0**-52)
    assert total > angles[0]


def test_cone_is_the_surface_modulo_the_sphere(rng):
    mesh = voxkernel.as_mesh(shapes.open_hemisphere())
    boundary = Boundary.of(mesh)
    points = rng.normal(scale=0.5, size=(20, 3))
    many = np.empty(len(points))
    _core.cone_angles(boundary.starts, boundary.ends, boundary.apex, points, many)
    for x, of_many in zip(points, many, strict=True):
        cone = _core.cone_angle(boundary.starts, boundary.ends, boundary.apex, x)
        turns = (angles_of(mesh.vertices, mesh.faces, x)[1] - cone) / FULL
        assert turns == pytest.approx(round(turns), abs=1e-12)
        assert cone == of_many


def test_boundary_field_is_the_derivative(rng):
    mesh = voxkernel.as_mesh(shapes.open_hemisphere())
    boundary = Boundary.of(mesh)

    def field(x):
        gradient, hessian = np.empty(3), np.empty((3, 3))
        _core.boundary_field(boundary.starts, boundary.ends, x, gradient, hessian)
        return gradient, hessian

    step = 1e-5
    for x in rng.uniform(-0.3, 0.3, (5, 3)):
        gradient, hessian = field(x)
        for k, e in enumerate(step * np.eye(3)):
            up, down = (angles_of(mesh.vertices, mesh.faces, x + s * e)[1] for s in (1, -1))
            assert gradient[k] == pytest.approx((up - down) / (2 * step), abs=1e-7)
            np.testing.assert_allclose(hessian[:, k], (field(x + e)[0] - field(x - e)[0]) / (2 * step), atol=1e-7)
        assert np.trace(hessian) == pytest.approx(0, abs=1e-12)  # the solid angle is harmonic


def test_boundary_field_leaves_out_the_edge_it_lies_on():
    starts, ends = np.array([[-1.0, 0, 0], [0, 1, 0]]), np.array([[1.0, 0, 0], [0, 1, 1]])
    both, one = np.empty((2, 3))
    _core.boundary_field(starts, ends, np.zeros(3), both, np.empty((3, 3)))
    _core.boundary_field(starts[1:], ends[1:], np.zeros(3), one, np.empty((3, 3)))
    assert both.tolist() == one.tolist()


def test_density_moments(rng):
    vertices, faces = shapes.icosphere(2)
    areas = rng.uniform(0.5, 1, len(faces))
    areas[3] = 0.0

    def moments(x):
        first, second = np.empty(3), np.empty(3)
        return *_core.density_moments(vertices, faces, areas, x, first, second), first, second

    x, step = np.array([0.1, -0.2, 0.15]), 1e-6
    total, square, first, second = moments(x)
    angles = angles_of(vertices, faces, x)[0]
    real = areas > 0
    assert total == pytest.approx(angles[real].sum(), abs=1e-13)
    assert square == pytest.approx((angles[real] ** 2 / areas[real]).sum(), abs=1e-13)
    for k, e in enumerate(step * np.eye(3)):
        up, down = moments(x + e), moments(x - e)
        assert first[k] == pytest.approx((up[0] - down[0]) / (2 * step), abs=1e-7)
        assert second[k] == pytest.approx((up[1] - down[1]) / (2 * step), abs=1e-7)


@pytest.mark.parametrize("n", [4, 12, 60])
def test_nearest_point(n, rng):
    for _ in range(20):
        normals = rng.normal(size=(n, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        offsets = rng.uniform(0.5, 1, n)
        z, y = 3 * rng.normal(size=3), np.empty(3)
        assert _core.nearest_point(normals, offsets, z, 1e-13, y)
        assert (normals @ y - offsets).max() <= 1e-12
        known = minimize(
            lambda p, z=z: ((p - z) ** 2).sum(),
            np.zeros(3),
            jac=lambda p, z=z: 2 * (p - z),
            constraints={
                "type": "ineq",
                "fun": lambda p, a=normals, b=offsets: b - a @ p,
                "jac": lambda p, a=normals: -a,
            },
            method="SLSQP",
            options={"ftol": 1e-14},
        )
        np.testing.assert_allclose(y, known.x, atol=1e-6)


def test_nearest_point_of_an_inner_point_and_of_an_empty_polytope():
    cube, y = np.concatenate([np.eye(3), -np.eye(3)]), np.empty(3)
    assert _core.nearest_point(cube, np.ones(6), np.array([0.5, 0, -0.25]), 1e-13, y)
    assert y.tolist() == [0.5, 0, -0.25]
    assert _core.nearest_point(cube, np.ones(6), np.array([5.0, -7, 0.5]), 1e-13, y)
    assert y.tolist() == [1, -1, 0.5]
    assert not _core.nearest_point(cube, np.array([-1.0, 1, 1, -1, 1, 1]), np.zeros(3), 1e-13, y)
    assert _core.nearest_point(np.empty((0, 3)), np.empty(0), np.ones(3), 1e-13, y)


def test_edges_meet():
    cube, ones = np.concatenate([np.eye(3), -np.eye(3)]), np.ones(6)

    def meets(a, b):
        return _core.edges_meet(np.array([a], float), np.array([b], float), cube, ones)

    assert meets((-3, 0, 0), (3, 0, 0))
    assert meets((0, 0, 0), (0.5, 0, 0))
    assert meets((1, -5, 0), (1, 5, 0))  # along a face
    assert meets((2, 0, 0), (0, 2, 0))  # touches an edge
    assert not meets((2.5, 0, 0), (0, 2.5, 0))
    assert not meets((2, 0, 0), (3, 0, 0))
    assert not _core.edges_meet(np.empty((0, 3)), np.empty((0, 3)), cube, ones)


def test_directions_and_radii(rng):
    vertices, center = rng.normal(size=(50, 3)), rng.normal(size=3)
    vertices[7] = center
    directions, radii = np.empty((50, 3)), np.empty(50)
    _core.directions_and_radii(vertices, center, directions, radii)
    np.testing.assert_allclose(radii, np.linalg.norm(vertices - center, axis=1), rtol=1e-15)
    assert radii[7] == 0
    assert np.isnan(directions[7]).all()
    with np.errstate(invalid="ignore"):
        np.testing.assert_allclose(directions, (vertices - center) / radii[:, None], rtol=1e-14)


def settled(mesh, rays, guess, *, slack=1e-9, steps=1000):
    hits, radii = guess.copy(), np.empty(len(rays))
    _core.settle_rays(mesh.vertices, mesh.faces, _across(mesh), rays, hits, slack, steps, radii)
    return hits, radii


def test_settle_rays(rng):
    """From any triangle of a star-shaped surface a ray finds its own; the radius is that of the plane."""
    mesh = voxkernel.as_mesh(shapes.icosphere(3))
    rays = rng.normal(size=(500, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    p = mesh.vertices[mesh.faces]
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    reach = (normals * p[:, 0]).sum(axis=1) / (rays @ normals.T)
    expected = np.where(reach > 0, reach, np.inf).min(axis=1)  # convex: the nearest plane
    hits, radii = settled(mesh, rays, rng.integers(0, len(mesh.faces), 500))
    np.testing.assert_allclose(radii, expected, rtol=1e-14)
    np.testing.assert_allclose(reach[np.arange(500), hits], radii, rtol=1e-14)


def test_rays_that_hit_nothing():
    mesh = voxkernel.as_mesh(shapes.mesh(np.eye(3), [(0, 1, 2)]))
    rays = np.array([[1.0, 1, 1], [-1, -1, -1], [1, -1e-3, 1], [1, 1, 1]]) / 3**0.5
    hits, radii = settled(mesh, rays, np.array([0, 0, 0, -1]))
    assert hits.tolist() == [0, -1, -1, -1]
    assert radii[0] == pytest.approx(3**-0.5)
    assert np.isnan(radii[1:]).all()
    assert settled(mesh, rays, np.zeros(4, np.int64), slack=0.01)[0].tolist() == [0, -1, 0, 0]


def test_triangle_distances(rng):
    """Against the smallest distance from a fine grid of points of the triangle, and known answers."""
    corners, points = rng.normal(size=(30, 3, 3)), 2 * rng.normal(size=(30, 3))
    corners[3, 2] = corners[3, 1]
    corners[4] = corners[4, 0]
    distances = np.empty(30)
    _core.triangle_distances(points, corners, distances)
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201)))
    weights = np.stack([1 - u - v, u, v], axis=1)[u + v <= 1]
    sampled = np.linalg.norm(weights @ corners - points[:, None], axis=2).min(axis=1)
    assert (distances <= sampled + 1e-12).all()
    np.testing.assert_allclose(distances, sampled, atol=0.03)
    known = np.array([[0, 0, 2], [2, 2, 0], [-3, -4, 0], [0.25, 0.25, -5.0]])
    _core.triangle_distances(known, np.tile([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], (4, 1, 1)), distances[:4])
    np.testing.assert_allclose(distances[:4], [2, 1.5 * 2**0.5, 5, 5])


CALLS = {
    "triangle_angles": ("vertices", "faces", "point", "side", "angles"),
    "cone_angle": ("vertices", "vertices", "point", "point"),
    "cone_angles": ("vertices", "vertices", "point", "vertices", "angles"),
    "boundary_field": ("vertices", "vertices", "point", "out", "square"),
    "density_moments": ("vertices", "faces", "angles", "point", "out", "out"),
    "nearest_point": ("vertices", "angles", "point", "one", "out"),
    "edges_meet": ("vertices", "vertices", "vertices", "angles"),
    "directions_and_radii": ("vertices", "point", "out_rows", "angles"),
    "settle_rays": ("vertices", "faces", "faces", "vertices", "hits", "one", "steps", "angles"),
    "triangle_distances": ("vertices", "corners", "angles"),
}


def arguments(name):
    made = {
        "vertices": np.eye(3), "faces": np.array([[0, 1, 2]] * 3), "point": np.zeros(3), "side": np.zeros(3, np.int8),
        "angles": np.ones(3), "out": np.ones(3), "square": np.eye(3), "out_rows": np.eye(3), "one": 1.0, "steps": 3,
        "hits": np.zeros(3, np.int64), "corners": np.ones((3, 3, 3)),
    }  # fmt: skip
    return [made[kind] for kind in CALLS[name]]


@pytest.mark.parametrize("name", CALLS)
def test_bindings_take_nothing_by_halves(name):
    call, given = getattr(_core, name), arguments(name)
    call(*given)
    for k, value in enumerate(given):
        if not isinstance(value, np.ndarray):
            continue
        wrong = [value.astype(np.float32), value[..., None], value.tolist(), np.repeat(value, 2, axis=-1)[..., ::2]]
        for odd in wrong:
            with pytest.raises(TypeError, match="incompatible function arguments"):
                call(*given[:k], odd, *given[k + 1 :])


@pytest.mark.parametrize("name", [name for name in CALLS if name not in ("cone_angle", "edges_meet")])
def test_bindings_do_not_write_to_what_is_read_only(name):
    given = arguments(name)
    given[-1].flags.writeable = False
    with pytest.raises(TypeError, match="incompatible function arguments"):
        getattr(_core, name)(*given)
