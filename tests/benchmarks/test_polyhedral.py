"""`cell_kernels` beside SciPy, one cell after the other (HiGHS, Qhull twice), on cells of 20 facets."""

import numpy as np
import pytest
from cells import hull_cell, sphere_points, voronoi_like_cell
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from voxkernel.polyhedral import PolyhedralMesh, cell_kernels

N_SHAPES, N_CELLS, N_SCIPY = 200, 20_000, 200


def triangle_cell(rng, low):
    """Hull of 12 points of the sphere, 20 triangles, corners then pulled in to radii between `low` and 1."""
    points, faces = hull_cell(sphere_points(rng, 12))
    return points * rng.uniform(low, 1.0, 12)[:, None], faces.tolist()


FAMILIES = {
    "convex, triangles": lambda rng: triangle_cell(rng, 1.0),
    "convex, Voronoi-like": lambda rng: voronoi_like_cell(rng, 20),
    "star": lambda rng: triangle_cell(rng, 0.6),
}


def scipy_cell(vertices, polygons):
    """Volume and depth of one kernel as a user of SciPy would get them; planes of the first three corners."""
    a, b, c = (vertices[[p[k] for p in polygons]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = np.einsum("ij,ij->i", normals, a)
    free = [(None, None)] * 4
    answer = linprog([0, 0, 0, -1], A_ub=np.column_stack([normals, np.ones(len(normals))]), b_ub=offsets, bounds=free)
    if answer.x is None or answer.x[3] <= 0:
        return 0.0, 0.0
    corners = HalfspaceIntersection(np.column_stack([normals, -offsets]), answer.x[:3]).intersections
    return ConvexHull(corners).volume, float(answer.x[3])


@pytest.mark.parametrize("family", list(FAMILIES))
def test_cells_of_20_facets(side_by_side, family):
    rng = np.random.default_rng(7)
    cells = [FAMILIES[family](rng) for _ in range(N_SHAPES)]
    few, many = PolyhedralMesh.from_cells(cells), PolyhedralMesh.from_cells(cells * (N_CELLS // N_SHAPES))
    assert (few.cell_offsets[1:] - few.cell_offsets[:-1] == 20).all()
    found = cell_kernels(few)  # compiled loops
    answer = side_by_side(
        f"{N_CELLS} cells, {family} (scipy: {N_SCIPY})",
        {
            "voxkernel": lambda: cell_kernels(many),
            "voxkernel, 2 threads": lambda: cell_kernels(many, threads=2),
            "scipy": lambda: [scipy_cell(*cell) for cell in cells[:N_SCIPY]],
        },
    )
    rate = N_CELLS / answer["voxkernel"][0]
    print(
        f"\n{family}: {rate:.0f} cells/s, {rate / (N_SCIPY / answer['scipy'][0]):.0f} times SciPy; "
        f"{found.decided_by.count('exact')} of {N_SHAPES} left to the general code"
    )
    volumes, depths = np.array(answer["scipy"][1]).T
    np.testing.assert_allclose(found.kernel_volume[:N_SCIPY], volumes, rtol=1e-6)
    solid = found.dimension[:N_SCIPY] == 3
    np.testing.assert_allclose(found.inradius[:N_SCIPY][solid], depths[solid], rtol=1e-6)
