"""`label_stars` by size and family; kernels of star polyhedra beside Qhull."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

from voxkernel import label_stars, star_polyhedra_kernels
from voxkernel.labels.ray_sets import golden_rays, outward_faces

sys.path.append(str(Path(__file__).parents[2] / "datasets_tools"))
COUNTS = {("ball", 20): 40, ("ellipsoid", 20): 40, ("bean", 20): 20, ("c", 20): 10, ("dumbbell", 20): 10,
          ("shell", 20): 5, ("ball", 40): 20, ("ellipsoid", 40): 20, ("bean", 40): 5, ("c", 40): 2,
          ("dumbbell", 40): 2}  # fmt: skip


@pytest.mark.parametrize(("family", "size"), list(COUNTS))
def test_objects(side_by_side, family, size):
    from label_formulas import FAMILIES, voxels

    n = COUNTS[family, size]
    image = np.zeros((n * size, size, size), np.uint16)
    for k in range(n):
        rng = np.random.default_rng([1, k])
        image[k * size : (k + 1) * size][voxels(FAMILIES[family](rng), size, rng)] = k + 1
    answer = side_by_side(
        f"{n} objects, {family}, {size}^3",
        {"voxkernel": lambda: label_stars(image, spacing=(1, 1, 1))},
        rounds=2, clock=time.process_time,
    )  # fmt: skip
    seconds, stars = answer["voxkernel"]
    print(
        f"\n{family} {size}: {n / seconds:.1f} objects/s of {stars.voxels.mean():.0f} voxels, V* "
        f"{stars.visible.min():.3f} to {stars.visible.max():.3f}, certified {stars.is_certified.mean():.0%}"
    )
    assert stars.is_certified[stars.voxels <= 6000].all()


def qhull_kernel(corners, faces):
    a, b, c = (corners[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = np.einsum("ij,ij->i", normals, a)
    points = HalfspaceIntersection(np.column_stack([normals, -offsets]), np.zeros(3)).intersections
    return ConvexHull(points).volume


@pytest.mark.parametrize("n_rays", [96, 192])
def test_kernels_of_star_polyhedra(side_by_side, n_rays):
    rng = np.random.default_rng(5)
    rays, n = golden_rays(n_rays), 150
    faces = outward_faces(rays)
    distances = 10 * (1 + 0.05 * rng.random((n, n_rays)))
    answer = side_by_side(
        f"{n} kernels, {n_rays} rays",
        {
            "voxkernel": lambda: star_polyhedra_kernels(np.zeros((n, 3)), distances, rays),
            "qhull": lambda: [qhull_kernel(rays * d[:, None], faces) for d in distances],
        },
        rounds=2, clock=time.process_time,
    )  # fmt: skip
    np.testing.assert_allclose(answer["voxkernel"][1].volume, answer["qhull"][1], rtol=1e-6)
    print(f"\n{n_rays} rays: {1e3 * answer['voxkernel'][0] / n:.3f} ms a kernel; "
          f"{answer['voxkernel'][1].n_general} left to the general code")  # fmt: skip
