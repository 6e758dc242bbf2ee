"""Kernels of the cells of polyhedral meshes: the batch agrees with `exact_kernel`, whatever decided a cell."""

import csv
import re
from itertools import product

import numpy as np
import oracle
import pytest
import shapes
from cells import as_cell, hull_cell, sphere_points, voronoi_like_cell
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel import TriangleMesh, exact_kernel, starshapeness
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.halfspaces import HalfSpaces, find_feasibility
from voxkernel.pictures import cells_picture
from voxkernel.polyhedral import PolyhedralMesh, cell_kernels, is_polyhedral, read_polyhedral


def solved(*cells, **options):
    return cell_kernels(PolyhedralMesh.from_cells([as_cell(c) for c in cells]), **options)


def assert_agrees(mesh, found):
    """Every cell against `exact_kernel` of that cell alone."""
    assert len(mesh) == len(found)
    for i in range(len(mesh)):
        assert not found.reasons[i], (i, found.reasons[i])
        surface = mesh.cell(i)
        kernel = exact_kernel(surface)
        assert kernel.dimension == found.dimension[i], i
        assert found.kernel_volume[i] == pytest.approx(kernel.volume, rel=1e-9, abs=0), i
        assert found.volume[i] == pytest.approx(
            float(oracle.enclosed_volume(surface.vertices, surface.faces)), rel=1e-9
        )
        if kernel.dimension == 3:
            assert found.inradius[i] == pytest.approx(kernel.clearance, rel=1e-9, abs=0)
            slack = exact_slack(surface, found.center[i])
            assert slack == pytest.approx(found.inradius[i], rel=1e-6)
        else:
            assert found.inradius[i] == 0
            assert np.isnan(found.center[i]).all() == (kernel.dimension < 0)
        points = surface.vertices
        diameter = np.sqrt(((points[:, None] - points[None]) ** 2).sum(-1).max())
        assert found.diameter[i] == pytest.approx(diameter, rel=1e-12)
        assert 0 <= found.volume_share[i] <= 1
        assert found.is_star_shaped[i] == (kernel.dimension == 3)


def exact_slack(surface, point):
    a, b, c = (surface.vertices[surface.plane_corners[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    keep = length > 0
    return float((np.einsum("ij,ij->i", normals, a - point)[keep] / length[keep]).min())


# ---------------------------------------------------------------- families by formula


def star_cell(rng, n, low):
    points, faces = hull_cell(sphere_points(rng, n))
    return points * rng.uniform(low, 1.0, n)[:, None], faces


def crumpled_cell(rng, n):
    """A closed surface with moved corners, most often without a kernel."""
    points, faces = hull_cell(sphere_points(rng, n))
    while True:
        moved = points + 0.4 * rng.standard_normal((n, 3))
        if oracle.enclosed_volume(moved, faces) > 0:
            return moved, faces


def bent_cell(rng, n, amount):
    """A Voronoi-like cell with its vertices moved: no face is planar."""
    vertices, polygons = voronoi_like_cell(rng, n)
    return vertices * (1 + amount * rng.standard_normal((len(vertices), 1))), polygons


def mixed_cells(rng):
    cells = [hull_cell(sphere_points(rng, 12)) for _ in range(10)]
    cells += [voronoi_like_cell(rng, 14) for _ in range(10)]
    cells += [star_cell(rng, n, low) for n, low in product((8, 12, 20), (0.9, 0.7, 0.5, 0.2)) for _ in range(5)]
    cells += [bent_cell(rng, 12, amount) for amount in (1e-12, 1e-9, 1e-6, 1e-3, 1e-2) for _ in range(5)]
    return cells


def test_random_cells(rng):
    mesh = PolyhedralMesh.from_cells(mixed_cells(rng))
    found = cell_kernels(mesh)
    assert_agrees(mesh, found)
    assert {"convex", "interior point", "witness"} <= set(found.decided_by)
    assert found.decided_by.count("exact") < len(mesh) / 5


def test_witnesses_hold_exactly(rng):
    """The faces named for an empty kernel exclude each other, decided in rationals."""
    cells = [crumpled_cell(rng, n) for n in (12, 20) for _ in range(10)]
    cells += [shapes.s_tetromino(-0.25), shapes.notched_cube(-0.25), shapes.torus(n_major=8, n_minor=6)]
    mesh = PolyhedralMesh.from_cells([as_cell(c) for c in cells])
    found = cell_kernels(mesh)
    assert found.decided_by[-3:] == ("witness nearby",) * 3
    empty = [i for i in range(len(mesh)) if found.decided_by[i] == "witness"]
    assert_agrees(mesh, found)
    assert len(empty) > 5
    for i in empty:
        planes = HalfSpaces.from_mesh(mesh.cell(i))
        chosen = planes.select(np.isin(planes.facet_ids, found.facets[i]))
        assert find_feasibility(chosen).dimension == -1


@pytest.mark.parametrize("power", range(1, 17, 3))
def test_turned_thin_kernels(power, rng):
    """Kernels about 10**-k thick, or missed by that much, in general position: only the doubles know."""
    slits = (10.0**-power, -(10.0**-power), 0.0)
    cells = []
    for slit in slits:
        for vertices, faces in (shapes.s_tetromino(slit), shapes.notched_cube_polygons(slit)):
            turned = shapes.moved(np.asarray(vertices), shapes.random_rotation(rng), rng.standard_normal(3))
            cells.append((turned, [list(map(int, f)) for f in faces]))
    mesh = PolyhedralMesh.from_cells(cells)
    found = cell_kernels(mesh)
    for i in range(len(mesh)):
        kernel = exact_kernel(mesh.cell(i))
        assert kernel.dimension == found.dimension[i]
        assert found.kernel_volume[i] == pytest.approx(kernel.volume, rel=1e-9, abs=0)


CLOSED = [
    "cube", "tetrahedron", "octahedron", "l_prism", "star_prism", "plus_cross", "s_tetromino", "s_tetromino_open",
    "s_tetromino_shut", "saw_prism", "notched_cube", "notched_cube_open", "notched_cube_shut", "two_boxes",
    "crossing_boxes", "truncated_octahedron", "torus", "cubes_sharing_an_edge",
]  # fmt: skip


def test_known_kernels():
    """Kernels of every dimension, written down by hand."""
    known = [shapes.KNOWN[name] for name in CLOSED]
    mesh = PolyhedralMesh.from_cells([as_cell(make()) for make, _ in known])
    found = cell_kernels(mesh)
    assert found.dimension.tolist() == [kernel.dimension for _, kernel in known]
    np.testing.assert_allclose(found.kernel_volume, [kernel.volume for _, kernel in known], rtol=1e-12)
    assert set(found.dimension.tolist()) == {-1, 0, 1, 2, 3}
    assert_agrees(mesh, found)
    for i in np.flatnonzero(found.dimension < 3):
        score = starshapeness(mesh.cell(int(i)))
        assert found.to_rows()[i]["verdict"] == score.verdict
        assert len(found.facets[i]) > 0


def test_polygon_faces_keep_their_planes():
    cells = [shapes.notched_cube_polygons(slit) for slit in (-0.25, 0.0, 0.25)]
    cells += [shapes.truncated_octahedron(), shapes.prism_polygons([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])]
    mesh = PolyhedralMesh.from_cells(cells)
    found = cell_kernels(mesh)
    assert found.dimension.tolist() == [-1, 0, 3, 3, 3]
    assert found.volume_share[3] == 1.0
    assert found.n_faces.tolist() == [12, 12, 12, 14, 8]
    assert_agrees(mesh, found)


def test_convex_cells_are_their_own_kernels():
    found = solved(shapes.cube(), shapes.octahedron(), shapes.tetrahedron(), shapes.icosphere(1), shapes.l_prism())
    assert found.volume_share[:4].tolist() == [1.0] * 4
    assert found.decided_by[:4] == ("convex",) * 4
    assert (found.kernel_volume[:4] == found.volume[:4]).all()
    assert found.volume_share[4] == pytest.approx(1 / 3)
    assert found.inradius[0] == pytest.approx(0.5)
    assert found.inradius_over_diameter[0] == pytest.approx(0.5 / 3**0.5)


def test_a_doubled_cell_is_not_its_own_kernel():
    """Every face twice: the enclosed volume counts twice, the kernel once, as in `starshapeness`."""
    vertices, faces = shapes.cube()
    twice = vertices, np.concatenate([faces, faces])
    found = solved(twice)
    assert found.volume_share[0] == pytest.approx(0.5)
    assert starshapeness(twice).ratio == pytest.approx(0.5)


@pytest.mark.parametrize("power", range(1, 17))
def test_thin_kernels(power):
    """Kernels 10**-k thick: floating point hands over to rationals somewhere on the way."""
    slit = 10.0**-power
    mesh = PolyhedralMesh.from_cells([as_cell(shapes.s_tetromino(s)) for s in (slit, -slit)])
    found = cell_kernels(mesh)
    assert found.dimension.tolist() == [3, -1]
    assert found.kernel_volume[0] == pytest.approx(slit, rel=1e-9)
    assert found.inradius[0] == pytest.approx(slit / 2, rel=1e-6)


@settings(max_examples=60)
@given(st.lists(shapes.integer_meshes(), min_size=1, max_size=3))
def test_integer_meshes_agree_with_rationals(meshes):
    found = solved(*meshes)
    for i, (vertices, faces) in enumerate(meshes):
        surface = TriangleMesh.from_triangles(vertices, faces)
        directed = {}
        for face in faces.tolist():
            for a, b in zip(face, face[1:] + face[:1], strict=True):
                directed[a, b] = directed.get((a, b), 0) + 1
        is_closed = all(n == directed.get((b, a), 0) for (a, b), n in directed.items() if a != b)
        if not is_closed:
            assert found.reasons[i].startswith(("open", "inconsistent"))
            continue
        volume = oracle.enclosed_volume(vertices, faces)
        if volume <= 0:
            assert found.reasons[i].startswith("inside out" if volume else "no volume")
            continue
        truth = oracle.mesh_kernel(surface.vertices, surface.faces)
        assert found.dimension[i] == truth.dimension
        assert found.volume[i] == pytest.approx(float(volume), rel=1e-12)
        assert found.kernel_volume[i] == pytest.approx(float(truth.volume), rel=1e-9)


# ---------------------------------------------------------------- laws


def same_numbers(one, two, scale=1.0, rtol=1e-9):
    assert one.dimension.tolist() == two.dimension.tolist()
    np.testing.assert_allclose(two.volume, one.volume * scale**3, rtol=rtol)
    np.testing.assert_allclose(two.kernel_volume, one.kernel_volume * scale**3, rtol=rtol)
    np.testing.assert_allclose(two.inradius, one.inradius * scale, rtol=rtol)
    np.testing.assert_allclose(two.diameter, one.diameter * scale, rtol=rtol)


def test_moved_and_scaled(rng):
    cells = [as_cell(c) for c in mixed_cells(rng)]
    before = solved(*cells)
    turn, shift = shapes.random_rotation(rng), (3.0, -2.0, 1.0)
    same_numbers(before, solved(*((2.5 * shapes.moved(v, turn, shift), f) for v, f in cells)), 2.5, rtol=1e-8)
    for power in (-40, 40):
        same_numbers(before, solved(*((np.ldexp(v, power), f) for v, f in cells)), 2.0**power, rtol=1e-14)


def test_very_large_and_very_small_cells():
    cell = shapes.l_prism()
    for power in (-190, -160, 160, 190):
        found = solved((np.ldexp(cell[0], power), cell[1]))
        assert found.dimension.tolist() == [3]
        assert found.kernel_volume[0] == pytest.approx(2.0 ** (3 * power))
        assert found.volume_share[0] == pytest.approx(1 / 3)
    found = solved((np.ldexp(cell[0], 400), cell[1]), (np.ldexp(cell[0], -400), cell[1]), cell)
    assert found.dimension.tolist() == [-2, -2, 3]
    assert "2**200" in found.reasons[0]


TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


@pytest.mark.parametrize(
    ("scales", "reason"),
    [
        ((1, 1, 5e-324), "too thin"),
        ((1, 5e-324, 1e300), r"2\*\*200"),
        ((1e-200, 1, 1e-200), "too thin"),
        ((1e12, 1, 1e-300), "too thin"),
        ((1e-300, 1e-300, 1e-300), r"2\*\*200"),
        ((1e300, 1e300, 1e300), r"2\*\*200"),
        ((1.7e308, 1e-300, 1), r"2\*\*200"),
        ((1, 1, 0), "no volume"),
        ((1, 1, 1e-300), ""),
        ((1e-57, 1e-130, 1e-68), ""),
        ((1e50, 1e-90, 1e-90), ""),
    ],
)
def test_a_cell_of_mixed_scales_fails_alone_or_is_right(scales, reason):
    """Volume 1/6 of the product of the scales; convex."""
    vertices, polygons = TETRAHEDRON
    found = solved(TETRAHEDRON, (vertices * scales, polygons), TETRAHEDRON)
    assert found.volume[[0, 2]] == pytest.approx(1 / 6)
    if reason:
        assert found.dimension.tolist() == [3, -2, 3]
        assert re.search(reason, found.reasons[1]), found.reasons[1]
        assert np.isnan(found.kernel_volume[1])
    else:
        assert found.reasons == ("",) * 3
        assert found.volume_share.tolist() == [1, 1, 1]
        assert found.kernel_volume[1] == pytest.approx(float(np.prod(scales)) / 6, rel=1e-12, abs=0)


def hard_cell(rng):
    """A small solid spoilt: stretched by powers of ten, corners made equal, flattened, moved far, odd numbers."""
    odd = [0.0, 5e-324, 1e-300, 1e-100, 1e-16, 1.0, 1 + 2**-52, 1e16, 1e100, 1e300, np.inf]
    vertices, faces = (TETRAHEDRON, shapes.octahedron(), shapes.l_prism(), shapes.notched_cube(-0.25))[rng.integers(4)]
    vertices = np.array(vertices, float)
    for kind in rng.integers(0, 6, rng.integers(1, 4)):
        corner, axis = rng.integers(len(vertices)), rng.integers(3)
        if kind == 0:
            vertices *= 10.0 ** rng.uniform(-150, 150, 3)
        elif kind == 1:
            vertices *= 10.0 ** rng.uniform(-15, 15, 3)
        elif kind == 2:
            vertices[corner] = vertices[rng.integers(len(vertices))]
        elif kind == 3:
            vertices[:, axis] *= rng.choice([0.0, 5e-324, 1e-300, 1e-17, 1e-8])
        elif kind == 4:
            vertices[corner, axis] = rng.choice(odd) * rng.choice([-1, 1])
        else:
            vertices += rng.choice(odd[4:9], 3) * rng.choice([-1, 0, 1], 3)
    return vertices, np.asarray(faces).tolist()


def test_hard_cells_are_right_or_have_a_reason(rng):
    with np.errstate(all="ignore"):
        cells = [hard_cell(rng) for _ in range(120)]
    found = solved(*cells)
    assert 20 < int(found.is_failed.sum()) < 100
    for i, (vertices, polygons) in enumerate(cells):
        reason, faces = found.reasons[i], np.array(polygons)
        if not np.isfinite(vertices).all():
            assert reason == "a vertex is not finite"
            continue
        volume = oracle.enclosed_volume(vertices, faces)
        if reason:
            assert not reason.startswith("inside out") or volume < 0
            assert not reason.startswith("no volume") or volume == 0
            continue
        truth = oracle.mesh_kernel(vertices, faces)
        assert volume > 0
        assert found.dimension[i] == truth.dimension
        assert found.volume[i] == pytest.approx(float(volume), rel=1e-9, abs=0)
        assert found.kernel_volume[i] == pytest.approx(float(truth.volume), rel=1e-6, abs=0)
        assert (found.volume_share[i] == 1) == (truth.volume == volume)
        assert (found.inradius[i] > 0) == (truth.dimension == 3)


def test_far_from_the_origin():
    """Whole numbers near 2**40: nothing is rounded, and nothing may be lost."""
    far = solved((shapes.l_prism()[0] + 2.0**40, shapes.l_prism()[1]), (shapes.cube()[0] - 2.0**50, shapes.cube()[1]))
    np.testing.assert_allclose(far.kernel_volume, [1, 1], rtol=1e-12)


def test_order_does_not_matter(rng):
    cells = [as_cell(c) for c in mixed_cells(rng)][::3]
    before = solved(*cells)
    order = rng.permutation(len(cells))
    mixed = []
    for i in order:
        vertices, polygons = cells[i]
        names = rng.permutation(len(vertices))
        moved = np.empty_like(vertices)
        moved[names] = vertices
        polygons = [[int(names[v]) for v in polygons[k]] for k in rng.permutation(len(polygons))]
        if i < 27:  # the first corner of a bent polygon decides into which triangles it is cut
            polygons = [p[1:] + p[:1] for p in polygons]
        mixed.append((moved, polygons))
    after = solved(*mixed)
    assert after.dimension.tolist() == before.dimension[order].tolist()
    np.testing.assert_allclose(after.kernel_volume, before.kernel_volume[order], rtol=1e-8)
    np.testing.assert_allclose(after.inradius, before.inradius[order], rtol=1e-8)


def test_threads_do_not_change_a_bit(rng):
    cells = [as_cell(c) for c in mixed_cells(rng)] * 3
    one, two = solved(*cells), solved(*cells, threads=3)
    for name in ("dimension", "volume", "kernel_volume", "inradius", "center", "diameter"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert one.decided_by == two.decided_by
    assert one.facets == two.facets


@pytest.mark.parametrize(("times", "decided_by"), [(2, ("convex", "interior point")), (3, ("exact", "exact"))])
def test_cells_with_many_faces(times, decided_by):
    """More planes than are cut one by one: a dual hull; and more than the compiled loop takes."""
    mesh = PolyhedralMesh.from_cells([as_cell(shapes.icosphere(times)), as_cell(shapes.spiky(times))])
    found = cell_kernels(mesh)
    assert found.decided_by == decided_by
    assert found.volume_share[0] == 1.0
    assert_agrees(mesh, found)


# ---------------------------------------------------------------- cells that are wrong


def test_bad_cells_are_rows_with_a_reason():
    vertices, faces = shapes.cube()
    good = vertices, faces
    flat = vertices * [1, 1, 0], faces
    not_a_number = vertices.copy()
    not_a_number[3, 1] = np.nan
    doubled = np.concatenate([vertices, vertices])  # faces that do not share vertices do not close
    cells = [
        good, (vertices, faces[:-1]), shapes.cube_with_flipped_face(), shapes.inside_out_cube(), flat,
        (not_a_number, faces), (doubled, [*faces[:6], *(faces[6:] + 8)]), (vertices, []), (vertices, [[0, 1]]), good,
    ]  # fmt: skip
    found = solved(*cells)
    assert found.dimension.tolist() == [3, *[-2] * 8, 3]
    assert found.is_failed.tolist() == [False, *[True] * 8, False]
    starts = [
        "",
        "open",
        "inconsistent",
        "inside out",
        "no volume",
        "a vertex is not finite",
        "open",
        "a face",
        "a face",
        "",
    ]
    assert all(reason.startswith(start) for reason, start in zip(found.reasons, starts, strict=True)), found.reasons
    assert np.isnan(found.volume[1:-1]).all()
    assert np.isnan(found.inradius_over_diameter[1:-1]).all()
    assert repr(found) == "CellKernels(10 cells, 2 star-shaped, 0 not, 8 failed)"
    rows = found.to_rows()
    assert [row["status"] for row in rows] == ["ok", *["failed"] * 8, "ok"]
    assert rows[0]["ratio"] == rows[0]["volume_share"] == 1.0
    assert (rows[0]["volume"], rows[0]["reference_volume"]) == (1.0, 1.0)
    assert rows[1]["reason"] == "open: 3 edges have an odd number of faces"
    assert [row["cell"] for row in rows] == list(range(10))


def test_repeated_vertices_and_corners():
    """Equal positions under two numbers, and polygons that list a corner twice, have facets without area."""
    vertices, faces = shapes.cube()
    a, b, c = faces[0].tolist()
    again = np.concatenate([vertices, vertices[[a]]])
    sliver = [*faces[1:].tolist(), [8, b, c], [a, b, 8], [a, 8, c]]  # corner `a` split in two equal ones
    repeated = [[a, a, b, c], *faces[1:].tolist()]
    mesh = PolyhedralMesh.from_cells([(again, sliver), (vertices, repeated)])
    found = cell_kernels(mesh)
    assert not any(found.reasons)
    assert_agrees(mesh, found)
    np.testing.assert_allclose(found.kernel_volume, 1.0)


def test_collinear_facets_are_left_out():
    """A corner in the middle of an edge makes a triangle without area, exactly."""
    vertices, faces = shapes.cube()
    a, b, c = faces[0].tolist()
    more = np.concatenate([vertices, [(vertices[a] + vertices[b]) / 2]])
    found = solved((more, [*faces[1:].tolist(), [a, 8, c], [8, b, c], [a, b, 8]]))
    assert found.reasons == ("",)
    assert found.volume_share[0] == pytest.approx(1.0, rel=1e-12)


def test_arguments_are_checked():
    with pytest.raises(TypeError, match="`mesh` must be a PolyhedralMesh or a path; got int"):
        cell_kernels(3)
    with pytest.raises(MeshError, match="at least one cell"):
        PolyhedralMesh.from_cells([])
    with pytest.raises(MeshError, match=r"`polygons` must be in 0\.\.3"):
        PolyhedralMesh.from_cells([(np.eye(4, 3), [[0, 1, 7]])])
    with pytest.raises(MeshError, match="shape"):
        PolyhedralMesh.from_cells([(np.eye(4), [[0, 1, 2]])])
    with pytest.raises(MeshError, match=r"`cells` must be in 0\.\.0"):
        PolyhedralMesh.from_faces(np.eye(4, 3), [[0, 1, 2]], [[0, 1]])
    mesh = PolyhedralMesh.from_cells([as_cell(shapes.cube())])
    with pytest.raises(ValueError, match="threads"):
        cell_kernels(mesh, threads=0)
    with pytest.raises(ValueError, match="planarity_rtol"):
        cell_kernels(mesh, planarity_rtol=-1)
    with pytest.raises(IndexError, match=r"`index` must be in 0\.\.0"):
        mesh.cell(1)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        cell_kernels(mesh).volume[0] = 0


# ---------------------------------------------------------------- orientation


def cube_grid(n=2):
    """n**3 unit cubes with shared faces, every face listed once, in a direction of its own."""
    faces, index, cells, points = [], {}, [], {}
    unit, quads = shapes.prism_polygons([(0, 0), (1, 0), (1, 1), (0, 1)])
    for lower in product(range(n), repeat=3):
        cell = []
        for quad in quads:
            loop = [points.setdefault(tuple(int(v) for v in unit[i] + lower), len(points)) for i in quad]
            key = frozenset(loop)
            if key not in index:
                index[key] = len(faces)
                faces.append(loop if len(faces) % 3 else loop[::-1])
            cell.append(index[key])
        cells.append(cell)
    return np.array(list(points), float), faces, cells


def test_shared_faces_are_turned_outward():
    mesh = PolyhedralMesh.from_faces(*cube_grid(3))
    assert mesh.oriented_by == "reader"
    assert mesh.n_turned == 27
    found = cell_kernels(mesh)
    assert found.volume_share.tolist() == [1.0] * 27
    assert all(mesh.cell(i).facts().is_outward for i in range(27))


def test_cells_that_cannot_be_turned():
    vertices, faces, cells = cube_grid(1)
    extra = np.concatenate([vertices, vertices / 2 + 0.25])
    inner = [[v + 8 for v in face] for face in faces]
    mesh = PolyhedralMesh.from_faces(
        extra, [*faces, *inner], [cells[0], cells[0][1:], [*cells[0], *range(6, 12)], [*cells[0], cells[0][0]], []]
    )
    found = cell_kernels(mesh)
    assert found.dimension.tolist() == [3, -2, -2, -2, -2]
    assert "exactly two faces" in found.reasons[1]
    assert "separate surfaces" in mesh.problems[2]
    assert "exactly two faces" in found.reasons[3]
    with pytest.raises(MeshError, match="exactly two faces"):
        mesh.cell(4)


def test_a_thin_cell_is_turned_by_its_exact_volume():
    """One unit in the last place of thickness: floating point does not know the sign of the volume."""
    top = float(np.nextafter(1.0, 2.0))
    vertices = np.array([(0, 0, 1), (1, 0, 1), (0, 1, 1), (0.3, 0.3, top), (0, 0, 0)], float)
    for faces in ([[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]], [[2, 1, 0], [0, 1, 3], [1, 2, 3], [2, 0, 3]]):
        found = cell_kernels(PolyhedralMesh.from_faces(vertices, faces, [[0, 1, 2, 3]]))
        assert found.dimension.tolist() == [3]
        assert found.volume_share.tolist() == [1.0]
        assert found.decided_by == ("exact",)


# ---------------------------------------------------------------- files


def write_off(path, vertices, polygons):
    lines = [
        f"OFF\n{len(vertices)} {len(polygons)} 0",
        *(" ".join(map(repr, v)) for v in np.asarray(vertices).tolist()),
    ]
    lines += [" ".join(map(str, (len(p), *p))) for p in polygons]
    path.write_text("\n".join(lines) + "\n")


def write_hedra(path, vertices, faces, cells):
    lines = [f"{len(vertices)} {len(faces)} {len(cells)}", *(" ".join(map(repr, v)) for v in vertices.tolist())]
    lines += [" ".join(map(str, (len(f), *(v + 1 for v in f)))) for f in faces]
    lines += [" ".join(map(str, (len(c), *(-(f + 1) if f % 2 else f + 1 for f in c)))) for c in cells]
    path.write_text("\n".join(lines) + "\n")


def test_folder_of_cells(tmp_path):
    folder = tmp_path / "cells"
    folder.mkdir()
    assert not is_polyhedral(folder)
    for i in range(11):
        write_off(folder / f"{i}.off", *as_cell(shapes.l_prism() if i == 10 else shapes.cube()))
    assert is_polyhedral(folder)
    (folder / "3.off").write_text("no mesh")
    (folder / "4.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n")
    (folder / "5.off").write_text("OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n")
    mesh = read_polyhedral(folder)
    assert (mesh.oriented_by, mesh.n_turned, len(mesh)) == ("file", 0, 11)
    found = cell_kernels(folder)
    assert found.dimension.tolist() == [3, 3, 3, -2, -2, -2, 3, 3, 3, 3, 3]
    assert "3.off" in found.reasons[3]
    assert "out of range" in found.reasons[4]
    assert "no faces" in found.reasons[5]
    assert found.volume_share[10] == pytest.approx(1 / 3)  # 10 comes after 9, not after 1
    with pytest.raises(MeshError, match=r"3\.off"):
        mesh.cell(3)
    (folder / "7.off").unlink()
    assert not is_polyhedral(folder)  # a gap: a collection of shapes
    assert len(read_polyhedral(folder)) == 10


def test_hedra(tmp_path):
    file = tmp_path / "grid.hedra"
    vertices, faces, cells = cube_grid(2)
    write_hedra(file, vertices + 1 / 3, faces, cells)
    assert is_polyhedral(file)
    mesh = read_polyhedral(file)
    np.testing.assert_array_equal(mesh.vertices, vertices + 1 / 3)
    assert mesh.cell_faces.tolist() == [f for cell in cells for f in cell]
    np.testing.assert_allclose(cell_kernels(mesh).kernel_volume, 1.0)


ELEMENTS = {
    "tetra": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)],
    "wedge": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "hexahedron": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}
VOLUMES = {"tetra": 1 / 6, "pyramid": 1 / 3, "wedge": 1 / 2, "hexahedron": 1.0}


@pytest.mark.parametrize("suffix", [".mesh", ".vtu"])
def test_standard_cells_written_by_meshio(tmp_path, suffix):
    import meshio

    points, blocks, n = [], [], 0
    for name, corners in ELEMENTS.items():
        ids = np.arange(len(corners)) + n
        turned = ids[[1, 0, 2, 3]] if name == "tetra" else ids  # the second tetrahedron is inside out
        blocks.append((name, np.array([ids, turned])))
        points += [(x + 7 * len(blocks), y + 1 / 3, z) for x, y, z in corners]
        n += len(corners)
    blocks.append(("triangle", np.array([[0, 1, 2]])))
    file = tmp_path / f"all{suffix}"
    mesh = meshio.Mesh(np.array(points), blocks)
    if suffix == ".mesh":
        mesh.write(file, float_fmt=".17g")
    else:
        mesh.write(file)
    cells = read_polyhedral(file)
    found = cell_kernels(cells)
    np.testing.assert_array_equal(cells.vertices, points)
    # VTK's documents and meshio number wedges one way round, VTK's code the other.
    assert cells.n_turned == (3 if suffix == ".vtu" else 1)
    assert sorted(found.volume) == pytest.approx(sorted([v for v in VOLUMES.values() for _ in range(2)]))
    assert found.volume_share.tolist() == [1.0] * 8
    assert all(cells.cell(i).facts().is_outward for i in range(8))


def test_vtu_polyhedra(tmp_path):
    """Polyhedra and other cells mixed, in the order of the file, as VTK writes them."""
    import pyvista

    prism = as_cell(shapes.prism_polygons([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]))
    octahedron = as_cell(shapes.octahedron())
    points = np.concatenate([prism[0], octahedron[0], ELEMENTS["hexahedron"]])

    def stream(polygons, first):
        body = [len(polygons)] + [word for p in polygons for word in (len(p), *(v + first for v in p))]
        return [len(body), *body]

    cells = [*stream(prism[1], 0), 8, *range(18, 26), *stream([p[::-1] for p in octahedron[1]], 12)]
    grid = pyvista.UnstructuredGrid(np.array(cells), np.array([42, 12, 42]), points)
    file = tmp_path / "mixed.vtu"
    grid.save(file)
    mesh = read_polyhedral(file)
    found = cell_kernels(mesh)
    assert found.n_faces.tolist() == [8, 6, 8]
    np.testing.assert_allclose(found.volume, [3, 1, 4 / 3])
    np.testing.assert_allclose(found.volume_share, [1 / 3, 1, 1])
    assert mesh.n_turned == 1


def test_vtu_polyhedra_written_by_meshio(tmp_path):
    """As meshio writes them; it groups cells by their number of vertices, which here is one number."""
    import meshio

    octahedron = as_cell(shapes.octahedron())
    points = np.concatenate([octahedron[0], octahedron[0] * [1, 1, 2] + 5])
    cells = [[np.array(p) + first for p in octahedron[1]] for first in (0, 6)]
    file = tmp_path / "polyhedra.vtu"
    meshio.Mesh(points, [("polyhedron6", cells)]).write(file, binary=False)
    np.testing.assert_allclose(cell_kernels(file).volume, [4 / 3, 8 / 3])


@pytest.mark.parametrize(
    ("name", "text", "match"),
    [
        ("a.hedra", "", "empty"),
        ("a.hedra", "4 4\n", "first line"),
        ("a.hedra", "4 4 1\n0 0 0\n", "it ends before"),
        ("a.hedra", "1 1 1\n0 0\n3 1 1 1\n1 1\n", "3 coordinates"),
        ("a.hedra", "1 1 1\n0 0 0\n3 1 1\n1 1\n", "as many numbers"),
        ("a.hedra", "1 1 1\n0 0 0\n3 1 1 0\n1 1\n", r"line 3: a vertex number must be .* in 1\.\.1; got 0"),
        ("a.hedra", "1 1 1\n0 0 x\n3 1 1 1\n1 1\n", "readable .hedra"),
        ("a.mesh", "", "MeshVersionFormatted"),
        ("a.mesh", "MeshVersionFormatted 2\nDimension 3\nVertices\n1\n0 0 0 0\nEnd\n", "no cells"),
        ("a.mesh", "MeshVersionFormatted 2\nDimension 2\n", "dimension is 2"),
        ("a.mesh", "MeshVersionFormatted 2\nDimension 3\nTetrahedra\n5\n1 2 3 4 0\n", "it ends before"),
        ("a.mesh", "MeshVersionFormatted 2\nDimension", "readable .mesh"),
        ("a.vtu", "no xml", "it is no XML"),
        ("a.stl", "solid", "must be a folder or end in"),
    ],
)
def test_broken_files(tmp_path, name, text, match):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(MeshReadError, match=match):
        read_polyhedral(file)


HEDRA = "4 4 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 1 2 3\n3 1 2 4\n3 1 3 4\n3 2 3 4\n4 1 2 3 4\n"
MEDIT = (
    "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
    "Tetrahedra\n1\n1 2 3 4 0\nEnd\n"
)


@pytest.mark.parametrize(
    ("text", "old", "new", "match"),
    [
        (HEDRA, "4 1 2 3 4\n", "4 1 2 3 4\n4 1 2 3 4\n", "line 11: there are rows after the 4 vertices, 4 faces and 1"),
        (HEDRA, "1 0 0\n", "1 nan 0\n", "line 3: 'nan' is not a finite number"),
        (HEDRA, "1 0 0\n", "# a\n\n1 1e999 0\n", "line 5: '1e999' is not a finite number"),
        (HEDRA, "1 0 0\n", "1 1_0 0\n", "line 3: '1_0' is not"),
        (HEDRA, "3 2 3 4\n", "3 2\x1c 3 4\n", r"line 9: it holds the byte b'\\x1c', which is no text"),
        (MEDIT, "Vertices\n4\n", "Vertices\n4\x1f\n", r"line 4: it holds the byte b'\\x1f', which is no text"),
        (HEDRA, "1 0 0\n", "1 0 0 0\n", "line 3: a vertex must have 3 coordinates; got 4"),
        (HEDRA, "4 4 1\n", "4 -4 1\n", "line 1: the number of faces must be .*; got '-4'"),
        (HEDRA, "4 4 1\n", "4 4 1e15\n", "line 1: the number of cells must be .*; got '1e15'"),
        (HEDRA, "4 4 1\n", "4 4 1000000000000000\n", "it ends before"),
        (HEDRA, "4 4 1\n", f"4 4 {'9' * 5000}\n", "line 1: the number of cells"),
        (HEDRA, "3 2 3 4\n", "3 2 3 5\n", r"line 9: a vertex number must be a whole number in 1\.\.4; got 5"),
        (HEDRA, "3 2 3 4\n", "3 2 3 -4\n", "line 9: a vertex number .* got -4"),
        (HEDRA, "3 2 3 4\n", "3 2 3 1.5\n", "line 9: a vertex number .* got 1.5"),
        (HEDRA, "3 2 3 4\n", "2 2 3 4\n", "line 9: a face does not have as many numbers as it says: 2, and 3 follow"),
        (HEDRA, "4 1 2 3 4\n", "4 1 2 3 -5\n", "line 10: a face number .* got 5"),
        (MEDIT, "End\n", "Vertices\n1\n5 5 5 0\nEnd\n", "line 12: there is a second section Vertices"),
        (MEDIT, "End\n", "tetrahedra\n1\n1 2 3 4 0\nEnd\n", "line 12: there is a second section tetrahedra"),
        (MEDIT, "End\n", "TetrahedraP2\n1\n1 2 3 4 0\nEnd\n", "line 12: a keyword .* got 'TetrahedraP2'"),
        (MEDIT, "1 2 3 4 0\n", "1 2 3 4 0\n1 2 3 4 0\n", "line 12: a keyword .* got '1'"),
        (MEDIT, "End\n", "End\n1\n", "line 13: there is more after 'End'"),
        (MEDIT, "1 0 0 0\n", "1 0 0\n", "line 6: a row of Vertices must have 4 numbers on one line"),
        (MEDIT, "1 0 0 0\n0 1 0 0\n", "1 0 0\n0 1 0 0 0\n", "line 6: a row of Vertices must have 4 numbers"),
        (MEDIT, "1 0 0 0\n", "1 0 inf 0\n", "line 6: 'inf' is not a finite number"),
        (MEDIT, "Vertices\n4\n", "Vertices\n5\n", "line 9: a row of Vertices must have 4 numbers"),
        (MEDIT, "Vertices\n4\n", "Vertices\n-4\n", "line 4: the number of Vertices must be .* got '-4'"),
        (MEDIT, "Vertices\n4\n", "Vertices\n1000000000000000\n", "ends before its 1000000000000000 Vertices"),
        (MEDIT, "1 2 3 4 0\n", "1 2 3 5 0\n", r"line 11: a vertex number must be a whole number in 1\.\.4; got 5"),
        (MEDIT, "1 2 3 4 0\n", "1 2 3 0 0\n", "line 11: a vertex number .* got 0"),
        (MEDIT, "End\n", "Triangles\n2\n1 2 3 0\n1 2 4\nEnd\n", "line 13: Triangles must have 2 rows .* got 7"),
        (MEDIT, "End\n", "Corners\n0\n1\nEnd\n", "line 13: Corners must have 0 rows"),
        (MEDIT, "End\n", "Corners\n1\n1_\nEnd\n", "line 14: '1_' is not a finite number"),
        (MEDIT, "End\n", "Corners\n", "it ends where the number of Corners must be"),
    ],
)  # fmt: skip
def test_damaged_text_is_refused_with_its_line(tmp_path, text, old, new, match):
    file = tmp_path / ("a.hedra" if text is HEDRA else "a.mesh")
    file.write_text(text)
    assert len(read_polyhedral(file)) == 1
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))
    with pytest.raises(MeshReadError, match=match) as caught:
        read_polyhedral(file)
    assert "\n" not in str(caught.value)
    assert str(file) in str(caught.value)


def test_a_long_word_among_many_takes_no_more_memory_than_its_text(tmp_path):
    import tracemalloc

    file = tmp_path / "a.mesh"
    file.write_text(MEDIT.replace("1 0 0 0\n", f"1 {'0' * 1_000_000}.5 0 0\n" + "# \n" * 1000))
    tracemalloc.start()
    try:
        assert read_polyhedral(file).vertices[1, 1] == 0.5
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", ["a.mesh", "a.hedra", "a.vtu"])
def test_pipes_and_devices_are_refused_at_once(tmp_path, name):
    import os

    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes with names here")
    os.mkfifo(tmp_path / name)
    with pytest.raises(MeshReadError, match="regular file"):
        read_polyhedral(tmp_path / name)


def test_missing_and_out_of_range(tmp_path):
    with pytest.raises(MeshReadError, match="existing file or folder"):
        read_polyhedral(tmp_path / "nothing.hedra")
    with pytest.raises(MeshReadError, match=r"must hold \.off"):
        read_polyhedral(tmp_path)


def test_comments_and_sections_of_medit_files(tmp_path):
    file = tmp_path / "a.mesh"
    file.write_text(
        "MeshVersionFormatted 1 # single\nDimension\n3\n# points\nVertices 4\n0 0 0 0\n0.1 0 0 1\n0 1 0 0\n0 0 1 0\n"
        "Triangles 1\n1 2 3 7\nRequiredVertices 1\n2\nTetrahedra 1\n1 2 3 4 0\nEnd\n"
    )
    mesh = read_polyhedral(file)
    assert mesh.vertices[1, 0] == 0.1  # the digits of the file, though its version says single precision
    assert cell_kernels(mesh).volume[0] == pytest.approx(0.1 / 6)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_optional_sections_comments_and_line_ends_of_medit_files(tmp_path, end):
    """Cells before vertices, sections that are passed over, several rows on a line, blank lines, no End."""
    text = (
        "# made by hand\n\nMeshVersionFormatted\n1\n\nDimension 3\n"
        "Tetrahedra 2 # before the vertices\n1 2 3 4 0  1 3 2 5 0\n"
        "BoundingBox 0 0 -1 1 1 1\nAngleOfCornerBound 10\n"
        "Vertices\n5\n0 0 0 0 1 0 0 0\n# between\n0 1 0 0\n\n  0 0 1e0 0\n0 0 -1 0\n"
        "Edges\n1\n1 2 0\nQuadrilaterals 0\nNormals 2\n0 0 1\n0 1 0\nNormalAtVertices 1\n1 2\nCorners 2\n1\n2\n"
        "Ridges 1\n1\nHexahedra\n0\n"
    )  # fmt: skip
    file = tmp_path / "a.mesh"
    file.write_bytes(text.replace("\n", end).encode())
    np.testing.assert_allclose(cell_kernels(file).volume, [1 / 6, 1 / 6])
    file.write_bytes((text + "End").replace("\n", end).encode())
    assert len(read_polyhedral(file)) == 2


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_comments_and_line_ends_of_hedra_files(tmp_path, end):
    file = tmp_path / "a.hedra"
    file.write_bytes(
        ("# a\n\n" + HEDRA.replace("3 2 3 4\n", "# b\n3 2 3 4 # c\n\n") + "\n#").replace("\n", end).encode()
    )
    np.testing.assert_allclose(cell_kernels(file).volume, [1 / 6])


# ---------------------------------------------------------------- real meshes


@pytest.mark.parametrize("name", ["sorgente_tet20_cells", "sorgente_voro_cells"])
def test_real_folders(name, data_dir):
    with (data_dir / "polyhedral" / "cells.csv").open(newline="") as lines:
        rows = {row["file"]: row for row in csv.DictReader(lines)}
    folder = data_dir / "polyhedral" / name
    assert is_polyhedral(folder)
    found = cell_kernels(folder)
    listed = [rows[f"polyhedral/{name}/{i}.off"] for i in range(len(found))]
    assert (found.dimension == 3).all()
    for column, key in ((found.kernel_volume, "kernel_volume"), (found.volume, "volume"), (found.inradius, "t")):
        np.testing.assert_allclose(column, [float(row[key]) for row in listed], rtol=1e-6)


def test_real_voronoi_cells(data_dir):
    mesh = read_polyhedral(data_dir / "polyhedral" / "cinolib_eight_voronoi.hedra")
    found = cell_kernels(mesh)
    assert not any(found.reasons)
    assert int(np.sum(found.dimension == 3)) > 2100
    assert found.decided_by.count("exact") < 50
    chosen = [i for i in range(len(mesh)) if i % 20 == 0 or found.decided_by[i] in ("exact", "witness")]
    for i in chosen:
        kernel = exact_kernel(mesh.cell(i))
        assert kernel.dimension == found.dimension[i]
        assert found.kernel_volume[i] == pytest.approx(kernel.volume, rel=1e-9, abs=0)


@pytest.mark.parametrize(("name", "n"), [("cinolib_sphere.mesh", 24013), ("libigl_bunny_tet.mesh", 34055)])
def test_real_tetrahedra(name, n, data_dir):
    found = cell_kernels(data_dir / "polyhedral" / name)
    assert len(found) == n
    assert found.volume_share.tolist() == [1.0] * n
    # The inradius of a tetrahedron is three times its volume over its area.
    mesh = read_polyhedral(data_dir / "polyhedral" / name)
    for i in range(0, n, 1000):
        facts = mesh.cell(i).facts()
        assert found.inradius[i] == pytest.approx(3 * facts.volume / facts.area, rel=1e-9)


# ---------------------------------------------------------------- picture


def test_picture(tmp_path):
    from PIL import Image

    mesh = PolyhedralMesh.from_faces(*cube_grid(3))
    path = tmp_path / "cells.png"
    cells_picture(path, mesh, np.linspace(0, 1, 27), label="share", size=(400, 300))
    pixels = np.asarray(Image.open(path).convert("RGB"))
    assert pixels.shape == (300, 400, 3)
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50
    with pytest.raises(ValueError, match="`values` must have shape"):
        cells_picture(path, mesh, [1.0])
