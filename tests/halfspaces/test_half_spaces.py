"""Half-spaces of a surface: planes, exactness of the rounding bounds, merging, frames."""

from fractions import Fraction
from math import gcd, isqrt

import numpy as np
import pytest
import shapes
from hypothesis import given
from hypothesis import strategies as st

import voxkernel
from voxkernel.errors import MeshError
from voxkernel.halfspaces import HalfSpaces, find_feasibility


def halfspaces_of(surface):
    return HalfSpaces.from_mesh(voxkernel.as_mesh(surface))


def test_cube_planes():
    planes = halfspaces_of(shapes.cube())
    assert len(planes) == 12
    assert planes.bounds_volume
    rows = np.unique(np.column_stack([planes.normals, planes.offsets]).round(12), axis=0)
    low, high = shapes.cube()[0].min(0), shapes.cube()[0].max(0)
    expected = np.concatenate([np.column_stack([np.eye(3), high]), np.column_stack([-np.eye(3), -low])])
    assert np.allclose(rows, expected[np.lexsort(expected.T[::-1])])
    assert planes.weights.sum() == pytest.approx(6.0)


def test_integer_planes_are_the_triangles_exactly():
    vertices, faces = shapes.spiky()
    planes = halfspaces_of((vertices, faces))
    unit = planes.lattice_unit
    for (a, b, c, d), face in zip(planes.integer_planes(range(20)), faces[:20], strict=True):
        for v in vertices[face]:
            x, y, z = (Fraction(float(w)) * unit for w in v)
            assert a * x + b * y + c * z == d


@given(
    shapes.integer_meshes(),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1.0, 1e-7, 1e9]),
    st.floats(-1e6, 1e6),
)
def test_rounding_bound_holds(mesh, seed, size, shift):
    """|n . x - d| in floating point differs from the exact distance by at most the stated bound."""
    vertices, faces = mesh
    rng = np.random.default_rng(seed)
    vertices = (vertices @ shapes.random_rotation(rng).T) * size + shift
    try:
        planes = halfspaces_of((vertices, faces))
    except MeshError:
        return
    local = rng.uniform(-1.5, 1.5, 3)
    x = planes.to_lattice(local)
    bound = planes.local_errors * (np.linalg.norm(local) + 1)
    values = planes.local_normals @ local - planes.local_offsets
    unit = Fraction(planes.scale) * planes.lattice_unit
    for i, (a, b, c, d) in enumerate(planes.integer_planes(range(len(planes)))):
        # Square root of a rational to 80 bits.
        square = Fraction(a * a + b * b + c * c)
        length = Fraction(isqrt(int(square * 4**80)), 2**80)
        exact = (a * x[0] + b * x[1] + c * x[2] - d) / length / unit
        assert abs(Fraction(float(values[i])) - exact) <= Fraction(float(bound[i]))


def test_degenerate_facets_are_dropped_and_counted():
    vertices, faces = shapes.cube()
    extra = np.array([[0, 0, 1], [0, 1, 1]])
    planes = halfspaces_of((vertices, np.concatenate([faces, extra])))
    assert planes.n_degenerate == 2
    assert len(planes) == 12


def test_sliver_keeps_its_exact_plane():
    """A facet 1e-18 wide has an exact plane although its rounded cross product is useless."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-18, 0], [0, 0, 1.0]])
    planes = halfspaces_of((vertices, [[0, 1, 2], [0, 1, 3]]))
    assert np.allclose(planes.normals[0], [0, 0, 1], atol=1e-15)
    assert planes.weights[0] == pytest.approx(0.5e-18)


def test_coplanar_facets_merge_exactly():
    vertices, faces = shapes.cube()
    for _ in range(3):
        vertices, faces = shapes.subdivided(vertices, faces)
    planes = halfspaces_of((vertices, faces))
    merged = planes.merged()
    assert len(merged) == 6
    assert merged.weights == pytest.approx(np.ones(6))
    nudged = vertices.copy()
    inner = np.flatnonzero(((vertices > vertices.min()) & (vertices < vertices.max())).sum(1) == 2)[0]
    axis = np.flatnonzero((nudged[inner] == vertices.min()) | (nudged[inner] == vertices.max()))[0]
    nudged[inner, axis] = np.nextafter(nudged[inner, axis], 10)
    assert len(halfspaces_of((nudged, faces)).merged()) > 6


@given(shapes.integer_meshes())
def test_merging_agrees_with_rationals(mesh):
    planes = halfspaces_of(mesh)
    groups = planes.coplanar_groups()
    exact = [_primitive(p) for p in planes.integer_planes(range(len(planes)))]
    for i, g in enumerate(groups):
        assert exact[i] == exact[g]
        assert g <= i
    assert len({*groups.tolist()}) == len(set(exact))


def _primitive(plane):
    divisor = gcd(*plane)
    return tuple(v // divisor for v in plane)


def test_explicit_planes_round_trip():
    planes = HalfSpaces.from_planes([[2, 0, 0], [0, -3, 0]], [4, 9], weights=[1, 2])
    assert planes.normals.tolist() == [[1, 0, 0], [0, -1, 0]]
    assert planes.offsets.tolist() == [2, 3]
    assert planes.weights.tolist() == [1, 2]
    more = planes.with_planes([[0, 0, 1]], [0.1])
    assert more.facet_ids.tolist() == [0, 1, -1]
    ((a, b, c, d),) = more.integer_planes([2])
    assert (a, b) == (0, 0)
    assert Fraction(d, c) == Fraction(0.1) * more.lattice_unit


@pytest.mark.parametrize(
    ("normals", "offsets", "text"),
    [
        ([[0, 0, 0]], [1], "zero normal in row 0"),
        ([[1, 0, 0]], [1, 2], "`offsets` must have shape"),
        ([[1, 0, 0]], [np.nan], "`offsets` must be finite"),
        ([[1, 0]], [1], "`normals` must have shape"),
    ],
)
def test_bad_planes(normals, offsets, text):
    with pytest.raises(ValueError, match=text):
        HalfSpaces.from_planes(normals, offsets)


def test_no_area_is_an_error():
    with pytest.raises(MeshError, match="positive area"):
        halfspaces_of(([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))


@pytest.mark.parametrize("factor", [1e100, 1e-100])
def test_sizes_beyond_volumes_are_an_error(factor):
    vertices, faces = shapes.cube()
    with pytest.raises(MeshError, match="rescale first"):
        halfspaces_of((vertices * factor, faces))


@pytest.mark.parametrize(
    ("surface", "closed"),
    [
        (shapes.cube(), True),
        (shapes.torus(), True),
        (shapes.cubes_sharing_an_edge(), True),
        (shapes.open_box(), False),
        (shapes.cube_with_flipped_face(), False),
        (shapes.moebius_band(), False),
    ],
)
def test_bounds_volume(surface, closed):
    assert halfspaces_of(surface).bounds_volume is closed


def test_planes_for_signs_are_those_for_all():
    planes = HalfSpaces.from_mesh(voxkernel.as_mesh(shapes.cube()))
    full = planes.with_planes([[1, 0, 0]], [-9.0])
    bare = planes.signs_with_planes([[1, 0, 0]], [-9.0])
    for name in ("local_normals", "local_offsets", "local_errors", "_corners", "_explicit"):
        np.testing.assert_array_equal(getattr(bare, name), getattr(full, name))
    assert bare.weights.shape == bare.facet_ids.shape == (len(full),)
    assert not bare.weights.any()
    one, other = find_feasibility(full), find_feasibility(bare)
    assert one.dimension == other.dimension == -1
    assert one.witnesses[0].ids == other.witnesses[0].ids
