"""Spherical maps: closed forms, derivatives by differences, ducc0 and SciPy as oracles, rates of convergence."""

import itertools
import json
import warnings

import numpy as np
import pytest
import shapes
from scipy.optimize import linprog
from scipy.special import sph_harm_y

import voxkernel
from voxkernel.cli.main import main
from voxkernel.exact import exact_kernel
from voxkernel.pictures import sphere_picture
from voxkernel.spherical import spherical_map
from voxkernel.spherical.boundary_angle import Boundary, solid_angles
from voxkernel.spherical.coverage import coverage_optimum
from voxkernel.spherical.harmonics import fit_harmonics
from voxkernel.spherical.radial_grid import grid_triangles
from voxkernel.spherical.search_region import Region, kernel_region
from voxkernel.spherical.sphere_grids import GRIDS, sphere_grid

FULL = 4 * np.pi


def mesh_of(shape):
    return voxkernel.TriangleMesh.from_triangles(*shape)


def angle_at(mesh, x):
    return solid_angles(mesh, np.asarray(x, float), np.full(len(mesh.faces), 2, np.int8))[1]


def cap(height, n_rings=60, n_sectors=120):
    """The part of a fine unit sphere above a height, its rim a regular polygon at exactly that height."""
    theta = np.arccos(height) * np.arange(1, n_rings + 1) / n_rings
    ring = shapes.parallels(theta, n_sectors)
    faces = [(0, 1 + j, 1 + (j + 1) % n_sectors) for j in range(n_sectors)]
    for i in range(n_rings - 1):
        for j in range(n_sectors):
            a, b = 1 + i * n_sectors + j, 1 + i * n_sectors + (j + 1) % n_sectors
            faces += [(a, a + n_sectors, b + n_sectors), (a, b + n_sectors, b)]
    return shapes.mesh(np.concatenate([[(0, 0, 1)], ring]), faces)


def harmonic_sphere(degree, m, c, subdivisions=4):
    return shapes.spiky(subdivisions, lambda d: 1 + c * real_harmonic(degree, m, d))


def real_harmonic(degree, m, directions):
    """Orthonormal, without the phase (-1)^m, from SciPy's complex ones."""
    theta, phi = np.arccos(np.clip(directions[:, 2], -1, 1)), np.arctan2(directions[:, 1], directions[:, 0])
    y = sph_harm_y(degree, abs(m), theta, phi) * (-1) ** m
    return y.real if m == 0 else 2**0.5 * (y.real if m > 0 else y.imag)


# ---------------------------------------------------------------- solid angle


@pytest.mark.parametrize("name", ["cube", "octahedron", "star_prism", "plus_cross", "icosphere"])
def test_closed_surfaces_fill_the_sphere(name):
    seen = spherical_map(getattr(shapes, name)(), center="deepest")
    assert seen.solid_angle == pytest.approx(FULL, abs=1e-13)
    assert seen.hidden_fraction == 0
    assert not len(seen.folded_facets)


def test_closed_surface_is_not_seen_from_outside():
    mesh = mesh_of(shapes.l_prism())
    assert angle_at(mesh, (5, 1, 2)) == pytest.approx(0, abs=1e-14)
    assert spherical_map(mesh, center=(5, 1, 2)).hidden_fraction > 0.2


def test_hemisphere_from_its_centre():
    assert spherical_map(shapes.open_hemisphere(), center=(0, 0, 0)).solid_angle == pytest.approx(2 * np.pi, abs=1e-14)


@pytest.mark.parametrize("height", [-0.5, 0.0, 0.4, 0.8])
def test_cap_from_the_centre(height):
    n = 120
    exact = 2 * np.pi * (1 - height)  # of a round cap; the rim here is a polygon of great-circle arcs
    seen = spherical_map(cap(height, n_sectors=n), center=(0, 0, 0)).solid_angle
    # Girard: the polygon's corners have turned by 2 pi - (angle sum - (n - 2) pi).
    r = np.arccos(height)
    half = np.arctan(1 / (np.cos(r) * np.tan(np.pi / n))) if height else np.pi / 2
    polygon = n * (2 * np.pi / n + 2 * half - np.pi) if height >= 0 else None
    assert seen == pytest.approx(exact, rel=2e-3)
    if polygon is not None:
        assert seen == pytest.approx(polygon, abs=1e-12)


def test_cube_side_is_a_sixth_and_octant_an_eighth():
    box = voxkernel.as_mesh(shapes.open_box())
    assert FULL - angle_at(box, (0.5, 0.5, 0.5)) == pytest.approx(FULL / 6, abs=1e-14)
    corner = shapes.mesh([(1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 1, 2)])
    assert angle_at(mesh_of(corner), (0, 0, 0)) == pytest.approx(FULL / 8, abs=1e-15)


def test_angle_does_not_depend_on_position_far_away(rng):
    vertices, faces = shapes.open_hemisphere()
    near = spherical_map((vertices, faces), center=(0.1, 0.2, -0.3))
    far = spherical_map((vertices + 2.0**20, faces), center=np.array([0.1, 0.2, -0.3]) + 2.0**20)
    assert far.solid_angle == pytest.approx(near.solid_angle, abs=1e-8)


@pytest.mark.parametrize("name", ["open_hemisphere", "height_field", "open_box", "moebius_band", "cube"])
def test_boundary_tells_angle_gradient_and_hessian(name, rng):
    mesh = mesh_of(getattr(shapes, name)())
    boundary = Boundary.of(mesh)
    for x in np.array([0.3, 0.2, -0.7]) + rng.uniform(-0.4, 0.4, (5, 3)):
        if name != "moebius_band":  # triangles of a one-sided band do not fit together
            off = (angle_at(mesh, x) - boundary.angle(x)) / FULL
            assert off == pytest.approx(round(off), abs=1e-13)
        gradient, hessian = boundary.derivatives(x)
        steps = 1e-5 * np.eye(3)
        if name != "moebius_band":
            assert gradient == pytest.approx(
                [(angle_at(mesh, x + h) - angle_at(mesh, x - h)) / 2e-5 for h in steps], abs=1e-8
            )
        slopes = [(boundary.derivatives(x + h)[0] - boundary.derivatives(x - h)[0]) / 2e-5 for h in steps]
        assert hessian.T == pytest.approx(np.array(slopes), abs=1e-7)
        assert np.trace(hessian) == pytest.approx(0, abs=1e-12)  # harmonic
        assert hessian == pytest.approx(hessian.T, abs=1e-12)


def test_inner_edges_cancel():
    assert not len(Boundary.of(mesh_of(shapes.l_prism())))
    assert len(Boundary.of(mesh_of(shapes.open_box()))) == 4


# ---------------------------------------------------------------- nearest point of a polytope


def test_nearest_point_meets_its_conditions(rng):
    for _ in range(30):
        normals = rng.normal(size=(40, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        offsets = rng.uniform(0.5, 1.0, 40)
        region = Region(np.zeros(3), 1.0, normals, offsets, np.arange(40), np.eye(3), np.zeros((1, 3)), np.zeros(3))
        z = rng.normal(size=3) * 3
        y = region.nearest(z)
        assert y is not None
        slack = offsets - normals @ y
        assert slack.min() > -1e-12
        held = np.flatnonzero(slack < 1e-10)
        # z - y is a non-negative combination of the normals that hold y.
        answer = linprog(np.zeros(len(held)), A_eq=normals[held].T, b_eq=z - y)
        assert answer.status == 0 or np.allclose(z, y)


# ---------------------------------------------------------------- the best centre


@pytest.mark.parametrize("name", ["open_hemisphere", "height_field", "open_box"])
def test_no_other_kernel_point_covers_more(name, rng):
    surface = getattr(shapes, name)()
    best = spherical_map(surface)
    proof = best.certificate
    assert proof is not None
    assert proof.residual < 1e-7
    assert proof.curvature <= 1e-9
    assert (proof.multipliers >= 0).all()
    corners = best.kernel.vertices
    weights = rng.dirichlet(np.full(len(corners), 0.05), 300)
    inside = best.kernel.deepest_point + 0.999 * (weights @ corners - best.kernel.deepest_point)
    mesh = mesh_of(surface)
    assert max(angle_at(mesh, x) for x in inside) <= best.solid_angle + 1e-9


def test_maximum_lies_on_the_kernels_boundary():
    best = spherical_map(shapes.height_field())
    assert 0 <= best.clearance < 1e-12
    assert len(best.certificate.active_facets)


def test_open_box_is_best_seen_from_a_lower_corner():
    best = spherical_map(shapes.open_box())
    assert best.coverage == pytest.approx(23 / 24, abs=1e-12)  # the lid is a twenty-fourth of the sphere
    assert best.center[2] == pytest.approx(0, abs=1e-12)
    assert best.center == pytest.approx(np.round(best.center), abs=1e-12)
    assert best.hidden_fraction == 0
    assert best.clearance > 0
    assert any("clearance" in note for note in best.notes)
    assert best.certificate.touches_boundary  # the rim is a part of the walls' planes
    assert any("touches the boundary curve" in note for note in best.notes)


def test_flat_surface_is_half_the_sphere_at_best():
    best = spherical_map(shapes.mesh([(0, 0, 0), (4, 0, 0), (0, 3, 0)], [(0, 1, 2)]))
    assert best.solid_angle == pytest.approx(2 * np.pi, abs=1e-4)  # the limit on the triangle itself
    assert best.center[2] < 0


def test_clearance_keeps_away_from_the_planes():
    free, held = (spherical_map(shapes.height_field(), clearance=c) for c in (0.0, 0.1))
    assert held.clearance == pytest.approx(0.1, abs=1e-9)
    assert held.solid_angle < free.solid_angle
    assert held.certificate.residual < 1e-7
    assert set(held.certificate.active_facets) <= set(range(128))
    with pytest.raises(ValueError, match=r"`clearance` must be below 0\.5, that of the deepest kernel point; got 0\.6"):
        spherical_map(shapes.cube(), clearance=0.6)


def test_overlapping_sheets_count_twice(rng):
    # Two nested caps, both seen from below: more than the whole sphere can be covered.
    a, b = cap(-0.9, 10, 12), cap(-0.9, 10, 12)
    both = shapes.joined(a, (b[0] * 1.5, b[1]))
    best = spherical_map(both)
    assert best.solid_angle > FULL
    mesh = mesh_of(both)
    assert best.solid_angle == pytest.approx(angle_at(mesh, best.center), abs=1e-6)
    corners = best.kernel.vertices
    for w in rng.dirichlet(np.full(len(corners), 0.1), 100):
        x = best.kernel.deepest_point + 0.99 * (w @ corners - best.kernel.deepest_point)
        assert angle_at(mesh, x) <= best.solid_angle + 1e-9


def test_kinds_of_centre():
    surface = shapes.height_field()
    kernel = exact_kernel(surface)
    maps = {c: spherical_map(surface, center=c) for c in ("coverage", "deepest", "centroid", "distortion", "relaxed")}
    assert maps["deepest"].center == pytest.approx(kernel.deepest_point)
    assert maps["centroid"].center == pytest.approx(kernel.centroid)
    assert maps["deepest"].clearance == pytest.approx(kernel.clearance)
    assert maps["distortion"].distortion == min(m.distortion for m in maps.values())
    assert maps["coverage"].solid_angle == max(m.solid_angle for m in maps.values())
    assert "not empty" in maps["relaxed"].notes[0]
    assert maps["relaxed"].kernel is None
    assert maps["deepest"].kernel is not None


def test_closed_surface_takes_the_deepest_point():
    best = spherical_map(shapes.cube())
    assert best.center == pytest.approx([0.5, 0.5, 0.5])
    assert best.certificate is None
    assert "no boundary" in best.notes[0]


def test_sphere_from_its_centre_is_not_distorted():
    assert spherical_map(shapes.icosphere(3), center=(0, 0, 0)).distortion < 0.02
    assert spherical_map(shapes.icosphere(3), center=(0.5, 0, 0)).distortion > 0.3


@pytest.mark.parametrize(
    ("name", "dimension"), [("saw_prism", None), ("s_tetromino", None), ("cubes_sharing_an_edge", 1)]
)
def test_flat_kernels(name, dimension):
    kernel = exact_kernel(getattr(shapes, name)())
    if kernel.is_empty:
        pytest.skip("the kernel is empty")
    assert dimension is None or kernel.dimension == dimension
    for center in ("coverage", "deepest", "centroid", "distortion"):
        seen = spherical_map(getattr(shapes, name)(), center=center)
        assert seen.hidden_fraction == 0
        assert np.isfinite(seen.radii).all()
        assert any("rounded" in note for note in seen.notes) or kernel.dimension == 3


def test_open_surface_with_a_flat_kernel():
    # Two level squares, one facing up and one down, and two walls: the kernel is a square in z = 0.
    v = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (3, 0, 0), (3, 1, 0), (2, 1, 0)]
    v += [(0, -1, 1), (3, -1, 1), (0, 2, 1), (3, 2, 1), (-1, 0, 1), (-1, 1, 1), (4, 0, 1), (4, 1, 1)]
    f = [(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6)]
    surface = shapes.mesh(v, f)
    best = spherical_map(surface, domain="ball")
    assert best.kernel.dimension == 2
    assert best.certificate is not None
    assert any("flat polygon" in note for note in best.notes)


def test_region_candidates_lie_in_the_kernel():
    for name in ("open_hemisphere", "star_prism", "cubes_sharing_an_edge"):
        mesh = mesh_of(getattr(shapes, name)())
        kernel = exact_kernel(mesh)
        planes = voxkernel.halfspaces.HalfSpaces.from_mesh(mesh)
        region = kernel_region(kernel, planes)
        world = region.to_world(region.candidates)
        assert (planes.normals @ world.T - planes.offsets[:, None]).max() < 1e-12


def test_coverage_needs_a_boundary():
    mesh = mesh_of(shapes.cube())
    planes = voxkernel.halfspaces.HalfSpaces.from_mesh(mesh)
    assert coverage_optimum(mesh, kernel_region(exact_kernel(mesh), planes)) is None


# ---------------------------------------------------------------- no kernel, or a centre outside of it


def test_empty_kernel_offers_the_relaxed_centre():
    with pytest.raises(ValueError, match=r"facets [\d, ]+ at once; center=best_center\(surface\).point"):
        spherical_map(shapes.torus())
    seen = spherical_map(shapes.torus(), center="relaxed")
    assert 0 < seen.hidden_fraction < 1
    assert len(seen.folded_facets)
    assert "turned away" in seen.notes[0]
    again = spherical_map(shapes.torus(), center=voxkernel.best_center(shapes.torus()).point)
    assert again.folded_facets.tolist() == seen.folded_facets.tolist()


def test_folded_facets_are_those_violated():
    mesh = mesh_of(shapes.l_prism())
    x = np.array([0.25, 1.75, 0.5])  # inside one arm: the far wall of the other arm is turned away
    seen = spherical_map(mesh, center=x)
    assert seen.hidden_fraction == pytest.approx(voxkernel.violation(mesh, x[None])[0])
    planes = voxkernel.halfspaces.HalfSpaces.from_mesh(mesh)
    wrong = planes.facet_ids[planes.normals @ x > planes.offsets]
    assert seen.folded_facets.tolist() == sorted(set(wrong.tolist()))
    assert seen.clearance < 0
    assert 0 <= seen.hidden_angle_fraction < 1
    assert (seen.triangle_angles < 0).any()


def test_point_in_a_facet_plane_is_exact():
    seen = spherical_map(shapes.l_prism(), center=(0.5, 1.0, 0.5))
    assert seen.clearance == 0
    assert seen.hidden_fraction == 0


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"center": "middle"}, ValueError, "`center` must be a point or one of coverage, .*; got 'middle'"),
        ({"center": [1, 2]}, ValueError, r"`center` must have shape \(n, 3\); got \(1, 2\)"),
        ({"center": [0, 0, np.nan]}, ValueError, "`center` must be finite"),
        ({"clearance": -1}, ValueError, "`clearance` must be >= 0; got -1"),
    ],
)
def test_wrong_options(options, error, match):
    with pytest.raises(error, match=match):
        spherical_map(shapes.cube(), **options)


def test_centre_on_a_vertex_is_noted():
    seen = spherical_map(shapes.cube(), center=(0, 0, 0))
    assert np.isnan(seen.directions[np.flatnonzero(seen.radii == 0)]).all()
    assert "a vertex" in seen.notes[-1]


def test_results_are_frozen():
    seen = spherical_map(shapes.cube())
    for array in (seen.center, seen.directions, seen.radii, seen.triangle_angles, seen.folded_facets):
        assert not array.flags.writeable
    assert repr(seen) == "SphericalMap(center=(0.5, 0.5, 0.5), coverage=1, hidden_fraction=0)"
    assert json.loads(json.dumps(seen.to_dict()))["coverage"] == pytest.approx(1)
    assert "active_facets" in json.dumps(spherical_map(shapes.open_box()).to_dict())


# ---------------------------------------------------------------- grids


@pytest.mark.parametrize("kind", GRIDS)
@pytest.mark.parametrize("n", [1, 2, 5, 16])
def test_grid_weights_fill_the_sphere(kind, n):
    grid = sphere_grid(kind, n)
    assert grid.weights.sum() == pytest.approx(FULL)
    assert len(grid) == len(grid.directions()) == int(np.prod(grid.shape))
    assert np.linalg.norm(grid.directions(), axis=1) == pytest.approx(1)


def test_grids_agree_with_ducc0():
    ducc0 = pytest.importorskip("ducc0")
    for n in (1, 3, 4, 16):
        pixels = ducc0.healpix.Healpix_Base(n, "RING").pix2vec(np.arange(12 * n * n))
        assert sphere_grid("healpix", n).directions() == pytest.approx(pixels, abs=1e-14)
    for kind, name in (("equiangular", "F1"), ("gauss-legendre", "GL")):
        weights = ducc0.sht.get_gridweights(name, 33) / 66
        assert sphere_grid(kind, 33).ring_weights == pytest.approx(weights, abs=1e-15)


def test_healpix_pixels_by_hand():
    # n_side 1: 4 pixels at z = 2/3 from 45 degrees, 4 at z = 0 from 0, 4 at z = -2/3.
    d = sphere_grid("healpix", 1).directions()
    assert d[:, 2] == pytest.approx([2 / 3] * 4 + [0] * 4 + [-2 / 3] * 4)
    assert np.degrees(np.arctan2(d[0, 1], d[0, 0])) == pytest.approx(45)
    assert d[4] == pytest.approx([1, 0, 0])


@pytest.mark.parametrize("kind", GRIDS)
def test_grid_triangles_are_a_sphere(kind):
    grid = sphere_grid(kind, 6)
    points = np.concatenate([grid.directions(), [[0, 0, 1], [0, 0, -1]]])
    facts = voxkernel.TriangleMesh.from_triangles(points, grid_triangles(grid)).facts()
    assert facts.is_closed
    assert facts.is_outward
    assert facts.genus == 0


def test_grid_errors():
    with pytest.raises(ValueError, match="`grid` must be one of 'equiangular', 'gauss-legendre', 'healpix'; got 'hex'"):
        spherical_map(shapes.cube()).sample(grid="hex")
    with pytest.raises(ValueError, match=r"`n` must be in 1\.\.8192; got 0"):
        spherical_map(shapes.cube()).sample(n=0)


# ---------------------------------------------------------------- radii


def brute_radius(mesh, center, directions):
    """Nearest crossing over all triangles (Moeller and Trumbore), closed at the edges."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - center for k in range(3))
    result = np.full(len(directions), np.nan)
    for i, d in enumerate(directions):
        h = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, h)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", -a, h) / det
            q = np.cross(-a, b - a)
            v, t = q @ d / det, np.einsum("ij,ij->i", c - a, q) / det
            hit = (u >= -1e-12) & (v >= -1e-12) & (u + v <= 1 + 1e-12) & (t > 0)
        if hit.any():
            result[i] = t[hit].min()
    return result


@pytest.mark.parametrize("kind", GRIDS)
def test_radii_are_exact(kind):
    for shape, center in (
        (shapes.star_prism(), "deepest"), (shapes.spiky(2), (0, 0, 0)), (shapes.l_prism(), "deepest"),
        (shapes.open_hemisphere(), "deepest"),
    ):  # fmt: skip
        seen = spherical_map(shape, center=center)
        samples = seen.sample(grid=kind, n=12)
        expected = brute_radius(seen.mesh, seen.center, samples.grid.directions())
        same = np.isfinite(expected)
        assert (np.isfinite(samples.radii.reshape(-1)) == same).mean() > 0.99  # rays through the rim may go either way
        both = same & samples.mask.reshape(-1)
        assert samples.radii.reshape(-1)[both] == pytest.approx(expected[both], rel=1e-12)


def test_radii_on_edges_and_corners():
    # Rays of the cube's grid run exactly through edges, face diagonals and corners.
    seen = spherical_map((np.array(shapes.cube()[0]) - 0.5, shapes.cube()[1]), center=(0, 0, 0))
    samples = seen.sample(grid="healpix", n=4)
    d = samples.grid.directions()
    assert samples.mask.all()
    assert samples.radii == pytest.approx(0.5 / np.abs(d).max(axis=1), rel=1e-14)
    assert samples.pole_radii == pytest.approx([0.5, 0.5], abs=1e-15)


def test_single_precision_hits_are_corrected():
    # 80 k triangles, far from the origin: many rays pass a neighbour of the triangle that float32 finds.
    vertices, faces = shapes.spiky(6)
    seen = spherical_map((vertices + 1e4, faces), center=(1e4, 1e4, 1e4))
    samples = seen.sample(n=64)
    d, t = samples.grid.directions(), samples.triangles.reshape(-1)
    p = (seen.mesh.vertices - seen.center)[seen.mesh.faces[t]]
    sides = [np.einsum("ij,ij->i", np.cross(p[:, k], p[:, (k + 1) % 3]), d) for k in range(3)]
    assert samples.mask.all()
    assert np.min(sides) > -1e-15


def test_mask_is_where_the_surface_is_not_seen():
    seen = spherical_map(shapes.open_hemisphere(16, 32), center=(0, 0, 0))
    samples = seen.sample(n=64)
    assert samples.covered == pytest.approx(0.5, abs=0.01)
    z = samples.grid.directions()[:, 2].reshape(samples.radii.shape)
    assert (samples.mask == (z > 0)).all()
    assert np.isnan(samples.pole_radii[1])
    assert (samples.triangles[~samples.mask] == -1).all()
    assert "covered=0.5" in repr(samples)


@pytest.mark.parametrize("kind", GRIDS)
def test_reconstruction_error_falls_as_it_should(kind):
    seen = spherical_map(harmonic_sphere(3, 2, 0.3, 6), center=(0, 0, 0))
    sizes = [6, 12, 24] if kind == "healpix" else [12, 24, 48]
    errors = [seen.error(seen.reconstruct(grid=kind, n=n)) for n in sizes]
    rates = np.log2([[a.hausdorff / b.hausdorff, a.rms / b.rms] for a, b in itertools.pairwise(errors)])
    assert (rates > 1.6).all()
    assert rates[:, 1].mean() == pytest.approx(2, abs=0.15)


def test_reconstruction_error_at_edges_falls_linearly():
    seen = spherical_map(shapes.star_prism(), center="deepest")
    errors = [seen.error(seen.reconstruct(n=n)).hausdorff for n in (16, 64, 256)]
    assert np.log(errors[0] / errors[2]) / np.log(16) == pytest.approx(1, abs=0.3)


def test_reconstruction_is_a_closed_surface_and_error_of_itself_is_zero():
    seen = spherical_map(shapes.spiky(3), center=(0, 0, 0))
    again = seen.reconstruct(n=24)
    assert again.facts().is_closed
    assert again.facts().is_outward
    assert seen.error(seen.mesh) == pytest.approx((0, 0), abs=1e-7)
    shifted = voxkernel.TriangleMesh.from_triangles(shapes.cube()[0] + [0, 0, 0.25], shapes.cube()[1])
    assert spherical_map(shapes.cube()).error(shifted).hausdorff == pytest.approx(0.25, abs=1e-12)


def test_nothing_to_reconstruct():
    tiny = shapes.mesh([(0, 0, 1), (1e-6, 0, 1), (0, 1e-6, 1)], [(0, 1, 2)])
    seen = spherical_map(tiny, center=(0.3, 0.2, 0))
    with pytest.raises(voxkernel.errors.MeshError, match="`radii` must be known at the corners of a triangle; got 0"):
        seen.reconstruct(n=4)
    with pytest.raises(ValueError, match="`radii` must be known in some direction"):
        seen.sample(n=4).harmonics(2)


# ---------------------------------------------------------------- spherical harmonics


@pytest.mark.parametrize(
    ("kind", "n"), [("gauss-legendre", 13), ("equiangular", 13), ("equiangular", 40), ("healpix", 8)]
)
def test_coefficients_come_back(kind, n, rng):
    grid = sphere_grid(kind, n)
    c = rng.normal(size=169)
    d = grid.directions()
    values = sum(c[k * k + k + m] * real_harmonic(k, m, d) for k in range(13) for m in range(-k, k + 1))
    found = fit_harmonics(grid, values, 12, 0.0, np.zeros(3))
    assert found.coefficients == pytest.approx(c, abs=1e-7)
    assert found.rms_residual < 1e-7
    assert found.covered == pytest.approx(1)
    assert found.on_grid(kind, n).reshape(-1) == pytest.approx(values, abs=1e-6)
    assert found.evaluate(3 * d[::7]) == pytest.approx(values[::7], abs=1e-6)


def test_parseval(rng):
    grid = sphere_grid("gauss-legendre", 65)
    found = fit_harmonics(grid, rng.normal(size=grid.shape), 64, 0.0, np.zeros(3))
    values = found.on_grid("gauss-legendre", 65)
    assert found.energies.sum() == pytest.approx((grid.weights * values.reshape(-1) ** 2).sum(), rel=1e-12)
    assert len(found.energies) == 65


def test_transform_agrees_with_ducc0(rng):
    ducc0 = pytest.importorskip("ducc0")
    grid = sphere_grid("gauss-legendre", 65)
    values = rng.normal(size=grid.shape)
    found = fit_harmonics(grid, values, 64, 0.0, np.zeros(3))
    alm = ducc0.sht.analysis_2d(map=values[None], lmax=64, spin=0, geometry="GL")[0]
    size = np.abs(alm) ** 2
    k = 0
    energies = np.zeros(65)
    for m in range(65):
        energies[m:] += size[k : k + 65 - m] * (1 if m == 0 else 2)
        k += 65 - m
    assert found.energies == pytest.approx(energies, rel=1e-10)


@pytest.mark.parametrize(("degree", "m"), [(1, 0), (2, -1), (3, 3), (5, 2)])
def test_known_radial_function(degree, m):
    found = spherical_map(harmonic_sphere(degree, m, 0.2, 5), center=(0, 0, 0)).harmonics(8, n=48)
    expected = np.zeros(81)
    expected[0], expected[degree * degree + degree + m] = FULL**0.5, 0.2  # the constant 1 is sqrt(4 pi) Y_00
    assert found.coefficients == pytest.approx(expected, abs=3e-3)  # flat facets lie a little inside
    finer = spherical_map(harmonic_sphere(degree, m, 0.2, 6), center=(0, 0, 0)).harmonics(8, n=48)
    assert np.abs(finer.coefficients - expected).max() < 0.3 * np.abs(found.coefficients - expected).max()


def test_rotated_surface_has_the_same_energies(rng):
    vertices, faces = shapes.spiky(4, lambda d: 1 + 0.3 * np.sin(3 * d[:, 0]) * d[:, 1] + 0.2 * d[:, 2] ** 3)
    first = spherical_map((vertices, faces), center=(0, 0, 0)).harmonics(16, n=128).energies
    for _ in range(3):
        turned = shapes.moved(vertices, shapes.random_rotation(rng), (3, -1, 2))
        again = spherical_map((turned, faces), center=(3, -1, 2)).harmonics(16, n=128)
        assert again.energies == pytest.approx(first, abs=2e-5)
        assert again.energies[:5] == pytest.approx(first[:5], rel=1e-4)


def test_partial_sphere_is_fitted():
    vertices, faces = harmonic_sphere(2, 1, 0.2, 6)
    upper = mesh_of((vertices, faces)).restricted(np.flatnonzero(vertices[faces].mean(axis=1)[:, 2] > -0.1))
    seen = spherical_map(upper, center=(0, 0, 0))
    found = seen.harmonics(6, n=40, regularisation=1e-9)
    expected = np.zeros(49)
    expected[0], expected[7] = FULL**0.5, 0.2
    assert found.coefficients == pytest.approx(expected, abs=0.02)
    assert 0.5 < found.covered < 0.6
    assert found.rms_residual < 1e-3
    stiff = seen.harmonics(6, n=40, regularisation=1.0)
    assert stiff.energies[1:].sum() < found.energies[1:].sum()
    assert seen.harmonics(6).regularisation == 1e-8
    assert "degree=6" in repr(found)


def test_regularised_quadrature_agrees_with_the_solver(rng):
    grid = sphere_grid("gauss-legendre", 9)
    values = rng.normal(size=grid.shape)
    whole = fit_harmonics(grid, values, 8, 1e-3, np.zeros(3))
    masked = np.where(grid.weights.reshape(grid.shape) > 0, values, np.nan)
    masked[0, 0] = np.nan
    near = fit_harmonics(grid, masked, 8, 1e-3, np.zeros(3))
    assert whole.n_rounds == 0
    assert near.n_rounds > 0
    assert near.coefficients == pytest.approx(whole.coefficients, abs=0.3)
    # The normal equations hold: the gradient of the functional vanishes.
    d, w = grid.directions(), np.where(np.isfinite(masked), grid.weights.reshape(grid.shape), 0).reshape(-1)
    basis = np.stack([real_harmonic(k, m, d) for k in range(9) for m in range(-k, k + 1)], axis=1)
    of = np.repeat(np.arange(9), 2 * np.arange(9) + 1)
    left = basis.T @ (w[:, None] * basis) + 1e-3 * np.diag((of * (of + 1.0)) ** 2)
    exact = np.linalg.solve(left, basis.T @ (w * np.nan_to_num(masked).reshape(-1)))
    assert near.coefficients == pytest.approx(exact, abs=1e-7)


def test_harmonics_errors():
    samples = spherical_map(shapes.cube()).sample(grid="gauss-legendre", n=8)
    with pytest.raises(ValueError, match="`n` must be at least 9 for degree 8 on a gauss-legendre grid; got 8"):
        samples.harmonics(8)
    with pytest.raises(ValueError, match=r"`degree` must be in 0\.\.256; got 300"):
        samples.harmonics(300)
    assert samples.harmonics().degree == 7
    assert np.isnan(samples.harmonics(2).evaluate([[0, 0, 0]])).all()


# ---------------------------------------------------------------- command line and pictures


def test_command_line(tmp_path, capsys):
    surface = tmp_path / "box.ply"
    mesh_of(shapes.open_box()).write(surface)
    out = tmp_path / "map.npz"
    assert main(["sphere", str(surface), "-o", str(out), "-n", "16", "--degree", "4", "--json", "-q"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["coverage"] == pytest.approx(23 / 24)
    assert document["reconstruction"]["rms"] > 0
    with np.load(out) as arrays:
        assert arrays["radii"].shape == arrays["mask"].shape == (16, 32)
        assert arrays["energies"].shape == (5,)
        assert (np.isfinite(arrays["radii"]) == arrays["mask"]).all()
    for name in ("map.json", "map.ply"):
        options = ["--center", "0.5,0.5,0.5", "-o", str(tmp_path / name), "-n", "8", "-q"]
        assert main(["sphere", str(surface), *options]) == 0
        assert (tmp_path / name).stat().st_size > 0
    assert "centre" in capsys.readouterr().out


def test_command_line_without_a_kernel(tmp_path, capsys):
    surface = tmp_path / "torus.ply"
    mesh_of(shapes.torus(n_major=12, n_minor=8)).write(surface)
    assert main(["sphere", str(surface), "-q"]) == 1
    said = capsys.readouterr().err
    assert "empty kernel" in said
    assert "`--center relaxed` takes (" in said
    assert "% of the area" in said
    assert main(["sphere", str(surface), "--center", "relaxed", "-q"]) == 0
    assert "turned away" in capsys.readouterr().out


@pytest.mark.parametrize("options", [["--center", "here"], ["--center", "1,2"], ["-n", "1"], ["--clearance", "-1"]])
def test_command_line_bad_usage(options, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["sphere", "x.ply", *options])
    assert "must be" in capsys.readouterr().err


def test_pictures(tmp_path):
    seen = spherical_map(shapes.open_hemisphere(16, 32), center="deepest")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sphere_picture(tmp_path / "a.png", seen, samples=seen.sample(n=16), title="hemisphere")
        sphere_picture(tmp_path / "a.html", seen, samples=seen.sample(n=16), title="<hemisphere>")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "&lt;hemisphere&gt;" in page
    assert "world map: longitude from +x to +y, latitude towards +z" in page
    with pytest.raises(ValueError, match=r"`path` must end in \.png or \.html; got 'a\.jpg'"):
        sphere_picture(tmp_path / "a.jpg", seen)


# ---------------------------------------------------------------- real faces


def test_smoothed_face(data_dir):
    seen = spherical_map(data_dir / "faces_smooth" / "smooth_ict01_neutral.ply")
    deepest = spherical_map(seen.mesh, center="deepest")
    assert seen.solid_angle > 2 * deepest.solid_angle  # the observation of the paper's figure 4
    assert seen.certificate.residual < 1e-7
    assert seen.hidden_fraction == 0
    assert deepest.sample(n=128).covered == pytest.approx(deepest.coverage, abs=2e-3)


def test_face_without_a_kernel(data_dir):
    seen = spherical_map(data_dir / "faces" / "ict01_neutral.ply", center="relaxed")
    assert 0 < seen.hidden_fraction < 0.04
    assert len(seen.folded_facets) > 100
