"""Cells of polyhedral meshes by formula, for the tests of several folders."""

import numpy as np


def as_cell(mesh):
    """(vertices, list of polygons) of a mesh of triangles or polygons."""
    return np.asarray(mesh[0], float), [list(map(int, polygon)) for polygon in mesh[1]]


def sphere_points(rng, n):
    points = rng.standard_normal((n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def hull_cell(points):
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    corners = points[faces]
    turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (turn * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces


def voronoi_like_cell(rng, n):
    """A simple polyhedron of n tangent planes of the sphere: polygons of many sizes, planar up to rounding."""
    from scipy.spatial import ConvexHull

    while True:
        normals = sphere_points(rng, n)
        hull = ConvexHull(normals)
        vertices = -hull.equations[:, :3] / hull.equations[:, 3:]
        if (hull.equations[:, 3] < -0.3).all():
            break
    polygons = []
    for i, normal in enumerate(normals):
        ids = np.flatnonzero((hull.simplices == i).any(axis=1))
        u = np.cross(normal, [0.3, 0.5, 0.8])
        offsets = vertices[ids] - vertices[ids].mean(axis=0)
        angles = np.arctan2(offsets @ np.cross(normal, u / np.linalg.norm(u)), offsets @ (u / np.linalg.norm(u)))
        polygons.append(ids[np.argsort(angles)].tolist())
    return vertices, polygons
