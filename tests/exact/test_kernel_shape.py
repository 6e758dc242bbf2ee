"""Kernels beyond the digits of doubles: exact axes, faces, depth and moments of what is thin, small or far."""

from fractions import Fraction
from itertools import pairwise
from math import lcm

import numpy as np
import oracle
import pytest
import shapes
from rational_cutting import clip_polyhedron
from scipy.spatial import ConvexHull, HalfspaceIntersection

from voxkernel.exact import exact_kernel
from voxkernel.exact.rational_moments import solid_moments
from voxkernel.halfspaces import HalfSpaces, find_feasibility
from voxkernel.mesh import as_mesh


def signed_volume(kernel):
    """Of the faces as they are turned, about the centroid."""
    corners = kernel.vertices - kernel.centroid
    total = 0.0
    for ring in kernel.faces:
        a = corners[ring[0]]
        total += sum(a @ np.cross(corners[p], corners[q]) for p, q in pairwise(ring[1:])) / 6
    return total


def wedge(tilt, rng):
    """Large triangles on planes about the origin that are parallel but for `tilt`, half of them turned over."""
    base = rng.normal(size=3)
    normals = np.array([1, 1, -1, -1])[:, None] * base + tilt * rng.normal(size=(4, 3))
    corners = []
    for normal in normals:
        normal = normal / np.linalg.norm(normal)
        across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        along = np.cross(normal, across)
        corners += [across, along - across, -along - across]
    return shapes.mesh(corners, np.arange(12).reshape(4, 3))


@pytest.mark.parametrize("tilt", [1e-2, 1e-5, 1e-8, 1e-11])
@pytest.mark.parametrize("seed", range(3))
def test_faces_of_thin_kernels_look_outwards(tilt, seed):
    """A thin wedge inside the 642 planes of a ball: far too many for rationals, too thin for doubles."""
    surface = wedge(tilt, np.random.default_rng(seed))
    kernel = exact_kernel(surface)
    assert kernel.dimension == 3
    size = np.abs(kernel.vertices).max()
    assert signed_volume(kernel) == pytest.approx(kernel.volume, rel=1e-2)
    assert 1e-2 * tilt * size < kernel.clearance < 10 * tilt * size
    assert kernel.max_residual < 1e-12 * size
    assert kernel.volume_bounds[1] < kernel.volume * (1 + 1e-8)
    planes = oracle.corner_planes(*surface)
    assert all(oracle.is_inside(planes, p) for p in kernel.certificate.points)


@pytest.mark.parametrize("aspect", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("axes", [(1, 1, 0), (0, 0, 1), (0, 1, 2)], ids=["needle", "plate", "blade"])
@pytest.mark.parametrize("make", [lambda: shapes.icosphere(1), shapes.spiky], ids=["convex", "star"])
def test_stretched_surfaces_have_the_stretched_kernel(aspect, axes, make):
    """Powers of two along the axes change no digit: the kernel stretches with the surface."""
    factors = 2.0 ** np.round(np.log2(aspect) * np.array(axes) / max(axes))
    vertices, faces = make()
    here, there = exact_kernel((vertices, faces)), exact_kernel((vertices * factors, faces))
    assert there.dimension == 3
    assert there.volume == pytest.approx(here.volume * factors.prod(), rel=1e-9)
    assert there.volume_bounds[0] <= here.volume * factors.prod() * (1 + 1e-12)
    assert there.volume_bounds[1] >= here.volume * factors.prod() * (1 - 1e-12)
    assert there.inertia == pytest.approx(here.inertia * np.outer(factors, factors) * factors.prod(), rel=1e-6, abs=1e-9 * np.trace(there.inertia))  # fmt: skip # noqa: E501
    assert len(there.faces) == len(here.faces)
    assert sorted(there.face_facets.tolist()) == sorted(here.face_facets.tolist())
    assert there.certificate.verify()
    # the deepest point is as deep as its clearance says, and no point of the kernel is deeper
    planes = [p for p in oracle.corner_planes(vertices * factors, faces) if p is not None]
    lengths = [float(np.linalg.norm(np.array(p[:3], dtype=object).astype(float))) for p in planes]

    def depth(point):
        exact = oracle.point(point)
        return min(
            float(p[3] - sum(n * x for n, x in zip(p[:3], exact, strict=True))) / length
            for p, length in zip(planes, lengths, strict=True)
        )

    size = np.abs(there.vertices).max()
    assert depth(there.deepest_point) == pytest.approx(there.clearance, rel=1e-6, abs=1e-15 * size)
    towards = [there.centroid, *there.vertices[:: max(1, len(there.vertices) // 10)]]
    for target in towards:
        for share in (0.9, 0.5, 0.01):
            point = there.deepest_point * (1 - share) + target * share
            assert depth(point) <= there.clearance * (1 + 1e-9) + 1e-15 * size


def homogeneous(point):
    below = lcm(*(v.denominator for v in point))
    return (*(int(v * below) for v in point), below)


def tangent(n, rng):
    directions = rng.normal(size=(n, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


@pytest.mark.parametrize("n", [100, 1000])
@pytest.mark.parametrize("size", [1e-4, 1e-9])
def test_many_planes_about_a_small_ball_far_from_the_origin(n, size, rng):
    directions = tangent(n, rng)
    planes = HalfSpaces.from_planes(directions, directions @ [0.7, -0.3, 0.2] + size)
    kernel = exact_kernel(planes)
    known = ConvexHull(HalfspaceIntersection(np.column_stack([directions, -np.ones(n)]), np.zeros(3)).intersections)
    assert kernel.volume == pytest.approx(known.volume * size**3, rel=1e-5)
    assert kernel.clearance == pytest.approx(size, rel=1e-5)
    assert signed_volume(kernel) > 0


@pytest.mark.parametrize("size", [1e-5, 1e-8, 1e-11])
def test_a_small_kernel_is_what_cutting_in_rationals_leaves(size, rng):
    near = tangent(40, rng)
    offsets = near @ [0.1, 0.2, 0.3] + size * rng.uniform(1, 2, 40)
    planes = HalfSpaces.from_planes(near, offsets)
    kernel = exact_kernel(planes)
    center = [Fraction(v) for v in (0.1, 0.2, 0.3)]
    rows = [([Fraction(v) for v in n], Fraction(d) - sum(Fraction(v) * c for v, c in zip(n, center, strict=True))) for n, d in zip(near.tolist(), offsets.tolist(), strict=True)]  # fmt: skip # noqa: E501
    cut = clip_polyhedron(rows, Fraction(10 * size))
    volume = solid_moments([homogeneous(p) for p in cut.vertices], [f for _, f in cut.faces])[0]
    assert kernel.volume == pytest.approx(float(volume), rel=1e-12)
    assert sorted(kernel.face_facets.tolist()) == sorted(row for row, _ in cut.faces)
    exact = {tuple(v - c for v, c in zip(p, center, strict=True)) for p in kernel.exact_vertices()}
    assert exact == set(cut.vertices)


@pytest.mark.parametrize("thickness", [1, Fraction(1, 10**9), Fraction(1, 10**40), Fraction(1, 10**300)])
def test_moments_of_a_rational_box(thickness):
    rows = [((1, 0, 0), Fraction(2)), ((-1, 0, 0), Fraction(0)), ((0, 1, 0), Fraction(1)), ((0, -1, 0), Fraction(0)),
            ((0, 0, 1), Fraction(thickness)), ((0, 0, -1), Fraction(0))]  # fmt: skip
    box = clip_polyhedron(rows, Fraction(8))
    assert len(box.vertices) == 8
    volume, area, centroid, inertia = solid_moments([homogeneous(p) for p in box.vertices], [f for _, f in box.faces])
    assert float(volume / thickness) == pytest.approx(2, rel=1e-15)
    assert float(area) == pytest.approx(4 + 6 * float(thickness), rel=1e-14)
    x, y, z = centroid
    assert [float(x), float(y), float(z / thickness)] == pytest.approx([1, 0.5, 0.5], rel=1e-15)
    for k, edge in enumerate((2, 1, thickness)):
        assert float(inertia[k][k] / (thickness * edge**2)) == pytest.approx(2 / 12, rel=1e-14)
    assert abs(float(inertia[0][1] / thickness)) < 1e-15


def test_an_unproven_solid_with_many_planes_is_not_left_to_rationals(rng):
    """Too thin for a floating-point proof, too many planes to cut one by one."""
    vertices, faces = shapes.ellipsoid((1, 1, 2.0**-52), 3)
    mesh = as_mesh((shapes.moved(vertices, shapes.quarter_turns()[5]), faces))
    planes = HalfSpaces.from_mesh(mesh)
    assert find_feasibility(planes).clearance < 1e-15
    kernel = exact_kernel(mesh)
    round_kernel = exact_kernel(shapes.icosphere(3))
    assert kernel.volume == pytest.approx(round_kernel.volume * 2.0**-52, rel=1e-8)


@pytest.mark.parametrize("slenderness", [1e3, 1e5, 9e5])
def test_slender_facets_blur_no_plane(slenderness, rng):
    """Facets as slender as floating point takes them, around a kernel that their planes decide."""
    normals = tangent(30, rng)
    corners = []
    for normal in normals:
        across = np.cross(normal, rng.normal(size=3))
        across /= np.linalg.norm(across)
        along = np.cross(normal, across)
        corners += [normal * 1e-2 - across, normal * 1e-2 + across, normal * 1e-2 + along / slenderness]
    vertices, faces = shapes.joined(shapes.box((-2,) * 3, (2,) * 3), shapes.mesh(corners, np.arange(90).reshape(30, 3)))
    truth = oracle.mesh_kernel(vertices, faces)
    kernel = exact_kernel((vertices, faces))
    assert kernel.dimension == truth.dimension == 3
    assert kernel.volume == pytest.approx(float(truth.volume), rel=1e-12)
    planes = [p for p in oracle.corner_planes(vertices, faces) if p is not None]
    point = oracle.point(kernel.deepest_point)
    depths = [float(-Fraction(sum(n * x for n, x in zip(p, point, strict=False)) - p[3])) / float(np.linalg.norm(np.array(p[:3], dtype=float))) for p in planes]  # fmt: skip # noqa: E501
    assert min(depths) == pytest.approx(kernel.clearance, rel=1e-12)
