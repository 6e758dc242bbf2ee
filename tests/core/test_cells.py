"""The compiled loops of polyhedral cells, beside NumPy and rationals."""

import _thread
import threading

import numpy as np
import pytest
import shapes
from cells import as_cell, hull_cell, sphere_points

from voxkernel._core import StopFlag, orient_cells, solve_cells, squared_diameter
from voxkernel.polyhedral import PolyhedralMesh
from voxkernel.polyhedral.cell_sides import exact_volume

UNDECIDED, CONVEX, SOLID, EMPTY, EMPTY_NEAR = range(5)
IS_OPEN, IS_TURNED, IS_INSIDE_OUT, IS_NOT_FINITE, HAS_BAD_FACE = range(-1, -6, -1)


def arrays_of(*cells):
    mesh = PolyhedralMesh.from_cells([as_cell(cell) for cell in cells])
    flips = mesh.cell_flips.copy()
    return mesh.vertices, mesh.face_offsets, mesh.face_vertices, mesh.cell_offsets, mesh.cell_faces, flips


def rows_for(n):
    return np.zeros(n, np.int64), np.zeros((n, 4)), np.full((n, 3), np.nan), np.full((n, 4), -1, np.int64)


def solved(*cells):
    found = rows_for(len(cells))
    solve_cells(*arrays_of(*cells), 0, len(cells), 1e-9, *found)
    return found


# The six-vertex projective plane: every edge has two faces, and there is no way to turn them alike.
ONE_SIDED = [
    [0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1], [1, 2, 4], [2, 3, 5], [3, 4, 1], [4, 5, 2], [5, 1, 3],
]  # fmt: skip


def test_outcomes():
    vertices, faces = as_cell(shapes.cube())
    known = {
        CONVEX: (vertices, faces),
        SOLID: shapes.l_prism(),
        EMPTY_NEAR: shapes.s_tetromino(-0.25),
        IS_OPEN: (vertices, faces[1:]),
        IS_TURNED: shapes.cube_with_flipped_face(),
        IS_INSIDE_OUT: shapes.inside_out_cube(),
        IS_NOT_FINITE: (vertices + np.inf, faces),
        HAS_BAD_FACE: (vertices, [*faces, [0, 1]]),
        UNDECIDED: shapes.s_tetromino(0.0),
    }
    outcome, numbers, center, witness = solved(*known.values())
    assert outcome.tolist() == list(known)
    solid = {CONVEX, SOLID}
    assert np.isfinite(center).all(axis=1).tolist() == [key in solid for key in known]
    assert (witness >= 0).any(axis=1).tolist() == [key in (EMPTY, EMPTY_NEAR) for key in known]
    np.testing.assert_allclose(numbers[0], [1, 3**0.5, 1, 0.5], rtol=1e-15)  # the unit cube
    np.testing.assert_allclose(center[0], 0.5, rtol=1e-15)
    assert numbers[3, 0] == 3  # edges of the triangle that was left out


def test_tetrahedra(rng):
    """Inradius three times the volume over the area; the kernel is the cell."""
    made = []
    for _ in range(200):
        corners = rng.standard_normal((4, 3))
        if np.linalg.det(corners[1:] - corners[0]) < 0:
            corners = corners[[1, 0, 2, 3]]
        made.append((corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    outcome, numbers, center, _ = solved(*made)
    assert (outcome == CONVEX).mean() > 0.95  # slender ones are left to exact arithmetic
    for (corners, faces), row, point in zip(made, numbers, center, strict=True):
        if not row[2]:
            continue
        a, b, c = (corners[np.array(faces)[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        volume = np.linalg.det(corners[1:] - corners[0]) / 6
        assert row[0] == pytest.approx(volume, rel=1e-9)
        assert row[2] == row[0]
        assert row[3] == pytest.approx(6 * volume / np.linalg.norm(cross, axis=1).sum(), rel=1e-9)
        slack = -np.einsum("ij,ij->i", cross, point - a) / np.linalg.norm(cross, axis=1)
        np.testing.assert_allclose(slack, row[3], rtol=1e-9)


def test_a_witness_names_faces_that_exclude_each_other():
    """Four planes whose normals add up to nothing and whose offsets do not: no point is behind them all."""
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(100):
        points, faces = hull_cell(sphere_points(rng, 12))
        points = points + 0.4 * rng.standard_normal((12, 3))
        outcome, _, _, witness = solved((points, faces))
        if outcome[0] != EMPTY:
            continue
        found += 1
        a, b, c = (points[faces[witness[0], k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        offsets = np.einsum("ij,ij->i", normals, a)
        weights = np.linalg.svd(normals.T)[2][3]
        weights /= weights[np.abs(weights).argmax()]
        assert (weights > 0).all()
        assert weights @ offsets < 0
    assert found > 10


@pytest.mark.parametrize("height", [5e-324, 1e-310, 1e-200])
def test_a_cell_of_almost_no_height_is_left_undecided(height):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.25, 0.25, height]])
    outcome, numbers, _, _ = solved((corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    assert outcome.tolist() == [UNDECIDED]
    assert np.isfinite(numbers).all()


def test_faces_are_turned_outward(rng):
    """Whichever way round the faces are given, every edge is used both ways and the exact volume is positive."""
    cells = [hull_cell(sphere_points(rng, n)) for n in (4, 5, 8, 12, 30, 60)] + [shapes.l_prism(), shapes.torus()]
    arrays = arrays_of(*cells)
    before = arrays[-1].copy()
    for share in (0.0, 0.1, 0.5, 1.0):
        given = [(v, [f[::-1] if rng.random() < share else f for f in np.asarray(faces)]) for v, faces in cells]
        *arrays, flips = arrays_of(*given)
        answer = np.zeros(len(cells), np.int64)
        orient_cells(*arrays, flips, answer)
        assert (answer == 1).all()
        low = 0
        for vertices, faces in given:
            own = [f[::-1] if flip else f for f, flip in zip(faces, flips[low : low + len(faces)], strict=True)]
            low += len(faces)
            edges = {(f[k - 1], f[k]) for f in own for k in range(3)}
            assert len(edges) == 3 * len(own)
            assert {(b, a) for a, b in edges} == edges
            assert exact_volume(np.asarray(vertices, float), np.array(own)) > 0
    assert not before.any()


def test_cells_that_cannot_be_turned_are_left_alone():
    vertices, faces = as_cell(shapes.cube())
    points = np.random.default_rng(1).standard_normal((6, 3))
    *arrays, flips = arrays_of(
        (vertices, faces[1:]), (points, ONE_SIDED), shapes.joined(shapes.cube(), shapes.box((3, 3, 3), (4, 4, 4))),
        (vertices * [1, 1, 0], faces), (vertices * [1, 1, np.nan], faces),
    )  # fmt: skip
    flips[::3] = True
    before, answer = flips.copy(), np.full(5, 9)
    orient_cells(*arrays, flips, answer)
    assert answer.tolist() == [-1, -2, -3, 0, 0]
    low = arrays[3]
    assert (flips[: low[3]] == before[: low[3]]).all()


@pytest.mark.parametrize("n", [0, 1, 2, 5, 6, 7, 8, 9, 200])
def test_diameter(n, rng):
    points = rng.standard_normal((n, 3))
    x, y, z = (points[:, None, k] - points[None, :, k] for k in range(3))
    assert squared_diameter(points) == (x * x + y * y + z * z).max(initial=0.0)


def test_arrays_are_never_converted():
    *arrays, flips = arrays_of(shapes.cube())
    answer, rows = np.zeros(1, np.int64), rows_for(1)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        squared_diameter(np.zeros((4, 3), np.float32))
    with pytest.raises(TypeError, match="incompatible function arguments"):
        squared_diameter(np.zeros((4, 6))[:, ::2])
    with pytest.raises(TypeError, match="incompatible function arguments"):
        squared_diameter(np.zeros((4, 2)))
    with pytest.raises(TypeError, match="incompatible function arguments"):
        orient_cells(*arrays, flips.astype(np.int64), answer)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        orient_cells(*arrays[:4], arrays[4].astype(np.int32), flips, answer)
    for k, array in enumerate(rows):
        array.setflags(write=False)
        with pytest.raises(TypeError, match="incompatible function arguments"):
            solve_cells(*arrays, flips, 0, 1, 1e-9, *rows)
        array.setflags(write=True)
        with pytest.raises(TypeError, match="incompatible function arguments"):
            solve_cells(*arrays, flips, 0, 1, 1e-9, *rows[:k], array.astype(np.float32), *rows[k + 1 :])
    flips.setflags(write=False)
    solve_cells(*arrays, flips, 0, 1, 1e-9, *rows)  # the flips are only read here
    with pytest.raises(TypeError, match="incompatible function arguments"):
        orient_cells(*arrays, flips, answer)


def test_a_flag_stops_the_cells():
    vertices, face_offsets, face_vertices, _, cell_faces, flips = arrays_of(shapes.cube())
    n = 500_000
    cell_offsets = np.arange(n + 1) * len(flips)
    stop = StopFlag()
    stop.set()
    with pytest.raises(KeyboardInterrupt):
        solve_cells(
            vertices, face_offsets, face_vertices, cell_offsets, np.tile(cell_faces, n), np.tile(flips, n),
            0, n, 1e-9, *rows_for(n), stop,
        )  # fmt: skip


def test_an_interrupt_stops_one_large_cell():
    points = np.random.default_rng(2).standard_normal((300_000, 3))  # 4.5e10 pairs
    timer = threading.Timer(0.2, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        squared_diameter(points)
    timer.join()
