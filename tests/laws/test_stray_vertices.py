"""Vertices that no facet refers to count nowhere: every answer is the same to the last bit."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.demo_shapes import face
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh

STRAYS = [(1e6, -1e6, 1e6), (0.1, 0.1, 0.1), (3e-280, 0, 1e190)]
MAKERS = {
    "closed": lambda: shapes.spiky(1),
    "open": lambda: shapes.open_hemisphere(4, 8),
    "convex": lambda: shapes.icosphere(1),
    "empty": lambda: shapes.torus(n_major=10, n_minor=6),
}


def pair(make, stray=STRAYS[0]):
    vertices, faces = make()
    return voxkernel.as_mesh((vertices, faces)), voxkernel.as_mesh((np.concatenate([vertices, [stray]]), faces))


def same(one, two, *names):
    for name in names:
        a, b = getattr(one, name), getattr(two, name)
        assert np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f"), name


@pytest.fixture(params=MAKERS.values(), ids=list(MAKERS))
def surfaces(request):
    return pair(request.param)


@pytest.mark.parametrize("stray", STRAYS)
@pytest.mark.parametrize("make", MAKERS.values(), ids=list(MAKERS))
def test_half_spaces_and_exact_kernel(make, stray):
    plain, strayed = pair(make, stray)
    names = "local_normals", "local_offsets", "local_errors", "weights", "origin", "scale", "bounds_volume"
    same(HalfSpaces.from_mesh(plain), HalfSpaces.from_mesh(strayed), *names, "lattice_unit")
    same(
        *(voxkernel.exact_kernel(m) for m in (plain, strayed)), "dimension", "vertices", "face_starts",
        "face_vertices", "face_facets", "volume", "volume_bounds", "area", "centroid", "inertia", "deepest_point",
        "clearance", "max_residual",
    )  # fmt: skip


def test_half_spaces_of_polygons():
    vertices, polygons = shapes.truncated_octahedron()
    more = np.concatenate([vertices, [STRAYS[0]]])
    one, two = (HalfSpaces.from_mesh(TriangleMesh.from_polygons(v, polygons)) for v in (vertices, more))
    same(one, two, "local_normals", "local_offsets", "local_errors", "weights", "origin", "scale", "lattice_unit")


@pytest.mark.parametrize(
    ("domain", "tolerance", "frame"), [(None, 0.0, "world"), ("hull", 0.2, "world"), ("box", 0.0, "principal")]
)
def test_voxel_kernels(surfaces, domain, tolerance, frame):
    one, two = (
        voxkernel.voxel_kernel(m, depth=4, domain=domain, tolerance=tolerance, frame=frame) for m in surfaces
    )
    same(one, two, "active_voxel_count", "volume_bounds", "dimension", "active_bbox")
    same(one.inside, two.inside, "origin", "voxel_size")


def test_violation_and_its_least_point(surfaces):
    points = np.random.default_rng(3).uniform(-1, 1, (50, 3))
    values = [voxkernel.violation(m, points) for m in surfaces]
    assert (values[0] == values[1]).all()
    same(*(voxkernel.best_center(m) for m in surfaces), "point", "violation_bounds", "n_cells")


def test_scores(surfaces):
    same(*(voxkernel.starshapeness(m) for m in surfaces), "violation_bounds", "center")
    one, two = (voxkernel.defect_profile(m, depth=4) for m in surfaces)
    same(one, two, *(n for n in type(one).__dataclass_fields__ if n != "domain"))


def test_maps_and_points(surfaces):
    kernels = [voxkernel.exact_kernel(m) for m in surfaces]
    center = "relaxed" if kernels[0].is_empty else "coverage"
    one, two = (voxkernel.spherical_map(m, center=center) for m in surfaces)
    same(one, two, "center", "solid_angle", "triangle_angles", "hidden_fraction", "clearance", "distortion")
    assert (one.radii == two.radii[:-1]).all()
    if not kernels[0].is_empty:
        points = [voxkernel.kernel_points(k, n_points=50) for k in kernels]
        same(*points, "interior", "interior_weights", "boundary", "boundary_weights")


def test_facts(surfaces):
    one, two = (m.facts() for m in surfaces)
    same(one, two, "bbox", "diagonal", "area", "volume", "area_centroid", "genus", "euler_characteristic")
    assert two.n_unreferenced_vertices == one.n_unreferenced_vertices + 1


def test_registration():
    surface = face(rings=8, sectors=16)
    plain, strayed = pair(surface.to_arrays)
    turn = shapes.random_rotation(np.random.default_rng(5))
    target = voxkernel.as_mesh((surface.vertices @ turn.T, surface.faces))
    one, two = (voxkernel.register(m, target) for m in (plain, strayed))
    same(one, two, "T_target_source", "fitness", "inlier_rmse")
    one, two = (voxkernel.register(target, m) for m in (plain, strayed))
    same(one, two, "T_target_source", "fitness", "inlier_rmse")


def test_pictures(surfaces):
    from voxkernel.pictures.scene import make_scene

    one, two = (make_scene(m, None) for m in surfaces)
    same(one, two, "vertices", "faces", "surface_lines", "view", "up", "diagonal")
