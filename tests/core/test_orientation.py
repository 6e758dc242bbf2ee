"""The exact predicates next to integers, on 100,000 hard cases."""

from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest

from voxkernel._core import orient3d_exact, orientations

LARGEST, SMALLEST = 2.0**300, 2.0**-300
N = 20_000


def integer_signs(points):
    """Signs of ((b - a) x (c - a)) . (d - a), in Python's integers."""
    mantissas, exponents = np.frexp(points)
    mantissas = np.ldexp(mantissas, 53).astype(np.int64).astype(object)
    exponents = np.where(points == 0, 10_000, exponents)
    lowest = exponents.min(axis=(1, 2), keepdims=True)
    whole = np.left_shift(mantissas, np.where(points == 0, 0, exponents - lowest).astype(object))
    u, v, w = (whole[:, k] - whole[:, 0] for k in (1, 2, 3))
    det = (
        (u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]) * w[:, 0]
        + (u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]) * w[:, 1]
        + (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) * w[:, 2]
    )
    return (det > 0).astype(int) - (det < 0).astype(int)


def fraction_sign(points):
    a, *rest = ([Fraction(float(x)) for x in p] for p in points)
    u, v, w = ([x - y for x, y in zip(p, a, strict=True)] for p in rest)
    det = sum(w[i] * (u[j] * v[k] - u[k] * v[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    return (det > 0) - (det < 0)


def nearly_flat(rng, scale=1.0, shift=0.0):
    """The fourth point on the plane of the others but for rounding, or one double beside that."""
    points = rng.normal(size=(N, 4, 3)) * scale + shift
    s, t = rng.normal(size=(2, N, 1))
    points[:, 3] = points[:, 0] + s * (points[:, 1] - points[:, 0]) + t * (points[:, 2] - points[:, 0])
    moved = rng.integers(0, 3, N) > 0
    up = np.where(rng.integers(0, 2, (N, 3)) > 0, np.inf, -np.inf)
    points[moved, 3] = np.nextafter(points[moved, 3], up[moved])
    return points


def wide(rng):
    """Every coordinate with an exponent of its own, in all of the range."""
    mantissas = rng.uniform(1, 2, (N, 4, 3)) * rng.choice([-1, 1], (N, 4, 3))
    points = np.ldexp(mantissas, rng.integers(-300, 300, (N, 4, 3)))
    points[rng.uniform(size=points.shape) < 0.2] = 0.0
    return points


def at_the_edges(rng):
    """The largest and the smallest numbers of the range, and their neighbours."""
    values = [LARGEST, np.nextafter(LARGEST, 0), LARGEST / 3, SMALLEST, np.nextafter(SMALLEST, 1), SMALLEST * 3, 0.0]
    return rng.choice(values, (N, 4, 3)) * rng.choice([-1.0, 1.0], (N, 4, 3))


def small_edges(rng):
    """Neighbours of the smallest number: differences are single bits, and products of three are subnormal."""
    return SMALLEST + rng.integers(0, 4, (N, 4, 3)) * np.spacing(SMALLEST)


def ties(rng):
    """Small integers, many in one plane, times odd numbers and powers of two."""
    points = rng.integers(-2, 3, (N, 4, 3)).astype(np.float64)
    flat = rng.integers(0, 2, N) > 0
    points[flat, :, 2] = 3 - points[flat, :, 0] - points[flat, :, 1]
    return points * np.ldexp(rng.choice([1.0, 3.0, 1e9 + 7], (N, 1, 1)), rng.integers(-250, 250, (N, 1, 1)))


def few_bits(rng):
    """Integers of up to 57 to 64 bits, most of each four in one plane: integers of fixed width end between."""
    bits = rng.integers(1, 65, (N, 1, 1))
    points = np.trunc(rng.uniform(-1, 1, (N, 4, 3)) * 2.0 ** np.minimum(bits, 50))
    points[::2, 3] = points[::2, 0] + points[::2, 1] - points[::2, 2]
    return points * 2.0 ** np.maximum(bits - 50, 0) + rng.integers(-1, 2, (N, 4, 3)) * (rng.integers(0, 2, (N, 1, 1)))


CASES = {
    "few bits": few_bits,
    "nearly flat": nearly_flat,
    "nearly flat, huge": lambda rng: nearly_flat(rng, scale=2.0**296),
    "nearly flat, far away": lambda rng: nearly_flat(rng, shift=5e6),
    "wide": wide,
    "edges": at_the_edges,
    "smallest": small_edges,
    "ties": ties,
}


@pytest.fixture(params=CASES.values(), ids=list(CASES))
def points(request, rng):
    return np.ascontiguousarray(request.param(rng))


def test_both_predicates_are_exact(points):
    inside = (points == 0) | ((np.abs(points) >= SMALLEST) & (np.abs(points) <= LARGEST))
    points = np.ascontiguousarray(points[inside.all(axis=(1, 2))])
    assert len(points) > 0.9 * N
    expected = integer_signs(points)
    assert len(np.unique(expected)) >= 2
    assert (np.sign(orientations(points)) == expected).all()
    assert (orient3d_exact(points) == -expected).all()


def test_the_integers_are_those_of_fractions(points):
    some = points[:: N // 50]
    assert integer_signs(some).tolist() == [fraction_sign(p) for p in some]


def test_an_even_permutation_keeps_the_sign_and_an_odd_one_turns_it(points):
    some = points[: N // 10]
    first = orient3d_exact(some)
    for order in permutations(range(4)):
        turns = sum(order[i] > order[j] for i in range(4) for j in range(i + 1, 4))
        turned = np.ascontiguousarray(some[:, order])
        assert (orient3d_exact(turned) == first * (-1) ** turns).all()
        assert (np.sign(orientations(turned)) == -first * (-1) ** turns).all()


def test_the_filter_decides_near_its_bound(rng):
    """Determinants of about 1e-15 of their terms: some pass the filter, some do not, all are right."""
    points = nearly_flat(rng)
    points[:, 3] += rng.normal(size=(N, 3)) * 2.0 ** rng.uniform(-54, -46, (N, 1))
    values = orientations(points)
    assert (np.sign(values) == integer_signs(points)).all()
    assert 0.05 < (np.abs(values) == 1).mean() < 0.95


def test_arguments_of_the_wrong_kind():
    for bad in (np.zeros((2, 4, 3), np.float32), np.zeros((2, 3, 4)), np.zeros((2, 8, 3))[:, ::2], [[1.0]]):
        for predicate in (orientations, orient3d_exact):
            with pytest.raises(TypeError, match="incompatible function arguments"):
                predicate(bad)
    assert len(orientations(np.empty((0, 4, 3)))) == 0
