"""The oracle against kernels worked out by hand, and against literal brute force."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import given, settings

CUBE = oracle.box_planes((0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize("name", shapes.KNOWN)
def test_kernel_is_the_one_worked_out_by_hand(name):
    make, known = shapes.KNOWN[name]
    vertices, faces = make()
    if not known.bounded:
        with pytest.raises(ValueError, match="unbounded"):
            oracle.mesh_kernel(vertices, faces)
        found = oracle.mesh_kernel(vertices, faces, oracle.box_planes((-9, -9, -9), (9, 9, 9)))
        assert found.dimension == known.dimension
        return
    found = oracle.mesh_kernel(vertices, faces)
    assert found.dimension == known.dimension
    assert float(found.volume) == pytest.approx(known.volume, rel=1e-15)
    if known.centroid is not None:
        assert found.centroid is not None
        assert [float(x) for x in found.centroid] == pytest.approx(known.centroid, rel=1e-15)


def test_open_box_goes_up_to_the_lid_it_is_given():
    found = oracle.mesh_kernel(*shapes.open_box(), oracle.box_planes((-9, -9, -9), (9, 9, 9)))
    assert found.volume == 9
    assert found.centroid == (Fraction(1, 2), Fraction(1, 2), Fraction(9, 2))


@pytest.mark.parametrize("slit", [1e-10, 1e-300, 2.0**-1074, 0.1])
def test_thickness_is_exactly_the_double(slit):
    assert oracle.mesh_kernel(*shapes.s_tetromino(slit)).volume == Fraction(slit)


@pytest.mark.parametrize(
    ("extra", "dimension", "volume", "centroid"),
    [
        ([], 3, 1, (Fraction(1, 2),) * 3),
        ([(1, 1, 1, 1)], 3, Fraction(1, 6), (Fraction(1, 4),) * 3),
        ([(1, 1, 1, 0)], 0, 0, (0, 0, 0)),
        ([(1, 1, 0, 0)], 1, 0, (0, 0, Fraction(1, 2))),
        ([(2, 0, 0, 0)], 2, 0, (0, Fraction(1, 2), Fraction(1, 2))),
        ([(1, 0, 0, 1), (1, 0, 0, 3), (1, 0, 0, 1)], 3, 1, (Fraction(1, 2),) * 3),
        ([(1, 1, 1, 1), (-1, -1, -1, -1)], 2, 0, (Fraction(1, 3),) * 3),
        ([(1, 1, 1, -1)], -1, 0, None),
        ([(3, 0, 0, 1), (-3, 0, 0, -2)], -1, 0, None),
    ],
)
def test_planes_that_cut_a_cube(extra, dimension, volume, centroid):
    found = oracle.kernel([*CUBE, *extra])
    assert (found.dimension, found.volume, found.centroid) == (dimension, volume, centroid)
    assert (oracle.helly_witness([*CUBE, *extra]) is not None) == (dimension == -1)


def test_every_size_of_witness():
    down, up = (1, 0, 0, -1), (-2, 0, 0, 0)
    assert oracle.helly_witness([down, up]) == ((0, 1), (2, 1))
    three = [(0, 1, 0, 0), (-1, 0, 0, -1), (1, -1, 0, 0)]  # y <= 0, x >= 1, x <= y
    assert oracle.helly_witness(three) == ((0, 1, 2), (1, 1, 1))
    four = [(-1, 0, 0, -1), (0, -1, 0, -1), (0, 0, -1, -1), (2, 1, 1, 3)]
    found = oracle.helly_witness(four)
    assert found == ((0, 1, 2, 3), (2, 1, 1, 1))
    assert oracle.is_empty_witness(four, found[1])
    assert not oracle.is_empty_witness(four, (1, 1, 1, 1))
    assert not oracle.is_empty_witness(four[:3], (0, 0, 0))
    assert oracle.helly_witness([*four[:3], (2, 1, 1, 4)]) is None


@pytest.mark.parametrize("planes", [[], [(1, 0, 0, 0)], [(1, 0, 0, 0), (-1, 0, 0, 5)], CUBE[:5]])
def test_unbounded_is_said(planes):
    assert not oracle.is_bounded(planes)
    with pytest.raises(ValueError, match="unbounded"):
        oracle.kernel(planes)


def test_parallel_planes_without_a_vertex():
    assert oracle.kernel([(1, 0, 0, -1), (-1, 0, 0, 0)]).dimension == -1


def test_exact_planes_of_doubles():
    assert oracle.plane((0.5, 0, -0.25), 3) == (2, 0, -1, 12)
    assert oracle.plane((0, 0, 0), 1) is None
    tenth = oracle.plane((1, 0, 0), 0.1)
    assert tenth is not None
    assert Fraction(tenth[3], tenth[0]) == Fraction(0.1) != Fraction(1, 10)
    vertices, faces = shapes.tetrahedron()
    assert oracle.corner_planes(vertices, faces)[3] == (1, 1, 1, 1)
    assert oracle.corner_planes(vertices, np.array([(0, 1, 1)])) == [None]


def _by_triples(planes):
    """Vertices the literal way: every three planes, Cramer's rule, every half-space."""
    found = set()
    for p, q, r in combinations(planes, 3):
        rows = [[Fraction(v) for v in row] for row in (p, q, r)]

        def det(columns, rows=rows):
            (a, b, c), (d, e, f), (g, h, i) = ([row[k] for k in columns] for row in rows)
            return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)

        bottom = det((0, 1, 2))
        if bottom:
            x = (det((3, 1, 2)) / bottom, det((0, 3, 2)) / bottom, det((0, 1, 3)) / bottom)
            if all(oracle.side(s, x) <= 0 for s in planes):
                found.add(x)
    return found


@settings(max_examples=25)
@given(shapes.integer_meshes())
def test_lines_find_the_vertices_that_triples_find(surface):
    planes = oracle.tightest(oracle.corner_planes(*surface))[:16]
    planes = oracle.tightest([*planes, *oracle.box_planes((-8, -8, -8), (8, 8, 8))])
    assert set(oracle.kernel(planes).vertices) == _by_triples(planes)


@settings(max_examples=40)
@given(shapes.integer_meshes())
def test_the_ways_to_a_kernel_agree(surface):
    planes = oracle.corner_planes(*surface)
    found = oracle.kernel(planes)
    faces = oracle.clipped(planes, (-30, -30, -30), (30, 30, 30))
    assert bool(faces) == (found.dimension == 3)
    assert oracle.solid_volume(faces) == found.volume
    if faces:
        assert {x for _, loop in faces for x in loop} == set(found.vertices)
    if len(oracle.tightest(planes)) <= 16:
        assert (oracle.helly_witness(planes) is None) == (found.dimension >= 0)
    if found.centroid is not None:
        assert oracle.is_inside(planes, found.centroid)
    assert not found.vertices or oracle.is_bounded(planes)


@settings(max_examples=20)
@given(shapes.convex_meshes())
def test_convex_kernel_is_the_enclosed_solid(surface):
    assert oracle.mesh_kernel(*surface).volume == oracle.enclosed_volume(*surface)


def test_float_truths_agree_with_the_exact_one():
    vertices, faces = shapes.star_prism()
    xyz = oracle.lattice((-3, -3, 0), (3, 3, 1), 12)
    inside = oracle.dense_kernel(vertices, faces, xyz)
    planes = oracle.corner_planes(vertices, faces)
    assert inside.tolist() == [oracle.is_inside(planes, x) for x in xyz]
    # cell centres at odd multiples of 1/4, those with |x| + 2|y| <= 3 and 2|x| + |y| <= 3, in 12 layers
    assert inside.sum() == 12 * 4 * 6
    share = oracle.violation(vertices, faces, xyz)
    assert ((share == 0) == inside).all()
    assert share.max() < 1


def test_violation_of_a_cube_counts_its_sides():
    vertices, faces = shapes.cube()
    xyz = np.array([(0.5, 0.5, 0.5), (2, 0.5, 0.5), (2, 2, 0.5), (2, 2, 2), (1, 1, 1)], dtype=np.float64)
    assert oracle.violation(vertices, faces, xyz) == pytest.approx([0, 1 / 6, 2 / 6, 3 / 6, 0])


def test_sampled_points_lie_in_the_kernel(rng):
    planes = oracle.corner_planes(*shapes.star_prism())
    points = list(oracle.sample_points(oracle.kernel(planes).vertices, rng, 20))
    assert len(set(points)) == 20
    assert all(oracle.is_inside(planes, x) for x in points)
