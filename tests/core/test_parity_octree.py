"""The octrees, the centre search, the field and the violation of points beside their Numba twins: bit for bit."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel import _core
from voxkernel._cube import cube_planes, root_cube
from voxkernel._loops import center, field, octree, relaxed
from voxkernel._loops import violation as sums_of_points
from voxkernel._relaxed import cube_arrays
from voxkernel._weights import UNITS, relaxed_domain, weigh
from voxkernel.demo_shapes import comet, face, gem, torus, urchin
from voxkernel.halfspaces import HalfSpaces

SHAPES = {
    **{
        f.__name__: f
        for f in (
            shapes.cube, shapes.tetrahedron, shapes.l_prism, shapes.star_prism, shapes.s_tetromino, shapes.spiky,
            shapes.torus, shapes.icosphere, shapes.height_field, shapes.open_box, shapes.two_boxes,
            shapes.notched_cube, shapes.moebius_band, shapes.inside_out_cube, shapes.crossing_boxes,
        )
    },
    "turned cube": lambda: _turned(shapes.cube(), 1e-9),
    "turned prism": lambda: _turned(shapes.star_prism(), 0.4),
    "far away": lambda: (shapes.spiky()[0] + 1e4, shapes.spiky()[1]),
    "tiny": lambda: (shapes.spiky()[0] * 1e-12, shapes.spiky()[1]),
    "thin": lambda: (shapes.spiky()[0] * [1.0, 1.0, 1e-6], shapes.spiky()[1]),
    "soup": lambda: _soup(40),
    "demo gem": gem, "demo torus": torus, "demo comet": comet, "demo face": lambda: face(0.3), "demo urchin": urchin,
}  # fmt: skip
REAL = ("faces/ict01_neutral", "closed/common3d_cow", "asteroids/churyumov-gerasimenko")


def _turned(surface, angle):
    c, s = np.cos(angle), np.sin(angle)
    about_z, about_x = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return surface[0] @ about_z @ about_x, surface[1]


def _soup(n):
    return np.random.default_rng(3).normal(size=(3 * n, 3)), np.arange(3 * n).reshape(-1, 3)


def assert_same(twin, new):
    for i, (a, b) in enumerate(zip(twin, new, strict=True)):
        if isinstance(a, np.ndarray):
            assert (a.dtype, a.shape) == (b.dtype, b.shape), i
            assert a.tobytes() == b.tobytes(), i
        else:
            assert a == b, i


def _check(mesh, depths):
    planes = weigh(HalfSpaces.from_mesh(mesh))
    domain = relaxed_domain(planes.is_closed, mesh, None)
    cube, _ = root_cube(domain.vertices, np.eye(3))
    for depth in depths:
        arrays = cube_planes(HalfSpaces.from_mesh(mesh).merged(), root_cube(mesh.vertices, np.eye(3))[0], depth)
        for count_only in (False, True):
            assert_same(octree.exact_cells(*arrays, depth, count_only), _core.exact_cells(*arrays, depth, count_only))
        normals, offsets, reach, pads, weights, n = cube_arrays(planes, domain, cube, depth)
        padded = reach + pads * 2.0 ** (depth + 1)
        _check_relaxed(normals, offsets, padded, weights, n, depth, *planes.thresholds([0.0, 0.03, 0.2, 0.5, 1.0]))
        for most in (UNITS // 10, UNITS // 3):
            args = normals, offsets, padded, weights, n, most, float(UNITS), depth
            assert_same(field.violation_cells(*args), _core.violation_cells(*args))
    arrays = cube_arrays(planes, domain, cube, 42)
    for levels, gap, ratio, count in ((6, UNITS // 10_000, 0.0, 10**6), (12, 0, 0.1, 3000), (20, 0, 0.0, 3000)):
        found = []
        for module in (center, _core):
            point, cell = np.full(3, np.nan), np.full(4, np.nan)
            best = module.least_violated(*arrays, 1e-15, UNITS, gap, ratio, levels, count, point, cell)
            found.append((*map(int, best), point, cell))
        assert_same(*found)


def _check_relaxed(normals, offsets, padded, weights, n, depth, ins, outs):
    numbers = np.column_stack([normals, padded, 0.5 * normals.sum(axis=1) - offsets])
    every, root = np.array([0, len(ins)]), np.zeros(3, np.int64)
    for count_only, stop in ((True, 99), (False, 99), (False, 1)):
        args = numbers, weights, n, 0, ins, outs, every, depth, -1, root, stop, count_only
        twin = relaxed.relaxed_cells(*args)
        assert_same(twin, _core.relaxed_cells(*args))
        if stop > depth - 4:
            continue
        *_, pending, listed, listed_weights = twin
        for row in pending[:4]:
            first, middle, end, certain = row[3:7].tolist()
            args = listed[first:end], listed_weights[first:end], middle - first, certain, ins, outs, row[7:], depth, 1
            assert_same(
                relaxed.relaxed_cells(*args, row[:3], 99, False), _core.relaxed_cells(*args, row[:3], 99, False)
            )


@pytest.mark.parametrize("name", SHAPES)
def test_cells_of_shapes(name):
    mesh = voxkernel.as_mesh(SHAPES[name]())
    _check(mesh, (3, 4, 6) if len(mesh.faces) < 3000 else (5,))


@pytest.mark.parametrize("name", REAL)
def test_cells_of_real_meshes(data_dir, name):
    _check(voxkernel.as_mesh(data_dir / f"{name}.ply"), (5,))


def _point_sums(module, planes, points, by_expansions):
    facets = planes.facets
    with np.errstate(over="ignore", invalid="ignore"):
        local = np.ascontiguousarray(facets.to_local(points).T)
    order, sums = np.arange(len(points)), np.zeros(len(points), np.int64)
    arrays = facets.local_normals, facets.local_offsets, facets.local_errors, planes.weights
    pairs = module.violated_weights(
        local, points, *arrays, facets.corner_ids(), facets.vertices, by_expansions, order, sums
    )
    return pairs, order, sums


@pytest.mark.parametrize("name", SHAPES)
def test_points(name, rng):
    mesh = voxkernel.as_mesh(SHAPES[name]())
    planes, v = weigh(HalfSpaces.from_mesh(mesh)), mesh.vertices
    near = [rng.normal(size=(500, 3)) * np.abs(v).max(), np.concatenate([v, 0.5 * (v[:-1] + v[1:])])[:2000]]
    near += [np.empty((0, 3)), np.zeros((40, 3)), v[:1]]
    for points in near:
        for by_expansions in (True, False):
            args = planes, points, by_expansions
            assert_same(_point_sums(sums_of_points, *args), _point_sums(_core, *args))
    huge = np.array([[1e300, 0, 0], [0, 1e308, 1e308], [0, 0, 0]] * 5, float)
    assert_same(_point_sums(sums_of_points, planes, huge, False), _point_sums(_core, planes, huge, False))
    for point in (v[0], v.mean(axis=0), v[mesh.faces[0]].mean(axis=0)):
        args = mesh.vertices, mesh.faces, point
        assert (sums_of_points.faces_away(*args) == _core.faces_away(*args)).all()
