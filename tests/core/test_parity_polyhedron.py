"""Planes and polyhedra of the compiled core against the loops before, bit for bit."""

import numpy as np
import pytest
import shapes
from scipy.spatial import ConvexHull

from voxkernel import _core
from voxkernel._loops import planes as old_planes
from voxkernel._loops import polyhedron as old
from voxkernel.demo_shapes import SHAPES
from voxkernel.mesh_input import as_mesh

MESHES = [shapes.cube, shapes.spiky, shapes.torus, shapes.open_box, shapes.ellipsoid, shapes.notched_cube]
MESHES += [lambda s=s: s.make().to_arrays() for s in SHAPES]


@pytest.mark.parametrize("make", MESHES)
def test_planes(make):
    vertices, faces = (np.ascontiguousarray(a) for a in as_mesh(make()).to_arrays())
    faces = faces.astype(np.int64)
    n = len(faces)
    results = []
    for module in (old_planes, _core):
        out = [np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)]
        undecided = module.facet_planes(vertices, faces, vertices.mean(axis=0), 0.25, *out)
        results.append([undecided, *out, module.boundary_is_zero(faces, len(vertices))])
    for a, b in zip(*results, strict=True):
        assert np.array_equal(a, b)
    for a, b in zip(old_planes.coordinate_range(vertices), _core.coordinate_range(vertices, faces)[:3], strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("n", [4, 9, 50, 400, 5000])
@pytest.mark.parametrize("flat", [False, True])
def test_hulls(n, flat):
    rng = np.random.default_rng(n)
    points = rng.normal(size=(n, 3))
    if flat:
        points = np.concatenate([np.round(points, 1), np.eye(3), -np.eye(3)])
    hull = ConvexHull(points)
    simplices, neighbours = hull.simplices.astype(np.int64), hull.neighbors.astype(np.int64)
    turns, reached = old.consistent_turns(simplices, neighbours, 1)
    again, also = _core.consistent_turns(simplices, neighbours, 1)
    assert np.array_equal(turns, again.astype(bool))
    assert reached == also
    ids = np.arange(len(simplices)) // (2 if flat else 1)
    for outward in (turns, ~turns):
        for a, b in zip(
            old.dual_faces(simplices, outward, ids, len(points)),
            _core.dual_faces(simplices, outward, ids, len(points)),
            strict=True,
        ):
            assert np.array_equal(a, b)
    turned = np.where(turns[:, None], simplices, simplices[:, ::-1])
    start = 3 * np.arange(len(turned) + 1)
    for a, b in zip(old.moments(points, start, turned.ravel()), _core.moments(points, start, turned.ravel()), strict=True):
        assert np.array_equal(a, b)
    assert _core.solid_angle(points, turned.ravel()) == pytest.approx(old.solid_angle(points, turned.ravel()), abs=1e-12)
