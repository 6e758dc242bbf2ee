"""Many small surfaces at once: what `exact_kernel` says of each, whichever way they are handed in."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.errors import MeshError
from voxkernel.polyhedral.exact_kernels import PackedSurfaces, exact_kernels


def stars(rng, n):
    """Small surfaces: spheres with rough radii, some far away, some of integers (flat and empty kernels among them)."""
    vertices, faces = shapes.uv_sphere(3, 5)
    found = []
    for i in range(n):
        rough = vertices * rng.uniform(0.3, 1.7, (len(vertices), 1))
        if i % 3 == 0:
            rough = np.round(2.0 * rough)
        elif i % 3 == 1:
            rough += 1e4
        found.append((rough, faces))
    return found


def named():
    return [make() for make in (shapes.cube, shapes.l_prism, shapes.two_boxes, shapes.octahedron, shapes.tetrahedron)]


def test_every_row_is_what_exact_kernel_says(rng):
    surfaces = [s for s in stars(rng, 120) + named() if voxkernel.as_mesh(s).facts().is_outward]
    table = exact_kernels(surfaces)
    dimensions = set()
    for i, surface in enumerate(surfaces):
        if table.is_failed[i]:
            assert table.reasons[i]
            continue
        kernel = voxkernel.exact_kernel(surface)
        assert table.dimension[i] == kernel.dimension
        dimensions.add(kernel.dimension)
        if kernel.dimension == 3:
            assert table.kernel_volume[i] == pytest.approx(kernel.volume, rel=1e-8)
            assert table.inradius[i] == pytest.approx(kernel.clearance, rel=1e-8)
            assert (table.center[i] == pytest.approx(kernel.deepest_point, abs=1e-2)) or kernel.volume > 0
    assert {-1, 3} <= dimensions


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("noise", [0.0, 1e-13, 1e-10, 1e-7])
def test_facets_that_are_nearly_coplanar(noise, times, rng):
    """Flat facets cut in four, once or twice, and moved by a little: which planes meet is known, not guessed."""
    vertices, faces = shapes.icosphere(0)
    for _ in range(times):
        vertices, faces = shapes.subdivided(vertices, faces)
    surfaces = [(vertices + noise * rng.normal(size=vertices.shape), faces) for _ in range(4)]
    table = exact_kernels(surfaces)
    assert set(table.decided_by) <= {"convex", "interior point", "exact"}
    if 1e-11 < noise and times == 1:  # too near for faces that are cut out one by one; a dual hull tells
        assert "exact" not in table.decided_by
    for i, surface in enumerate(surfaces):
        kernel = voxkernel.exact_kernel(surface)
        assert table.kernel_volume[i] == pytest.approx(kernel.volume, rel=1e-9)
        assert kernel.volume_bounds[0] * (1 - 1e-9) <= table.kernel_volume[i] <= kernel.volume_bounds[1] * (1 + 1e-9)
        assert table.inradius[i] == pytest.approx(kernel.clearance, rel=1e-9)
        assert table.volume_share[i] <= 1.0


def test_packed_arrays_and_threads_change_nothing(rng):
    surfaces = [*stars(rng, 700), *named()]
    meshes = [voxkernel.as_mesh(s) for s in surfaces]
    starts = np.cumsum([0] + [len(m.faces) for m in meshes])
    shifts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    vertices = np.concatenate([m.vertices for m in meshes])
    faces = np.concatenate([m.faces + s for m, s in zip(meshes, shifts[:-1], strict=True)])
    expected = exact_kernels(meshes)
    for other in (exact_kernels(PackedSurfaces(vertices, faces, starts)), exact_kernels(surfaces, threads=3)):
        for name in ("dimension", "kernel_volume", "inradius", "center", "volume"):
            assert np.array_equal(getattr(other, name), getattr(expected, name), equal_nan=True)
        assert other.decided_by == expected.decided_by
        assert other.facets == expected.facets


def test_surfaces_that_cannot_have_one_are_rows_with_reasons():
    table = exact_kernels([shapes.open_box(), shapes.inside_out_cube(), shapes.cube_with_flipped_face(), shapes.cube()])
    assert table.dimension.tolist() == [-2, -2, -2, 3]
    for reason, word in zip(table.reasons, ("open", "inside out", "inconsistent", ""), strict=True):
        assert word in reason


@pytest.mark.parametrize(
    ("surfaces", "error", "text"),
    [
        ([], MeshError, "`surfaces` must hold at least one surface; got 0"),
        (shapes.cube()[0], TypeError, "`surfaces` must be a sequence of meshes or PackedSurfaces; got ndarray"),
        (3, TypeError, "got int"),
        (PackedSurfaces(np.eye(3), [[0, 1, 2]], [0]), MeshError, "at least one surface"),
        (PackedSurfaces(np.eye(3), [[0, 1, 2]], [0, 2]), MeshError, "must rise from 0 to 1; got 0 to 2"),
        (PackedSurfaces(np.eye(3), [[0, 1, 2]], [0, 1, 0, 1]), MeshError, "got 0 to 1 with a fall between"),
        (PackedSurfaces(np.eye(3), [[0, 1, 3]], [0, 1]), MeshError, "`surfaces.faces` must be in 0..2; got 3"),
        (PackedSurfaces(np.full((3, 3), np.nan), [[0, 1, 2]], [0, 1]), MeshError, "`surfaces.vertices` must be finite"),
    ],
)
def test_bad_surfaces(surfaces, error, text):
    with pytest.raises(error, match=text):
        exact_kernels(surfaces)


def test_polygons_are_for_cell_kernels():
    box = voxkernel.TriangleMesh.from_polygons(*shapes.truncated_octahedron())
    with pytest.raises(MeshError, match=r"got polygons in surface 1 \(`cell_kernels` takes them\)"):
        exact_kernels([shapes.cube(), box])
