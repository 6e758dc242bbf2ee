"""The loops about the sphere in the compiled core against their Numba twins: the same doubles, bit for bit."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import _core, demo_shapes
from voxkernel._coverage import Boundary
from voxkernel._loops import sphere
from voxkernel._radial import _across

NAMES = ("cube", "octahedron", "star_prism", "plus_cross", "icosphere", "spiky", "l_prism", "torus", "open_hemisphere",
         "open_box", "height_field", "moebius_band")  # fmt: skip
REAL = ("faces_smooth/smooth_ict01_neutral.ply", "faces/ict01_neutral.ply")


def same(one, other):
    np.testing.assert_array_equal(np.asarray(one).view(np.uint8), np.asarray(other).view(np.uint8))


def meshes():
    for name in NAMES:
        yield voxkernel.as_mesh(getattr(shapes, name)())
    yield demo_shapes.urchin()


def centers(mesh, rng):
    middle, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max()
    yield from middle + size * rng.normal(scale=0.3, size=(6, 3))
    yield mesh.vertices[mesh.faces[0, 0]].copy()  # a vertex
    yield mesh.vertices[mesh.faces[0]].mean(axis=0)  # in a triangle's plane
    yield mesh.vertices[mesh.faces[0, :2]].mean(axis=0)  # on an edge
    yield middle + 1e8 * size


def run_angles(mesh, x, rng):
    side = rng.choice([-1, 0, 1, 2], len(mesh.faces)).astype(np.int8)
    results = []
    for module in (_core, sphere):
        angles, first, second = np.full(len(mesh.faces), 9.0), np.full(3, 9.0), np.full(3, 9.0)
        sums = module.triangle_angles(mesh.vertices, mesh.faces, x, side, angles)
        areas = np.where(side == 0, 0.0, 0.5 + np.arange(len(mesh.faces)))
        moments = module.density_moments(mesh.vertices, mesh.faces, areas, x, first, second)
        directions, radii = np.full(mesh.vertices.shape, 9.0), np.full(len(mesh.vertices), 9.0)
        module.directions_and_radii(mesh.vertices, x, directions, radii)
        results.append([np.array(sums), angles, np.array(moments), first, second, np.nan_to_num(directions), radii])
        assert np.isnan(directions).all(axis=1).tolist() == (radii == 0).tolist()
    for new, old in zip(*results, strict=True):
        same(new, old)


def run_boundary(boundary, x):
    results = []
    for module in (_core, sphere):
        gradient, hessian, angles = np.full(3, 9.0), np.full((3, 3), 9.0), np.full(4, 9.0)
        module.boundary_field(boundary.starts, boundary.ends, x, gradient, hessian)
        points = x + np.arange(12.0).reshape(4, 3)
        module.cone_angles(boundary.starts, boundary.ends, boundary.apex, points, angles)
        angle = [module.cone_angle(boundary.starts, boundary.ends, boundary.apex, x)]
        results.append([gradient, hessian, angles, np.array(angle)])
    for new, old in zip(*results, strict=True):
        same(new, old)


def run_rays(mesh, x, rng, n=400):
    corners, across = mesh.vertices - x, _across(mesh)
    rays = rng.normal(size=(n, 3))
    rays[: len(corners[:50])] = corners[:50]  # through vertices
    length = np.linalg.norm(rays, axis=1)
    rays /= np.where(length > 0, length, 1.0)[:, None]
    guess = rng.integers(-1, len(mesh.faces), n)
    for steps, slack in ((64, 1e-6), (3, 0.1), (0, 1.0)):
        results = []
        for module in (_core, sphere):
            hits, radii = guess.copy(), np.full(n, 9.0)
            module.settle_rays(corners, mesh.faces, across, rays, hits, slack, steps, radii)
            results.append([hits, np.isnan(radii), np.nan_to_num(radii)])
        for new, old in zip(*results, strict=True):
            same(new, old)


@pytest.mark.parametrize("mesh", list(meshes()), ids=[*NAMES, "urchin"])
def test_surface_loops(mesh, rng):
    boundary = Boundary.of(mesh)
    for x in centers(mesh, rng):
        run_angles(mesh, x, rng)
        run_boundary(boundary, x)
        run_rays(mesh, x, rng)


@pytest.mark.parametrize("name", REAL)
def test_real_meshes(name, data_dir, rng):
    mesh = voxkernel.as_mesh(data_dir / name)
    boundary = Boundary.of(mesh)
    for x in list(centers(mesh, rng))[4:]:
        run_angles(mesh, x, rng)
        run_boundary(boundary, x)
        run_rays(mesh, x, rng, 5000)


def test_nearest_point_and_edges(rng):
    seen = set()
    for trial in range(3000):
        n = int(rng.integers(0, 30))
        normals = rng.normal(size=(n, 3))
        if trial % 3 == 0:  # few directions: parallel planes and nearly dependent ones
            normals = rng.integers(-1, 2, (n, 3)) + 1e-9 * rng.normal(size=(n, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None] + 1e-300
        offsets = rng.uniform(-0.05 if trial % 2 else 0.1, 1.0, n)
        for z in 2 * rng.normal(size=(4, 3)):
            results = []
            for module in (_core, sphere):
                y = np.full(3, 9.0)
                found = module.nearest_point(normals, offsets, z, 1e-13, y)
                results.append((found, y.tobytes()))
            assert results[0] == results[1]
            seen.add(results[0][0])
        starts, ends = rng.normal(size=(2, 3, 3))
        starts[0] = ends[0]
        met = [module.edges_meet(starts, ends, normals, offsets) for module in (_core, sphere)]
        assert met[0] == met[1]
        seen.add(f"edges {met[0]}")
    assert seen == {True, False, "edges True", "edges False"}


def test_triangle_distances(rng):
    corners = rng.normal(size=(20000, 3, 3))
    corners[::5, 2] = 0.5 * (corners[::5, 0] + corners[::5, 1])  # no area
    corners[1::50] = corners[1::50, :1]  # a point
    corners[2::9] = rng.integers(-2, 3, corners[2::9].shape)
    points = 2 * rng.normal(size=(20000, 3))
    points[2::9] = rng.integers(-2, 3, points[2::9].shape)
    new, old = np.empty(20000), np.empty(20000)
    _core.triangle_distances(points, corners, new)
    sphere.triangle_distances(points, corners, old)
    same(new, old)
    assert np.isfinite(new).all()
