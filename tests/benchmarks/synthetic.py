"""Large meshes by formula whose kernels bound a known kind of work, and SciPy as the rival."""

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection


def geodesic_sphere(n_facets):
    """Unit sphere of about `n_facets` triangles: every icosahedron face in frequency^2 parts."""
    frequency = max(1, round((n_facets / 20) ** 0.5))
    golden = (1 + 5**0.5) / 2
    base = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)], float)
    corners = np.concatenate([np.roll(base, k, axis=1) for k in range(3)])
    hull = ConvexHull(corners)
    faces20 = hull.simplices.copy()
    turn = np.cross(
        corners[faces20[:, 1]] - corners[faces20[:, 0]], corners[faces20[:, 2]] - corners[faces20[:, 0]]
    )
    flip = (turn * hull.equations[:, :3]).sum(1) < 0
    faces20[flip] = faces20[flip][:, ::-1]
    rows = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    number = {ij: k for k, ij in enumerate(rows)}
    weights = np.array([(frequency - i - j, i, j) for i, j in rows]) / frequency
    local = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in rows if i + j < frequency]
    local += [
        (number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in rows if i + j < frequency - 1
    ]
    points = np.concatenate([weights @ corners[f] for f in faces20])
    triangles = (np.array(local)[None] + np.arange(20)[:, None, None] * len(rows)).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1)[:, None]
    _, first, inverse = np.unique(
        np.round(points * 1e7).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return points[first], inverse.ravel()[triangles]


def bumpy(n_facets, amplitude, seed=1):
    """Star-shaped body r = 1 + smooth bumps; the larger the amplitude, the smaller the kernel."""
    vertices, faces = geodesic_sphere(n_facets)
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(12, 3)) * 3
    r = 1 + amplitude * np.cos(vertices @ waves.T + rng.uniform(0, 6, 12)).mean(axis=1)
    return vertices * r[:, None], faces


def ellipsoid(n_facets):
    """Convex: every facet bounds the kernel."""
    vertices, faces = geodesic_sphere(n_facets)
    return vertices * [1.0, 0.7, 0.5], faces


CASES = {"small": lambda n: bumpy(n, 0.5), "medium": lambda n: bumpy(n, 0.12), "large": ellipsoid}


def scipy_kernel(vertices, faces):
    """Do what a user of SciPy would: HiGHS over all rows for a deep point, Qhull for corners and volume."""
    p = vertices[faces[:, 0]]
    n = np.cross(vertices[faces[:, 1]] - p, vertices[faces[:, 2]] - p)
    n /= np.linalg.norm(n, axis=1)[:, None]
    d = np.einsum("ij,ij->i", n, p)
    answer = linprog(
        [0, 0, 0, -1],
        A_ub=np.column_stack([n, np.ones(len(n))]),
        b_ub=d,
        bounds=[(None, None)] * 3 + [(None, None)],
    )
    if answer.x is None or answer.x[3] <= 0:
        return 0.0
    corners = HalfspaceIntersection(np.column_stack([n, -d]), answer.x[:3]).intersections
    return ConvexHull(corners).volume
