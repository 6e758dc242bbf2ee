"""The kernels of many polyhedral cells in one loop."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.cell_gather import LARGEST, gather, largest_sizes, local_frame
from voxkernel._loops.cell_kernel import UNIT, clipped_volume, excess_and_convexity, proves_empty, proves_empty_near
from voxkernel._loops.cell_planes import (
    CLOSED,
    OPEN,
    edge_balance,
    fan_area,
    fan_volume,
    polygon_planes,
    solid_angle,
    squared_diameter,
)
from voxkernel._loops.linear_program import deepest_point
from voxkernel._loops.planes import facet_planes

# Outcomes: what decided a cell, or what is wrong with it.
UNDECIDED, CONVEX, SOLID, EMPTY, EMPTY_NEAR = 0, 1, 2, 3, 4
IS_OPEN, IS_TURNED, IS_INSIDE_OUT, IS_NOT_FINITE, HAS_BAD_FACE = -1, -2, -3, -4, -5

MAX_PLANES = 256  # more go to the general code, which is faster there
_THIN = 1e-4  # kernels with less depth for their size are left to the general code
_ROUNDING = 1e-9  # largest relative error of a volume
_NEARLY = 1e-11


@njit(cache=NUMBA_CACHE, nogil=True)
def _all_planes(raw, ring, start, n_faces, rtol, corners, extra, apex, plane_face, is_planar):
    """Planes of all faces as `TriangleMesh.from_polygons` makes them; -1 where that is not sure."""
    n_planes = 0
    for f in range(n_faces):
        before = n_planes
        n_planes, apex[f] = polygon_planes(raw, ring, start[f], start[f + 1], rtol, corners, extra, n_planes)
        if n_planes < 0 or n_planes > MAX_PLANES:
            return -1
        is_planar[f] = n_planes == before + 1
        for p in range(before, n_planes):
            plane_face[p] = f
    return n_planes


@njit(cache=NUMBA_CACHE, nogil=True)
def _drop_repeated(corners, extra, plane_face, normals, offsets, errors, n_planes):
    """Leave out triangles with two equal corners, which have no plane; -1 where a plane needs exact arithmetic."""
    n = 0
    largest = 0.0
    for p in range(n_planes):
        if errors[p] == -2.0:
            continue
        if errors[p] < 0.0:
            return -1, 0.0
        largest = max(largest, errors[p])
        for axis in range(3):
            corners[n, axis] = corners[p, axis]
            normals[n, axis] = normals[p, axis]
        offsets[n] = offsets[p]
        errors[n] = errors[p] + extra[p]
        plane_face[n] = plane_face[p]
        n += 1
    return n, largest


@njit(cache=NUMBA_CACHE, nogil=True)
def _depth(normals, offsets, errors, n_planes, point):
    """Smallest slack at a point, and a certain lower bound on it."""
    size = np.sqrt(point[0] * point[0] + point[1] * point[1] + point[2] * point[2]) + 1.0
    smallest = np.inf
    certain = np.inf
    for p in range(n_planes):
        slack = offsets[p] - (normals[p, 0] * point[0] + normals[p, 1] * point[1] + normals[p, 2] * point[2])
        smallest = min(smallest, slack)
        certain = min(certain, slack - errors[p] * size)
    return smallest, certain


@njit(cache=NUMBA_CACHE, nogil=True)
def solve_cells(
    vertices, face_offsets, face_vertices, cell_offsets, cell_faces, cell_flips,
    first, last, rtol, outcome, numbers, center, witness,
):  # fmt: skip
    """Solve the cells first .. last - 1, each as far as floating point with bounds goes.

    Fills, per cell: outcome; numbers = (volume, diameter, kernel volume, inradius), world units, as far as known (the
    first is a count of edges for cells that are not closed); center, deepest point of a solid kernel; witness, the
    faces that prove an empty one.
    """
    n_f, n_c = largest_sizes(face_offsets, cell_offsets, cell_faces, first, last)
    n_p = n_c
    most = min(n_p, MAX_PLANES)
    number = np.full(vertices.shape[0], -1, np.int64)
    used, ring, keys = np.empty(n_c, np.int64), np.empty(n_c, np.int64), np.empty(n_c, np.int64)
    count, fill, own = np.empty(n_c + 1, np.int64), np.empty(n_c + 1, np.int64), np.empty(n_c, np.int64)
    start, apex, is_planar = np.empty(n_f + 1, np.int64), np.empty(n_f, np.int64), np.empty(n_f, np.bool_)
    raw, points, origin = np.empty((n_c, 3)), np.empty((n_c, 3)), np.empty(3)
    corners, plane_face, extra = np.empty((n_p, 3), np.int64), np.empty(n_p, np.int64), np.empty(n_p)
    normals, offsets, areas, errors = np.empty((n_p, 3)), np.empty(n_p), np.empty(n_p), np.empty(n_p)
    rows = np.arange(n_p)
    basis, multipliers, best, ids = np.empty(4, np.int64), np.empty(4), np.empty(4), np.empty(4, np.int64)
    order, slacks, sorted_normals = np.empty(most, np.int64), np.empty(most), np.empty((most, 3))
    x, y, label = np.empty((2, most + 8)), np.empty((2, most + 8)), np.empty((2, most + 8), np.int64)
    values, shared = np.empty(most + 8), np.empty((most, most))
    for cell in range(first, last):
        low, high = cell_offsets[cell], cell_offsets[cell + 1]
        n_faces = high - low
        outcome[cell] = UNDECIDED
        n_vertices = gather(
            vertices, face_offsets, face_vertices, cell_faces, cell_flips, low, high, number, used, raw, ring, start
        )
        if n_vertices <= 0:
            outcome[cell] = HAS_BAD_FACE
            continue
        scale, largest = local_frame(raw, n_vertices, origin)
        if scale == 0.0:
            outcome[cell] = IS_NOT_FINITE
            continue
        closing, n_wrong = edge_balance(ring, start, n_faces, n_vertices, count, fill, keys)
        if closing != CLOSED:
            outcome[cell] = IS_OPEN if closing == OPEN else IS_TURNED
            numbers[cell, 0] = n_wrong
            continue
        if scale < 0.0:
            continue
        inverse = 1.0 / scale
        for v in range(n_vertices):
            for axis in range(3):
                points[v, axis] = (raw[v, axis] - origin[axis]) * inverse
        numbers[cell, 1] = np.sqrt(squared_diameter(points, n_vertices)) * scale
        if largest > LARGEST:
            continue
        n_planes = _all_planes(raw, ring, start, n_faces, rtol, corners, extra, apex, plane_face, is_planar)
        if n_planes < 0:
            continue
        volume, doubt = fan_volume(points, ring, start, apex, n_faces)
        numbers[cell, 0] = volume / 6.0 * scale * scale * scale
        if abs(volume) <= doubt or doubt > _ROUNDING * abs(volume):
            continue
        if volume < 0.0:
            outcome[cell] = IS_INSIDE_OUT
            continue
        volume /= 6.0
        facet_planes(raw, corners[:n_planes], origin, inverse, normals, offsets, areas, errors)
        n_planes, error = _drop_repeated(corners, extra, plane_face, normals, offsets, errors, n_planes)
        if n_planes < 4:
            continue
        for k in range(4):
            basis[k] = 6 if k == 3 else 2 * k + 1
        if deepest_point(normals, offsets, rows, n_planes, 4.0, basis, multipliers, best, 4e-15, 400) < 0:
            continue
        if best[3] < 0.0:
            if basis.min() >= 7:
                for k in range(4):
                    ids[k] = basis[k] - 7
                if proves_empty(normals, offsets, errors, ids):
                    outcome[cell] = EMPTY
            if outcome[cell] == UNDECIDED:
                area = fan_area(points, ring, start, apex, n_faces)
                if proves_empty_near(normals, offsets, errors, n_planes, volume, area, basis, multipliers):
                    outcome[cell] = EMPTY_NEAR
            if outcome[cell] != UNDECIDED:
                for k in range(4):
                    if basis[k] >= 7 and multipliers[k] > 1e-13:
                        witness[cell, k] = plane_face[basis[k] - 7]
            continue
        depth, certain = _depth(normals, offsets, errors, n_planes, best)
        if certain <= 0.0 or 4.0 * error > _ROUNDING * depth:
            continue
        excess, is_convex = excess_and_convexity(
            raw, points, n_vertices, ring, start, corners, plane_face, is_planar,
            normals, offsets, errors, n_planes, own,
        )  # fmt: skip
        kernel = -1.0
        # Shrunk by excess / depth about the centre, the hull of the vertices is behind all planes.
        if 3.0 * excess <= (_ROUNDING if is_convex else _NEARLY) * depth:
            turns = solid_angle(points, ring, start, apex, n_faces, best) / (4.0 * np.pi)
            if abs(turns - 1.0) < 0.25:
                kernel = volume
            else:
                is_convex = False
        if kernel < 0.0:
            kernel, extent, misfit = clipped_volume(
                normals, offsets, n_planes, best, _NEARLY * depth,
                order, slacks, sorted_normals, x, y, label, values, shared,
            )  # fmt: skip
            wrong = misfit < 0.0 or misfit * extent * extent > _ROUNDING * kernel
            if wrong or depth < _THIN * extent or UNIT * extent * extent > _ROUNDING * depth * depth:
                continue
        outcome[cell] = CONVEX if is_convex else SOLID
        numbers[cell, 2] = kernel * scale * scale * scale
        numbers[cell, 3] = depth * scale
        for axis in range(3):
            center[cell, axis] = best[axis] * scale + origin[axis]
