"""`spherical_map` beside a plain Open3D loop and beside ducc0 and pyshtools, on meshes in memory."""

import numpy as np
import pytest
from synthetic import bumpy

import voxkernel
from voxkernel._open3d import open3d
from voxkernel.spherical.harmonics import fit_harmonics
from voxkernel.spherical.sphere_grids import sphere_grid


def star(n_facets):
    return voxkernel.TriangleMesh.from_triangles(*bumpy(n_facets, 0.12))


def opened(mesh):
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    return mesh.restricted(np.flatnonzero(centers[:, 2] > -0.6))


def plain_open3d(mesh, center, directions):
    """What a user of Open3D would write: the distances of the rays, single precision."""
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.faces.astype(np.uint32))
    )
    rays = np.concatenate([np.broadcast_to(center, directions.shape), directions], axis=1).astype(np.float32)
    return scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()


@pytest.mark.parametrize("n_facets", [10_000, 100_000])
def test_parametrisation(side_by_side, n_facets):
    mesh = star(n_facets)
    center = np.array([0.01, 0.0, 0.0])
    voxkernel.spherical_map(mesh, center=center)  # compiled loops

    def numpy_only():
        d = mesh.vertices - center
        return d / np.linalg.norm(d, axis=1)[:, None]

    answer = side_by_side(
        f"{len(mesh.faces)} facets, given centre",
        {"spherical_map": lambda: voxkernel.spherical_map(mesh, center=center), "directions by NumPy": numpy_only},
    )
    assert answer["spherical_map"][1].directions == pytest.approx(answer["directions by NumPy"][1], abs=1e-15)


@pytest.mark.parametrize("n_facets", [10_000, 100_000])
def test_coverage(side_by_side, n_facets):
    mesh = opened(star(n_facets))
    voxkernel.spherical_map(mesh, clearance=0.01)
    side_by_side(
        f"{len(mesh.faces)} facets, open",
        {
            "coverage": lambda: voxkernel.spherical_map(mesh),
            "coverage, clearance 0.01": lambda: voxkernel.spherical_map(mesh, clearance=0.01),
            "distortion": lambda: voxkernel.spherical_map(mesh, center="distortion"),
            "exact_kernel": lambda: voxkernel.exact_kernel(mesh),
        },
    )


@pytest.mark.parametrize("n_facets", [10_000, 100_000])
def test_radial_grid(side_by_side, n_facets):
    mesh = star(n_facets)
    seen = voxkernel.spherical_map(mesh, center=(0, 0, 0))
    seen.sample(n=8)

    def theirs():
        return plain_open3d(mesh, seen.center, sphere_grid("equiangular", 512).directions())

    answer = side_by_side(
        f"{len(mesh.faces)} facets, 512 x 1024", {"sample": lambda: seen.sample(n=512), "plain Open3D": theirs}
    )
    ours, single = answer["sample"][1].radii.reshape(-1), answer["plain Open3D"][1]
    assert ours == pytest.approx(single, rel=1e-4)


@pytest.mark.parametrize("n", [65, 512])
def test_transform(side_by_side, n):
    grid = sphere_grid("gauss-legendre", n)
    values = np.random.default_rng(0).normal(size=grid.shape)
    fit_harmonics(grid, values, 64, 0.0, np.zeros(3))  # Legendre table
    rivals = {"voxkernel": lambda: fit_harmonics(grid, values, 64, 0.0, np.zeros(3))}
    try:
        import ducc0

        rivals["ducc0"] = lambda: ducc0.sht.analysis_2d(map=values[None], lmax=64, spin=0, geometry="GL", nthreads=2)
    except ImportError:
        pass
    try:
        import pyshtools

        zero, weights = pyshtools.expand.SHGLQ(n - 1)
        fewer = np.ascontiguousarray(values[:, : 2 * n - 1])
        rivals["pyshtools"] = lambda: pyshtools.expand.SHExpandGLQ(fewer, weights, zero, norm=4, lmax_calc=64)
    except ImportError:
        pass
    side_by_side(f"degree 64, {n} x {2 * n}", rivals)
