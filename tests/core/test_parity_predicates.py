"""The compiled predicates, edges, coplanar groups and linear programs next to their Numba twins, bit for bit.

This file goes when Numba goes.
"""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import _core, demo_shapes
from voxkernel._loops import convexity, coplanar, linear_program, planes
from voxkernel._polygons import used_vertices, without_strays
from voxkernel.halfspaces import HalfSpaces

MAKERS = [
    shapes.tetrahedron, shapes.cube, shapes.octahedron, shapes.l_prism, shapes.star_prism, shapes.plus_cross,
    shapes.s_tetromino, shapes.notched_cube, shapes.two_boxes, shapes.crossing_boxes, shapes.icosphere, shapes.spiky,
    shapes.uv_sphere, shapes.ellipsoid, shapes.torus, shapes.height_field, shapes.open_hemisphere, shapes.open_box,
    shapes.cubes_sharing_an_edge, shapes.three_faces_on_an_edge, shapes.cube_with_flipped_face,
    shapes.inside_out_cube, shapes.moebius_band,
]  # fmt: skip
DEMOS = [demo_shapes.gem, demo_shapes.star_prism, demo_shapes.face, demo_shapes.torus, demo_shapes.comet]


def real_meshes(data_dir):
    files = sorted(p for p in data_dir.rglob("*") if p.suffix in (".ply", ".off", ".obj") and p.stat().st_size < 4e6)
    return files[:: max(1, len(files) // 8)]


@pytest.fixture(scope="module")
def meshes(data_dir):
    made = [voxkernel.as_mesh(make()) for make in MAKERS] + [make() for make in DEMOS]
    made += [voxkernel.as_mesh(shapes.subdivided(*m.to_arrays())) for m in made[:6]]
    for file in real_meshes(data_dir):
        try:
            made.append(voxkernel.as_mesh(file))
        except voxkernel.VoxKernelError:
            continue
    return made


def test_planes(meshes):
    for mesh in meshes:
        n = len(mesh.plane_corners)
        low, high, smallest = planes.coordinate_range(used_vertices(mesh.vertices, mesh.faces))
        new = _core.coordinate_range(*without_strays(mesh.vertices, mesh.faces))
        assert (new[0] == low).all()
        assert (new[1] == high).all()
        assert new[2] == smallest
        filled = []
        for facet_planes in (planes.facet_planes, _core.facet_planes):
            out = np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)
            undecided = facet_planes(mesh.vertices, mesh.plane_corners, 0.5 * (low + high), 0.25, *out)
            filled.append((np.array(undecided), *out))
        for old, core in zip(*filled, strict=True):
            assert old.tobytes() == core.tobytes()
        arguments = mesh.faces, len(mesh.vertices)
        assert _core.boundary_is_zero(*arguments) == planes.boundary_is_zero(*arguments)


def test_predicates(rng):
    points = rng.integers(-3, 4, (3000, 4, 3)) * 1.0
    scaled = points * 2.0 ** rng.integers(-200, 200, points.shape)
    points = np.concatenate([points, points / 3, scaled, points + 1e9 / 7])
    exact, filtered = _core.orient3d_exact(points), _core.orientations(points)
    for i, p in enumerate(points):
        assert exact[i] == coplanar.orient3d_exact(*p)
        assert filtered[i] == convexity.orientation(*p)


def test_edges(meshes):
    for mesh in meshes:
        twins = convexity.halfedge_twins(mesh.faces, len(mesh.vertices))
        assert (_core.halfedge_twins(mesh.faces, len(mesh.vertices)) == twins).all()
        arguments = mesh.vertices, mesh.faces, twins, np.arange(len(mesh.faces)), mesh.faces
        assert _core.edge_convexity(*arguments) == convexity.edge_convexity(*arguments)


def coplanar_groups_of_numba(half):
    keys = half.local_normals @ np.array([0.4142135, 0.7320508, -0.2360679]) + 0.6457513 * half.local_offsets
    order = np.argsort(keys, kind="stable")
    groups = np.empty(len(half), np.int64)
    coplanar.coplanar_groups(
        half.local_normals, half.local_offsets, half.vertices, half.corner_ids(), order, keys[order], 1e-11, groups
    )
    first = np.full(len(half), len(half))
    np.minimum.at(first, groups, np.arange(len(half)))
    return first[groups]


def test_coplanar_groups(meshes):
    for mesh in meshes:
        half = HalfSpaces.from_mesh(mesh)
        for some in (half, half.with_planes(np.eye(3), np.ones(3))):
            arrays = some.local_normals, some.local_offsets, some.vertices, some.corner_ids()
            assert (_core.coplanar_groups(*arrays) == coplanar_groups_of_numba(some)).all(), mesh.source


def deepest(module, half, rows, box):
    basis, multipliers, point = np.array([1, 3, 5, 6]), np.zeros(4), np.zeros(4)
    steps = []
    for _ in range(2):  # the second starts where the first one ended
        arguments = (half.local_normals, half.local_offsets, rows)
        arguments += (len(rows),) if module is linear_program else ()
        steps.append(module.deepest_point(*arguments, box, basis, multipliers, point, 1e-15 * box, 400))
    return steps, basis, multipliers, point


def test_deepest_point(meshes, rng):
    for mesh in meshes:
        half = HalfSpaces.from_mesh(mesh)
        for box in (4.0, 2.0**12, 2.0**26):
            rows = np.arange(0, len(half), 1 + len(half) // 300)
            for some in (rows, np.sort(rng.choice(len(half), min(20, len(half)), replace=False))):
                old, new = (deepest(module, half, some, box) for module in (linear_program, _core))
                assert old[0] == new[0]
                for u, v in zip(old[1:], new[1:], strict=True):
                    assert u.tobytes() == v.tobytes()


def test_passes(meshes, rng):
    for mesh in meshes:
        half = HalfSpaces.from_mesh(mesh)
        arrays = half.local_normals, half.local_offsets, half.local_errors
        for limit in (np.inf, 0.1):
            point = rng.uniform(-0.3, 0.3, 3)
            filled = []
            for module in (linear_program, _core):
                ids, slacks = np.empty(_core.N_BINS, np.int64), np.empty(_core.N_BINS)
                found = module.tightest_by_direction(*arrays, point, limit, ids, slacks)
                filled.append((found, ids.tobytes(), slacks.tobytes()))
            assert filled[0] == filled[1]
            undecided = np.empty(len(half), np.int64)
            count = linear_program.plane_signs(*arrays, point, 1e-9, undecided)
            assert (_core.plane_signs(*arrays, point, 1e-9) == undecided[:count]).all()
