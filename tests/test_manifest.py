"""Every mesh of the shared data against the kernel listed for it, and every cell of the polyhedral meshes."""

import csv
import os
from functools import cache
from pathlib import Path

import numpy as np
import oracle
import pytest

from voxkernel.exact import exact_kernel
from voxkernel.measures import starshapeness
from voxkernel.mesh import TriangleMesh, as_mesh

DATA = Path(os.environ.get("VOXKERNEL_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


def _rows(name, *folders):
    """Rows of a manifest, for parametrisation; empty (and so one skipped test) where the data is absent."""
    if not (DATA / name).exists():
        return []
    with (DATA / name).open(newline="") as lines:
        return [row for row in csv.DictReader(lines) if row["file"].split("/")[0] in folders]


CLOSED = _rows("manifest.csv", "closed")
OPEN = _rows("manifest.csv", "open")


def _name(row):
    return Path(row["file"]).stem


@pytest.mark.parametrize("row", CLOSED, ids=_name)
def test_closed_mesh(row, data_dir):
    mesh = as_mesh(data_dir / row["file"])
    facts = mesh.facts()
    assert facts.n_faces == int(row["faces"])
    assert facts.is_closed
    assert facts.volume == pytest.approx(float(row["mesh_volume"]), rel=1e-6)
    score = starshapeness(mesh)
    assert score.certificate.verify()
    if row["kernel_nonempty"] == "yes":
        assert score.verdict == "star-shaped"
        assert score.volume == pytest.approx(float(row["kernel_volume"]), rel=1e-6)
        assert score.ratio == pytest.approx(float(row["kernel_volume"]) / float(row["mesh_volume"]), rel=1e-6)
        _assert_vertices_are_behind_every_plane(exact_kernel(mesh), mesh)
    else:
        assert score.verdict == "not star-shaped"
        assert score.volume == 0
        assert score.reason


@pytest.mark.parametrize("row", OPEN, ids=_name)
def test_open_mesh(row, data_dir):
    mesh = as_mesh(data_dir / row["file"])
    assert not mesh.facts().is_closed
    kernel = exact_kernel(mesh, domain="box")
    assert kernel.certificate.verify()
    if row["kernel_nonempty"] == "yes":
        assert kernel.unclipped_dimension == 3
        assert kernel.volume == pytest.approx(float(row["kernel_volume"]), rel=1e-6, abs=0)
        assert kernel.dimension == (3 if float(row["t_bbox"]) > 0 else -1)
        assert kernel.is_bounded == (row["kernel_unbounded"] == "no")
    else:
        assert kernel.unclipped_dimension == kernel.dimension == -1
    for domain in ("box", None):
        score = starshapeness(mesh, domain=domain)
        assert score.verdict == ("star-shaped" if row["kernel_nonempty"] == "yes" else "not star-shaped")


def _assert_vertices_are_behind_every_plane(kernel, mesh):
    """The kernel's vertices satisfy every facet plane up to rounding."""
    normals, offsets, _ = oracle.float_planes(mesh.vertices, mesh.faces)
    step = 1e-9 * mesh.facts().diagonal
    for start in range(0, len(normals), 4096):
        part = slice(start, start + 4096)
        assert (kernel.vertices @ normals[part].T - offsets[part] <= step).all()


# ---------------------------------------------------------------- polyhedral cells


def test_polyhedral_cells(data_dir):
    with (data_dir / "polyhedral" / "cells.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 300
    wrong = []
    for row in rows:
        kernel = exact_kernel(data_dir / row["file"])
        listed = float(row["kernel_volume"])
        if kernel.dimension != 3 or not np.isclose(kernel.volume, listed, rtol=1e-6, atol=0):
            wrong.append((row["file"], kernel.dimension, kernel.volume, listed))
    assert not wrong


@cache
def _voronoi(path):
    """Read a .hedra file: a list of cells, each as vertices and outward polygons.

    Lines are vertices, then polygons (count, 1-based vertex numbers), then cells (count, 1-based polygon
    numbers). The sign of such a number does not say which way round it is: taken so, 8 of 2162 cells close.
    """
    with path.open() as lines:
        n_vertices, n_faces, n_cells = map(int, next(lines).split())
        vertices = np.array([next(lines).split() for _ in range(n_vertices)], dtype=np.float64)
        polygons = [[int(i) - 1 for i in next(lines).split()[1:]] for _ in range(n_faces)]
        cells = [[abs(int(i)) - 1 for i in next(lines).split()[1:]] for _ in range(n_cells)]
    return [_alone(vertices, _outward(vertices, [polygons[i] for i in cell])) for cell in cells]


def _alone(vertices, polygons):
    """The polygons with only their own vertices."""
    used, ids = np.unique(np.concatenate(polygons), return_inverse=True)
    return vertices[used], np.split(ids, np.cumsum([len(polygon) for polygon in polygons])[:-1])


def _outward(vertices, polygons):
    """Turn the polygons of one cell coherently, then outward."""
    users = {}
    for i, polygon in enumerate(polygons):
        for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            users.setdefault(frozenset((a, b)), []).append((i, a < b))
    neighbours = [[] for _ in polygons]
    for (i, way), (j, other_way) in users.values():
        neighbours[i].append((j, way == other_way))
        neighbours[j].append((i, way == other_way))
    is_turned, waiting = {0: False}, [0]
    while waiting:
        i = waiting.pop()
        for j, is_same_way in neighbours[i]:
            if j not in is_turned:
                is_turned[j] = is_turned[i] ^ is_same_way
                waiting.append(j)
            assert is_turned[j] == is_turned[i] ^ is_same_way
    coherent = [polygon[::-1] if is_turned[i] else polygon for i, polygon in enumerate(polygons)]
    corners = vertices - vertices[coherent[0][0]]
    volume = sum(
        corners[p[0]] @ np.cross(corners[p[k]], corners[p[k + 1]])
        for p in coherent
        for k in range(1, len(p) - 1)
    )
    return coherent if volume > 0 else [polygon[::-1] for polygon in coherent]


def test_voronoi_cells(data_dir):
    """Every sixth cell. About half the polygons have corners up to 2e-2 off a plane: these cells are not convex."""
    cells = _voronoi(data_dir / "polyhedral" / "cinolib_eight_voronoi.hedra")
    assert len(cells) == 2162
    dimensions = []
    for k, (vertices, polygons) in enumerate(cells[::6]):
        mesh = TriangleMesh.from_polygons(vertices, polygons)
        kernel = exact_kernel(mesh)
        dimensions.append(kernel.dimension)
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        assert 0 <= kernel.volume <= np.einsum("ij,ij->", a, np.cross(b, c)) / 6 * (1 + 1e-9)
        assert kernel.certificate.verify()
        if k % 25 == 0:
            truth = oracle.mesh_kernel(mesh.vertices, mesh.plane_corners)
            assert kernel.dimension == truth.dimension
            assert kernel.volume == pytest.approx(float(truth.volume), rel=1e-6, abs=0)
    assert dimensions.count(3) > 350  # of 361; the others are so far from convex that their kernel is empty


@pytest.mark.parametrize("name", ["cinolib_sphere.mesh", "libigl_bunny_tet.mesh"])
def test_tetrahedra_are_their_own_kernels(name, data_dir, rng):
    import meshio

    tets = meshio.read(data_dir / "polyhedral" / name)
    cells = tets.cells_dict["tetra"]
    faces = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    for ids in rng.choice(cells, 100, replace=False):
        corners = np.ascontiguousarray(tets.points[ids], dtype=np.float64)
        six = np.linalg.det(corners[1:] - corners[0])
        kernel = exact_kernel((corners, faces if six > 0 else faces[:, ::-1]))
        assert kernel.dimension == 3
        assert kernel.volume == pytest.approx(abs(six) / 6, rel=1e-6)
        assert sorted(kernel.face_facets.tolist()) == [0, 1, 2, 3]
        wrong_way = exact_kernel((corners, faces if six < 0 else faces[:, ::-1]))
        assert wrong_way.dimension == -1
        assert wrong_way.certificate.verify()
        assert starshapeness((corners, faces if six > 0 else faces[:, ::-1])).ratio == 1.0
