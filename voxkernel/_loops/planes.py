"""Facet planes in local coordinates, each with a bound on its rounding error."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.sorting import sort_keys

UNIT_ROUNDOFF = 2.0**-53
# Triangles with |e1||e2| above this multiple of twice their area are left to exact arithmetic.
MAX_SLENDERNESS = 1e6
# Up to this multiple, the first corner will do as the apex.
ROUND_ENOUGH = 4.0


@njit(cache=NUMBA_CACHE, nogil=True)
def facet_planes(vertices, corners, origin, inverse_scale, normals, offsets, areas, errors):
    """Fill unit normals, offsets, areas and relative error bounds; return the number left undecided.

    The corner opposite the longest edge is the best apex of the cross product; where the first corner is
    nearly as good, it is taken without a choice, which is what most facets need.
    `errors[i]` bounds the error of `n . x - d` divided by `|x| + 1`, for local `x`; it is -1 where
    the plane must be computed exactly and -2 where two corners coincide (no area).
    Bound: an edge has relative error u, a cross product of edges 7 u |e1||e2|, its direction twice
    that over |e1 x e2|; the dot products add less than 8 u (|x| + 1).
    """
    undecided = 0
    ox, oy, oz = origin[0], origin[1], origin[2]
    for i in range(corners.shape[0]):
        a = corners[i, 0]
        b = corners[i, 1]
        c = corners[i, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        bx, by, bz = vertices[b, 0], vertices[b, 1], vertices[b, 2]
        cx, cy, cz = vertices[c, 0], vertices[c, 1], vertices[c, 2]
        # The edges c to a and a to b: a is the apex unless its angle is small or wide.
        ux, uy, uz = (ax - cx) * inverse_scale, (ay - cy) * inverse_scale, (az - cz) * inverse_scale
        vx, vy, vz = (bx - ax) * inverse_scale, (by - ay) * inverse_scale, (bz - az) * inverse_scale
        x, y, z = ax, ay, az
        nx = uy * vz - uz * vy
        ny = uz * vx - ux * vz
        nz = ux * vy - uy * vx
        square = nx * nx + ny * ny + nz * nz
        ca = ux * ux + uy * uy + uz * uz
        ab = vx * vx + vy * vy + vz * vz
        product = ca * ab
        error = (20.0 * ROUND_ENOUGH + 8.0) * UNIT_ROUNDOFF
        if product < 1e-270 or square * (ROUND_ENOUGH * ROUND_ENOUGH) < product:
            qx, qy, qz = (cx - bx) * inverse_scale, (cy - by) * inverse_scale, (cz - bz) * inverse_scale
            bc = qx * qx + qy * qy + qz * qz
            if ab >= bc and ab >= ca:  # c is the apex
                product = bc * ca
                vx, vy, vz, ux, uy, uz = ux, uy, uz, qx, qy, qz
                x, y, z = cx, cy, cz
            elif ca >= bc:  # b is the apex
                product = ab * bc
                ux, uy, uz, vx, vy, vz = vx, vy, vz, qx, qy, qz
                x, y, z = bx, by, bz
            nx = uy * vz - uz * vy
            ny = uz * vx - ux * vz
            nz = ux * vy - uy * vx
            square = nx * nx + ny * ny + nz * nz
            if square > 0.0:
                error = (20.0 * np.sqrt(product / square) + 8.0) * UNIT_ROUNDOFF
        if product < 1e-270 or not square * (MAX_SLENDERNESS * MAX_SLENDERNESS) > product:
            normals[i, 0] = 0.0
            normals[i, 1] = 0.0
            normals[i, 2] = 0.0
            offsets[i] = 0.0
            areas[i] = 0.0
            if (
                (ax == bx and ay == by and az == bz)
                or (ax == cx and ay == cy and az == cz)
                or (bx == cx and by == cy and bz == cz)
            ):
                errors[i] = -2.0
            else:
                errors[i] = -1.0
                undecided += 1
            continue
        length = np.sqrt(square)
        inverse = 1.0 / length
        nx *= inverse
        ny *= inverse
        nz *= inverse
        normals[i, 0] = nx
        normals[i, 1] = ny
        normals[i, 2] = nz
        offsets[i] = (
            nx * ((x - ox) * inverse_scale) + ny * ((y - oy) * inverse_scale) + nz * ((z - oz) * inverse_scale)
        )
        areas[i] = 0.5 * length
        errors[i] = error
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
        sort_keys(keys, low, high)
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
