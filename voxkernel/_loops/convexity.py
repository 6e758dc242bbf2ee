"""Whether a closed triangle surface is locally convex at every edge, decided exactly."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.coplanar import orient3d_exact


@njit(cache=NUMBA_CACHE, nogil=True)
def edges_are_convex(vertices, faces, face_planes, plane_corners, order, keys):  # type: ignore[no-untyped-def]
    """Test every edge shared by two facets: the far corner of each lies on or below the plane of the other.

    `order` sorts the 3 m half-edges (edge k of face f is 3 f + k) by `keys`, equal for the two halves
    of an edge. False where an edge does not have exactly two faces, or the test fails.
    """
    n = order.shape[0]
    p = 0
    while p < n:
        if p + 1 >= n or keys[p] != keys[p + 1] or (p + 2 < n and keys[p + 2] == keys[p]):
            return False
        for swap in range(2):
            this = order[p + swap]
            other = order[p + 1 - swap]
            f = this // 3
            g = other // 3
            if face_planes[f] == face_planes[g]:
                continue
            far = faces[g, (other % 3 + 2) % 3]
            a = vertices[plane_corners[face_planes[f], 0]]
            b = vertices[plane_corners[face_planes[f], 1]]
            c = vertices[plane_corners[face_planes[f], 2]]
            d = vertices[far]
            if orientation(a, b, c, d) > 0.0:
                return False
        p += 2
    return True


@njit(cache=NUMBA_CACHE, nogil=True)
def orientation(a, b, c, d):  # type: ignore[no-untyped-def]
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
