"""Certified seeing beside a slow check in fractions: each triangle clipped to the tetrahedron of guard and facet."""

from fractions import Fraction

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._core import SightTree, certify_sight


def exact(point):
    """Whole numbers: coordinates times a power of two."""
    numbers = [Fraction(float(x)) * 2**112 for x in point]
    assert all(x.denominator == 1 for x in numbers)
    return [x.numerator for x in numbers]


def minus(p, q):
    return [a - b for a, b in zip(p, q, strict=True)]


def side(a, b, c, p):
    """Of the plane through a, b, c, a rational number."""
    u, v, w = minus(b, a), minus(c, a), minus(p, a)
    return sum(
        w[i] * (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]) for i in range(3)
    )


def enters(tetrahedron, triangle):
    """Whether a triangle has a point strictly inside: the mean of what is left of it after four cuts is one."""
    planes = []
    for i in range(4):
        a, b, c = (tetrahedron[j] for j in range(4) if j != i)
        turn = 1 if side(a, b, c, tetrahedron[i]) > 0 else -1
        planes.append((a, b, c, turn))
    if any(all(turn * side(a, b, c, p) <= 0 for p in triangle) for a, b, c, turn in planes):
        return False
    polygon = [[Fraction(x) for x in p] for p in triangle]
    for a, b, c, turn in planes:
        cut = []
        for k, p in enumerate(polygon):
            q = polygon[(k + 1) % len(polygon)]
            s, t = turn * side(a, b, c, p), turn * side(a, b, c, q)
            if s >= 0:
                cut.append(p)
            if s * t < 0:
                cut.append([x + (y - x) * s / (s - t) for x, y in zip(p, q, strict=True)])
        polygon = cut
        if not polygon:
            return False
    mean = [sum(column) / len(polygon) for column in zip(*polygon, strict=True)]
    return all(turn * side(a, b, c, mean) > 0 for a, b, c, turn in planes)


def is_seen(triangles, i, part, guard):
    """Whether no other triangle enters the hull of a guard and a part of triangle i, which faces it."""
    if not side(*triangles[i], guard) < 0:
        return False
    hull = [guard, *part]
    return not any(j != i and enters(hull, t) for j, t in enumerate(triangles))


def crumpled(seed, shift=0.0, whole=False):
    """A closed surface of 80 facets that hides much of itself."""
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.icosphere(1)
    vertices = vertices * rng.uniform(0.3, 1.0, (len(vertices), 1))
    return (np.rint(6 * vertices) if whole else vertices) + shift, faces


MESHES = {
    "crumpled": crumpled(1),
    "far away": crumpled(2, 1e5),
    "on a lattice": crumpled(3, whole=True),
    "torus": shapes.torus(n_major=7, n_minor=4),
    "polycube": shapes.voxel_surface([(0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 0), (2, 1, 1)]),
    "crossing": shapes.joined(shapes.box((0, 0, 0), (2, 2, 2)), shapes.box((1, 1, 1), (3, 3, 3))),
    "coinciding": shapes.joined(shapes.box((0, 0, 0), (1, 1, 1)), shapes.box((1, 0, 0), (2, 1, 1))),
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("depth", [0, 2])
def test_certified_is_seen_and_a_facet_that_is_not_is_not(name, depth, rng):
    vertices, faces = MESHES[name]
    scale = np.abs(vertices).max()
    vertices = np.ascontiguousarray(vertices / 2.0 ** np.ceil(np.log2(scale)))
    middles = vertices[faces].mean(axis=1)
    guards = np.stack([vertices.mean(axis=0), 0.5 * (middles[3] + middles[len(faces) // 2])])
    guards[1] += 0.01 * (rng.random(3) - 0.5) * np.ptp(vertices, axis=0)
    tree = SightTree(vertices, np.ascontiguousarray(faces))
    order = np.tile(np.arange(2), len(faces))
    found = certify_sight(tree, np.ascontiguousarray(guards), np.arange(len(faces)), order, np.full(len(faces), depth))
    triangles = [[exact(p) for p in vertices[f]] for f in faces]
    points = [exact(g) for g in guards]
    chosen = range(len(found[0])) if depth == 0 else rng.permutation(len(found[0]))[:40]
    for i in chosen:
        face, guard, level = int(found[0][i]), int(found[1][i]), int(found[2][i])
        weights = found[3][i].reshape(3, 3).tolist()
        part = [
            [sum(w * p[k] for w, p in zip(row, triangles[face], strict=True)) // 2**level for k in range(3)]
            for row in weights
        ]
        assert is_seen(triangles, face, part, points[guard])
        assert np.allclose(np.array(part, float) / 2**112, found[4][i].reshape(3, 3), rtol=0, atol=1e-15)
    if depth == 0:
        whole = set(found[0].tolist())
        for face in sorted(set(range(len(faces))) - whole)[::2]:
            assert not any(is_seen(triangles, face, triangles[face], g) for g in points)
    area = np.bincount(found[0], 0.25 ** found[2], len(faces))
    assert (area <= 1.0).all()


def test_certified_share_is_near_the_sampled_one():
    found = voxkernel.guards(shapes.torus(n_major=48, n_minor=24), coverage=0.99)
    assert found.seen - 0.0045 <= found.certified <= found.seen_bounds[1]
