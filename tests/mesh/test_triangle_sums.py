"""Areas and moments of triangles from the compiled core, beside sums in rational and in extended arithmetic."""

from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest

from voxkernel import _core
from voxkernel.mesh.triangles import triangle_areas

LEXICAL = [tuple(combinations_with_replacement(range(3), k)) for k in (1, 2, 3)]


def soup(rng, n_vertices, n_faces):
    return rng.normal(size=(n_vertices, 3)), rng.integers(0, n_vertices, (n_faces, 3))


@pytest.mark.parametrize("n_faces", [0, 1, 127, 128, 129, 4096, 5000])
@pytest.mark.parametrize("exponent", [0, 3, -7])
def test_areas_are_those_of_the_formula(rng, n_faces, exponent):
    vertices, faces = soup(rng, 300, n_faces)
    a, b, c = (np.ldexp(vertices, -exponent)[faces[:, k]] for k in range(3))
    u, v = (b - a).T, (c - a).T
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    assert np.array_equal(_core.triangle_areas(vertices, faces, exponent), 0.5 * np.sqrt(x * x + y * y + z * z))


@pytest.mark.parametrize("size", [2.0**-1060, 1e-200, 1.0, 1e200, 2.0**1022])
def test_areas_at_both_ends_of_floating_point(size):
    """A right triangle with legs of 3 and 4: whatever its unit, nothing is lost on the way to the last product."""
    corners = size * np.array([[0.0, 0.0, 0.0], [0.75, 0.0, 0.0], [0.0, 1.0, 0.0]])
    exponent = int(np.frexp(corners.max())[1])
    wanted = 3 / 8 * np.ldexp(size, -exponent) ** 2
    assert _core.triangle_areas(corners, np.array([[0, 1, 2]]), exponent)[0] == pytest.approx(wanted, rel=1e-15)
    with np.errstate(over="ignore", under="ignore"):
        assert triangle_areas(corners, np.array([[0, 1, 2]]))[0] == pytest.approx(3 / 8 * size * size, rel=1e-15, abs=0)


@pytest.mark.parametrize("n_faces", [1, 128, 129, 4096, 4097, 9000])
def test_moments_beside_extended_arithmetic(rng, n_faces):
    vertices, faces = soup(rng, 200, n_faces)
    base, unit = np.array([0.3, -2.0, 0.7]), 4.0
    got = _core.triangle_moments(vertices, faces, base, unit)
    corners = (vertices.astype(np.longdouble)[faces] - base) / unit
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(float), axis=1)
    middles = corners.mean(axis=1)
    assert got[0] == pytest.approx(0.5 * areas.sum(), rel=1e-13)
    for found, places in zip(got[1:4], LEXICAL, strict=True):
        wanted = [float((0.5 * areas * np.prod(middles[:, list(p)], axis=1)).sum()) for p in places]
        assert found == pytest.approx(wanted, rel=1e-11, abs=1e-12 * n_faces)
    wanted = [float((0.5 * areas * (corners[..., i] * corners[..., j]).sum(axis=1)).sum()) for i, j in LEXICAL[1]]
    assert got[4] == pytest.approx(wanted, rel=1e-11, abs=1e-12 * n_faces)


def test_moments_in_rationals():
    """Right triangles with legs along the axes and whole coordinates: areas and moments are fractions."""
    vertices = np.array([[0, 0, 0], [6, 0, 0], [0, 12, 0], [6, 0, 24], [0, 12, 3]], float)
    faces = np.array([[0, 1, 2], [1, 3, 0], [2, 4, 0]])
    areas = [Fraction(36), Fraction(72), Fraction(18)]
    wanted = [sum(areas)]
    for places in LEXICAL:
        wanted.append([0] * len(places))
        for area, face in zip(areas, faces, strict=True):
            middle = [sum(Fraction(int(vertices[i, k])) for i in face) / 3 for k in range(3)]
            for place, axes in enumerate(places):
                product = area
                for axis in axes:
                    product *= middle[axis]
                wanted[-1][place] += product
    got = _core.triangle_moments(vertices, faces, np.zeros(3), 1.0)
    assert got[0] == wanted[0]
    assert all(np.array_equal(a, np.array(b, float)) for a, b in zip(got[1:4], wanted[1:], strict=True))


def test_a_unit_is_a_change_of_scale(rng):
    vertices, faces = soup(rng, 100, 500)
    plain, scaled = (_core.triangle_moments(vertices * unit, faces, np.ones(3) * unit, unit) for unit in (1.0, 2.0**40))
    assert plain[0] == scaled[0]
    assert all(map(np.array_equal, plain[1:], scaled[1:]))
