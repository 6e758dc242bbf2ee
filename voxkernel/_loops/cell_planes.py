"""One polyhedral cell: its edges, its facet planes as `TriangleMesh.from_polygons` makes them, its volume."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.sorting import sort_keys

CLOSED, OPEN, TURNED = 0, 1, 2
_MANY = 256  # corners; beyond, `from_polygons` does not look at all pairs, and a loop over them takes too long
_GUARD = 1e-3  # relative; polygons so near a threshold of `from_polygons` are left to it


@njit(cache=NUMBA_CACHE, nogil=True)
def edge_balance(ring, start, n_faces, n_vertices, count, fill, keys):
    """Whether every edge of the polygons is traversed equally often both ways: CLOSED, OPEN or TURNED.

    Edges are bucketed by their smaller vertex. TURNED means that the faces would fit if some were
    turned over; OPEN that some edge has an odd number of them. Also returns how many edges are wrong.
    """
    for v in range(n_vertices + 1):
        count[v] = 0
    for f in range(n_faces):
        low, high = start[f], start[f + 1]
        a = ring[high - 1]
        for j in range(low, high):
            b = ring[j]
            if a != b:
                count[min(a, b) + 1] += 1
            a = b
    for v in range(n_vertices):
        count[v + 1] += count[v]
        fill[v] = count[v]
    for f in range(n_faces):
        low, high = start[f], start[f + 1]
        a = ring[high - 1]
        for j in range(low, high):
            b = ring[j]
            if a < b:
                keys[fill[a]] = 2 * b
                fill[a] += 1
            elif b < a:
                keys[fill[b]] = 2 * a + 1
                fill[b] += 1
            a = b
    n_open = 0
    n_turned = 0
    for v in range(n_vertices):
        low, high = count[v], count[v + 1]
        sort_keys(keys, low, high)
        j = low
        while j < high:
            other = keys[j] >> 1
            balance = 0
            uses = 0
            while j < high and (keys[j] >> 1) == other:
                balance += 1 - 2 * (keys[j] & 1)
                uses += 1
                j += 1
            if uses & 1:
                n_open += 1
            elif balance != 0:
                n_turned += 1
    if n_open:
        return OPEN, n_open
    return (TURNED, n_turned) if n_turned else (CLOSED, 0)


@njit(cache=NUMBA_CACHE, nogil=True)
def _cross(points, a, b, c):
    """(b - a) x (c - a)."""
    ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@njit(cache=NUMBA_CACHE, nogil=True)
def _spread_corners(points, ring, low, size):
    """Find the diameter of a polygon and the corner farthest from it, rounding as `from_polygons` does."""
    first = ring[low]
    ox, oy, oz = points[first, 0], points[first, 1], points[first, 2]
    best = -1.0
    i, j = 0, 1
    for shift in range(1, size // 2 + 1):
        top = -1.0
        at = 0
        for k in range(size):
            p, q = ring[low + k], ring[low + (k + shift) % size]
            x = (points[p, 0] - ox) - (points[q, 0] - ox)
            y = (points[p, 1] - oy) - (points[q, 1] - oy)
            z = (points[p, 2] - oz) - (points[q, 2] - oz)
            square = x * x + z * z + y * y
            if square > top:
                top = square
                at = k
        if top > best:
            best = top
            i = at
            j = (at + shift) % size
    a, b = ring[low + i], ring[low + j]
    ax, ay, az = points[a, 0] - ox, points[a, 1] - oy, points[a, 2] - oz
    ux, uy, uz = (points[b, 0] - ox) - ax, (points[b, 1] - oy) - ay, (points[b, 2] - oz) - az
    top = -1.0
    far = 0
    for k in range(size):
        c = ring[low + k]
        vx, vy, vz = (points[c, 0] - ox) - ax, (points[c, 1] - oy) - ay, (points[c, 2] - oz) - az
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        square = x * x + z * z + y * y
        if square > top:
            top = square
            far = k
    return i, j, far, best, top


@njit(cache=NUMBA_CACHE, nogil=True)
def polygon_planes(points, ring, low, high, rtol, corners, extra, n_planes):
    """Append the planes of one polygon to `corners`; return their new number and the apex of its fan.

    -1 planes where this loop and `TriangleMesh.from_polygons` might not agree: near its thresholds, and
    for polygons it cuts by ear clipping. `extra` is by how much the plane, |x| + 1 away, depends on which
    three of the corners define it.
    """
    size = high - low
    if size == 3:
        corners[n_planes, 0], corners[n_planes, 1], corners[n_planes, 2] = ring[low], ring[low + 1], ring[low + 2]
        extra[n_planes] = 0.0
        return n_planes + 1, 0
    if size > _MANY:
        return -1, 0
    i, j, far, best, square = _spread_corners(points, ring, low, size)
    sx, sy, sz = 0.0, 0.0, 0.0
    for k in range(1, size - 1):
        x, y, z = _cross(points, ring[low], ring[low + k], ring[low + k + 1])
        sx += 0.5 * x
        sy += 0.5 * y
        sz += 0.5 * z
    side = np.sqrt(sx * sx + sy * sy + sz * sz)
    length = np.sqrt(square)
    a, b, c = ring[low + i], ring[low + j], ring[low + far]
    nx, ny, nz = _cross(points, a, b, c)
    facing = nx * sx + ny * sy + nz * sz
    if length == 0.0 or side <= 1e-9 * length or abs(facing) <= 1e-6 * side * length:
        return -1, 0
    height = 0.0
    for k in range(low, high):
        p = ring[k]
        x, y, z = points[p, 0] - points[a, 0], points[p, 1] - points[a, 1], points[p, 2] - points[a, 2]
        height = max(height, abs(nx * x + ny * y + nz * z))
    limit = rtol * np.sqrt(best) * length
    if abs(height - limit) <= _GUARD * limit:
        return -1, 0
    if height < limit:
        if facing < 0.0:
            a, b = b, a
        corners[n_planes, 0], corners[n_planes, 1], corners[n_planes, 2] = a, b, c
        # The corners are this far off the plane, and `length` / diameter is the width they rest on.
        extra[n_planes] = 4.0 * height * np.sqrt(best) / square
        return n_planes + 1, 0
    return _fan(points, ring, low, size, sx, sy, sz, corners, extra, n_planes)


@njit(cache=NUMBA_CACHE, nogil=True)
def _fan(points, ring, low, size, sx, sy, sz, corners, extra, n_planes):
    """Cut a polygon into a fan from its first or second corner, whichever keeps its side throughout."""
    floor = 1e-14 * (sx * sx + sy * sy + sz * sz)
    for apex in range(2):
        clear = True
        for k in range(1, size - 1):
            a, b, c = ring[low + apex], ring[low + (apex + k) % size], ring[low + (apex + k + 1) % size]
            x, y, z = _cross(points, a, b, c)
            facing = x * sx + y * sy + z * sz
            if abs(facing) <= 100.0 * floor:
                return -1, 0
            if facing < 0.0:
                clear = False
                break
            corners[n_planes + k - 1, 0], corners[n_planes + k - 1, 1], corners[n_planes + k - 1, 2] = a, b, c
            extra[n_planes + k - 1] = 0.0
        if clear:
            return n_planes + size - 2, apex
    return -1, 0


@njit(cache=NUMBA_CACHE, nogil=True)
def fan_volume(points, ring, start, apex, n_faces):
    """Six times the volume enclosed by fans, and a bound on its error, for |x| <= 1; volume from the origin."""
    total = 0.0
    size = 0.0
    for f in range(n_faces):
        low, high = start[f], start[f + 1]
        n = high - low
        a = ring[low + apex[f]]
        ax, ay, az = points[a, 0], points[a, 1], points[a, 2]
        for k in range(1, n - 1):
            b, c = ring[low + (apex[f] + k) % n], ring[low + (apex[f] + k + 1) % n]
            bx, by, bz = points[b, 0], points[b, 1], points[b, 2]
            cx, cy, cz = points[c, 0], points[c, 1], points[c, 2]
            total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            size += (
                abs(ax) * (abs(by * cz) + abs(bz * cy))
                + abs(ay) * (abs(bz * cx) + abs(bx * cz))
                + abs(az) * (abs(bx * cy) + abs(by * cx))
            )
    n_terms = 6.0 + start[n_faces] - start[0]
    return total, (16.0 + n_terms) * 2.0**-53 * size


@njit(cache=NUMBA_CACHE, nogil=True)
def fan_area(points, ring, start, apex, n_faces):
    """Area of all triangles of the fans: at least that of the surface."""
    total = 0.0
    for f in range(n_faces):
        low = start[f]
        n = start[f + 1] - low
        for k in range(1, n - 1):
            b, c = ring[low + (apex[f] + k) % n], ring[low + (apex[f] + k + 1) % n]
            x, y, z = _cross(points, ring[low + apex[f]], b, c)
            total += 0.5 * np.sqrt(x * x + y * y + z * z)
    return total


@njit(cache=NUMBA_CACHE, nogil=True)
def solid_angle(points, ring, start, apex, n_faces, center):
    """Signed solid angle of all fans seen from `center` (van Oosterom and Strackee 1983)."""
    total = 0.0
    for f in range(n_faces):
        low, high = start[f], start[f + 1]
        n = high - low
        for k in range(1, n - 1):
            a, b = ring[low + apex[f]], ring[low + (apex[f] + k) % n]
            c = ring[low + (apex[f] + k + 1) % n]
            ax, ay, az = points[a, 0] - center[0], points[a, 1] - center[1], points[a, 2] - center[2]
            bx, by, bz = points[b, 0] - center[0], points[b, 1] - center[1], points[b, 2] - center[2]
            cx, cy, cz = points[c, 0] - center[0], points[c, 1] - center[1], points[c, 2] - center[2]
            la = np.sqrt(ax * ax + ay * ay + az * az)
            lb = np.sqrt(bx * bx + by * by + bz * bz)
            lc = np.sqrt(cx * cx + cy * cy + cz * cz)
            triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            below = la * lb * lc
            below += (ax * bx + ay * by + az * bz) * lc + (bx * cx + by * cy + bz * cz) * la
            below += (cx * ax + cy * ay + cz * az) * lb
            total += 2.0 * np.arctan2(triple, below)
    return total


@njit(cache=NUMBA_CACHE, nogil=True)
def squared_diameter(points, n):
    """Largest squared distance of two points."""
    best = 0.0
    for i in range(n):
        for j in range(i):
            x, y, z = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
            best = max(best, x * x + y * y + z * z)
    return best
