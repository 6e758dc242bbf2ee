"""Whether a closed triangle surface is locally convex at every edge, decided exactly."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.coplanar import orient3d_exact
from voxkernel._loops.sorting import sort_range


@njit(cache=NUMBA_CACHE, nogil=True)
def halfedge_twins(faces, n_vertices):
    """Pair the half-edges of a surface: edge k of face f is 3 f + k, from corner k to corner k + 1.

    -1 where an edge does not have exactly two faces that traverse it in opposite directions.
    Half-edges are bucketed by their smaller vertex, so the time is linear.
    """
    m = faces.shape[0]
    start = np.zeros(n_vertices + 1, np.int64)
    for f in range(m):
        for k in range(3):
            start[min(faces[f, k], faces[f, (k + 1) % 3]) + 1] += 1
    for v in range(n_vertices):
        start[v + 1] += start[v]
    fill = start[:-1].copy()
    other = np.empty(3 * m, np.int64)
    edge = np.empty(3 * m, np.int64)
    for f in range(m):
        for k in range(3):
            a = faces[f, k]
            b = faces[f, (k + 1) % 3]
            v = min(a, b)
            other[fill[v]] = max(a, b)
            edge[fill[v]] = 3 * f + k
            fill[v] += 1
    twins = np.full(3 * m, -1, np.int64)
    for v in range(n_vertices):
        low = start[v]
        high = start[v + 1]
        sort_range(other, edge, low, high)
        j = low
        while j < high:
            end = j + 1
            while end < high and other[end] == other[j]:
                end += 1
            if end - j == 2:
                one = edge[j]
                two = edge[j + 1]
                if faces[one // 3, one % 3] != faces[two // 3, two % 3]:
                    twins[one] = two
                    twins[two] = one
            j = end
    return twins


@njit(cache=NUMBA_CACHE, nogil=True)
def edge_convexity(vertices, faces, twins, face_planes, plane_corners):
    """Test every edge between two facets: 2 all strictly convex, 1 some flat, 0 some concave or without twin."""
    answer = 2
    for this in range(twins.shape[0]):
        other = twins[this]
        if other < 0:
            return 0
        f = this // 3
        g = other // 3
        if face_planes[f] == face_planes[g]:
            continue
        plane = plane_corners[face_planes[f]]
        far = faces[g, (other % 3 + 2) % 3]
        side = orientation(vertices[plane[0]], vertices[plane[1]], vertices[plane[2]], vertices[far])
        if side > 0.0:
            return 0
        if side == 0.0:
            answer = 1
    return answer


@njit(cache=NUMBA_CACHE, nogil=True)
def orientation(a, b, c, d):
    """Sign of ((b - a) x (c - a)) . (d - a): positive above the triangle; filtered, then exact."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    det = (uy * vz - uz * vy) * wx + (uz * vx - ux * vz) * wy + (ux * vy - uy * vx) * wz
    size = (
        (abs(uy * vz) + abs(uz * vy)) * abs(wx)
        + (abs(uz * vx) + abs(ux * vz)) * abs(wy)
        + (abs(ux * vy) + abs(uy * vx)) * abs(wz)
    )
    if abs(det) > 1e-15 * size + 1e-290:
        return det
    # orient3d_exact has the opposite handedness: it is positive below the triangle.
    return -orient3d_exact(a, b, c, d)
