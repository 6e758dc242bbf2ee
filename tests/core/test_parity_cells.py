"""The compiled loops of polyhedral cells give the bits of their Numba twins."""

import numpy as np
import pytest
import shapes
from test_polyhedral import (
    CLOSED,
    as_cell,
    bent_cell,
    crumpled_cell,
    cube_grid,
    hull_cell,
    mixed_cells,
    sphere_points,
    star_cell,
    voronoi_like_cell,
)

from voxkernel import _core
from voxkernel._loops import cell_planes, cell_sides, cells
from voxkernel.polyhedral import PolyhedralMesh, read_polyhedral


def arrays_of(mesh):
    return mesh.vertices, mesh.face_offsets, mesh.face_vertices, mesh.cell_offsets, mesh.cell_faces, mesh.cell_flips


def assert_same_bits(mesh, rtol=1e-9):
    n = len(mesh)
    answers = []
    for solve_cells in (cells.solve_cells, _core.solve_cells):
        found = np.zeros(n, np.int64), np.zeros((n, 4)), np.full((n, 3), np.nan), np.full((n, 4), -1, np.int64)
        solve_cells(*arrays_of(mesh), 0, n // 2, rtol, *found)
        solve_cells(*arrays_of(mesh), n // 2, n, rtol, *found)
        answers.append(found)
    for one, two in zip(*answers, strict=True):
        np.testing.assert_array_equal(two.view(np.int64), one.view(np.int64))
    *arrays, flips = arrays_of(mesh)
    turned = np.random.default_rng(5).random(len(flips)) < 0.5
    for start in (flips, turned):
        sides = [(start.copy(), np.zeros(n, np.int64)) for _ in range(2)]
        cell_sides.orient_cells(*arrays, *sides[0])
        _core.orient_cells(*arrays, *sides[1])
        for one, two in zip(*sides, strict=True):
            np.testing.assert_array_equal(two, one)
    return answers[0][0]


def test_random_cells(rng):
    made = mixed_cells(rng)
    made += [crumpled_cell(rng, n) for n in (5, 8, 12, 20) for _ in range(20)]
    made += [bent_cell(rng, n, 10.0**-k) for n in (8, 20) for k in range(1, 16)]
    made += [hull_cell(sphere_points(rng, 100)), hull_cell(sphere_points(rng, 140)), voronoi_like_cell(rng, 100)]
    made += [star_cell(rng, n, 0.7) for n in (40, 80, 120)]
    mesh = PolyhedralMesh.from_cells([as_cell(cell) for cell in made])
    for rtol in (0.0, 1e-9, 1e-3):
        outcome = assert_same_bits(mesh, rtol)
    assert {0, 1, 2, 3} <= set(outcome.tolist())


def test_shapes():
    made = [shapes.KNOWN[name][0]() for name in CLOSED]
    made += [shapes.s_tetromino(slit) for slit in (0.25, 1e-3, 1e-9, -1e-9, -1e-3, -0.25)]
    made += [shapes.notched_cube_polygons(slit) for slit in (0.25, 1e-9, 0.0, -1e-9, -0.25)]
    made += [shapes.open_box(), shapes.open_hemisphere(), shapes.cube_with_flipped_face(), shapes.inside_out_cube()]
    made += [shapes.moebius_band(), shapes.three_faces_on_an_edge(), shapes.icosphere(2), shapes.spiky(1)]
    made += [shapes.torus(n_major=8, n_minor=6), shapes.uv_sphere(), shapes.ellipsoid(subdivisions=1)]
    vertices, faces = as_cell(shapes.l_prism())
    made += [(np.ldexp(vertices, power), faces) for power in (-1060, -400, -190, -150, 149, 150, 160, 400, 1020)]
    made += [(vertices + 2.0**power, faces) for power in (20, 40, 52, 60)]
    made += [(vertices * [1, 1, size], faces) for size in (1e-8, 1e-16, 1e-100, 5e-324, 1e8, 1e100)]
    made += [(vertices * [1, np.nan, 1], faces), (vertices + np.inf, faces), (vertices * 0.0, faces)]
    outcome = assert_same_bits(PolyhedralMesh.from_cells([as_cell(shape) for shape in made]))
    assert {-4, -3, -2, -1, 0, 1, 2, 4} <= set(outcome.tolist())


def test_shared_faces():
    vertices, faces, own = cube_grid(4)
    mesh = PolyhedralMesh.from_faces(
        vertices, [*faces, [0, 1]], [*own, own[0][1:], [*own[0], *own[-1]], [], [len(faces)]]
    )
    assert_same_bits(mesh)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e12])
def test_integer_soups(scale, rng):
    """Repeated corners, flat faces, edges used four times: whatever a cell may be."""
    made = []
    for _ in range(300):
        n = int(rng.integers(4, 9))
        vertices, faces = rng.integers(-2, 3, (n, 3)) * scale, []
        for _ in range(int(rng.integers(4, 9))):
            faces.append(rng.integers(0, n, int(rng.integers(3, 7))).tolist())
        made.append((vertices, faces))
        # Each face once more the other way round: closed, without volume.
        made.append((vertices, [*faces, *[face[::-1] for face in faces]]))
        points, hull = hull_cell(sphere_points(rng, n))
        made.append((np.rint(points * 2) * scale, hull))
    assert_same_bits(PolyhedralMesh.from_cells([as_cell(cell) for cell in made]))


@pytest.mark.parametrize(
    "name",
    [
        "sorgente_tet20_cells", "sorgente_voro_cells", "cinolib_eight_voronoi.hedra", "cinolib_sphere.mesh",
        "libigl_bunny_tet.mesh",
    ],
)  # fmt: skip
def test_real_meshes(name, data_dir):
    assert_same_bits(read_polyhedral(data_dir / "polyhedral" / name))


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4, 5, 8, 9, 100, 1001])
def test_diameter(n, rng):
    points = rng.standard_normal((n, 3))
    assert _core.squared_diameter(points) == cell_planes.squared_diameter(points, n)
