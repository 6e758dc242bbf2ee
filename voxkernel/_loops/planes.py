"""Facet planes in local coordinates, each with a bound on its rounding error."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

UNIT_ROUNDOFF = 2.0**-53
# Triangles with |e1||e2| above this multiple of twice their area are left to exact arithmetic.
MAX_SLENDERNESS = 1e6


@njit(cache=NUMBA_CACHE, nogil=True)
def facet_planes(vertices, corners, origin, inverse_scale, normals, offsets, areas, errors):
    """Fill unit normals, offsets, areas and relative error bounds; return the number left undecided.

    The corner opposite the longest edge is the apex: it gives the best conditioned cross product.
    `errors[i]` bounds the error of `n . x - d` divided by `|x| + 1`, for local `x`; it is -1 where
    the plane must be computed exactly and -2 where two corners coincide (no area).
    Bound: an edge has relative error u, a cross product of edges 7 u |e1||e2|, its direction twice
    that over |e1 x e2|; the dot products add less than 8 u (|x| + 1).
    """
    undecided = 0
    edge1 = np.empty(3)
    edge2 = np.empty(3)
    for i in range(corners.shape[0]):
        a = corners[i, 0]
        b = corners[i, 1]
        c = corners[i, 2]
        ab = 0.0
        bc = 0.0
        ca = 0.0
        for k in range(3):
            e = (vertices[b, k] - vertices[a, k]) * inverse_scale
            ab += e * e
            e = (vertices[c, k] - vertices[b, k]) * inverse_scale
            bc += e * e
            e = (vertices[a, k] - vertices[c, k]) * inverse_scale
            ca += e * e
        if ab >= bc and ab >= ca:
            apex, one, two, product = c, a, b, bc * ca
        elif ca >= bc:
            apex, one, two, product = b, c, a, ab * bc
        else:
            apex, one, two, product = a, b, c, ab * ca
        for k in range(3):
            edge1[k] = (vertices[one, k] - vertices[apex, k]) * inverse_scale
            edge2[k] = (vertices[two, k] - vertices[apex, k]) * inverse_scale
        nx = edge1[1] * edge2[2] - edge1[2] * edge2[1]
        ny = edge1[2] * edge2[0] - edge1[0] * edge2[2]
        nz = edge1[0] * edge2[1] - edge1[1] * edge2[0]
        square = nx * nx + ny * ny + nz * nz
        normals[i, 0] = 0.0
        normals[i, 1] = 0.0
        normals[i, 2] = 0.0
        offsets[i] = 0.0
        areas[i] = 0.0
        if product < 1e-270 or not square * (MAX_SLENDERNESS * MAX_SLENDERNESS) > product:
            same = True
            if (
                vertices[a, 0] != vertices[b, 0]
                or vertices[a, 1] != vertices[b, 1]
                or vertices[a, 2] != vertices[b, 2]
            ):
                same = False
            if not same:
                same = True
                if (
                    vertices[a, 0] != vertices[c, 0]
                    or vertices[a, 1] != vertices[c, 1]
                    or vertices[a, 2] != vertices[c, 2]
                ):
                    same = False
            if not same:
                same = True
                if (
                    vertices[b, 0] != vertices[c, 0]
                    or vertices[b, 1] != vertices[c, 1]
                    or vertices[b, 2] != vertices[c, 2]
                ):
                    same = False
            if same:
                errors[i] = -2.0
            else:
                errors[i] = -1.0
                undecided += 1
            continue
        length = np.sqrt(square)
        nx /= length
        ny /= length
        nz /= length
        normals[i, 0] = nx
        normals[i, 1] = ny
        normals[i, 2] = nz
        offsets[i] = (
            nx * ((vertices[apex, 0] - origin[0]) * inverse_scale)
            + ny * ((vertices[apex, 1] - origin[1]) * inverse_scale)
            + nz * ((vertices[apex, 2] - origin[2]) * inverse_scale)
        )
        areas[i] = 0.5 * length
        errors[i] = (20.0 * np.sqrt(product) / length + 8.0) * UNIT_ROUNDOFF
    return undecided


@njit(cache=NUMBA_CACHE, nogil=True)
def coordinate_range(vertices):
    """One pass: lower and upper corner of the bounding box, and the smallest magnitude but zero."""
    low = vertices[0].copy()
    high = vertices[0].copy()
    smallest = np.inf
    for i in range(vertices.shape[0]):
        for k in range(3):
            v = vertices[i, k]
            low[k] = min(low[k], v)
            high[k] = max(high[k], v)
            v = abs(v)
            if 0.0 < v < smallest:
                smallest = v
    return low, high, smallest


@njit(cache=NUMBA_CACHE, nogil=True)
def boundary_is_zero(faces, n_vertices):
    """Whether every edge is traversed equally often in both directions: the surface bounds a volume.

    Edges are bucketed by their smaller vertex, so the time is linear; nothing is hashed.
    """
    start = np.zeros(n_vertices + 1, np.int64)
    for i in range(faces.shape[0]):
        for k in range(3):
            a = faces[i, k]
            b = faces[i, (k + 1) % 3]
            if a != b:
                start[min(a, b) + 1] += 1
    for i in range(n_vertices):
        start[i + 1] += start[i]
    total = start[n_vertices]
    position = start[:-1].copy()
    keys = np.empty(total, np.int64)
    for i in range(faces.shape[0]):
        for k in range(3):
            a = faces[i, k]
            b = faces[i, (k + 1) % 3]
            if a < b:
                keys[position[a]] = 2 * b
                position[a] += 1
            elif b < a:
                keys[position[b]] = 2 * a + 1
                position[b] += 1
    for i in range(n_vertices):
        low = start[i]
        high = start[i + 1]
        if high - low > 64:
            keys[low:high] = np.sort(keys[low:high])
        else:
            for j in range(low + 1, high):
                key = keys[j]
                p = j - 1
                while p >= low and keys[p] > key:
                    keys[p + 1] = keys[p]
                    p -= 1
                keys[p + 1] = key
        j = low
        while j < high:
            other = keys[j] >> 1
            balance = 0
            while j < high and (keys[j] >> 1) == other:
                balance += 1 - 2 * (keys[j] & 1)
                j += 1
            if balance != 0:
                return False
    return True
