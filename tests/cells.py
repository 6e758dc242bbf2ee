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
