"""Faces, volume and moments of a convex polyhedron from the triangles of its dual hull."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.sorting import find_in_range, sort_range


@njit(cache=NUMBA_CACHE, nogil=True)
def consistent_turns(simplices, neighbours_of, first):
    """Tell which triangles of a closed hull turn like triangle `first`, by walking from neighbour to neighbour.

    neighbours_of[i, k] is the triangle across the edge opposite corner k of triangle i. Two neighbours
    turn alike when they traverse their edge in opposite directions; no coordinate is looked at, so
    triangles without area are turned as well as any other. Returns (alike, whether all were reached).
    """
    m = simplices.shape[0]
    alike = np.zeros(m, np.bool_)
    seen = np.zeros(m, np.bool_)
    stack = np.empty(m, np.int64)
    stack[0] = first
    alike[first] = True
    seen[first] = True
    n_stack = 1
    reached = 1
    while n_stack > 0:
        n_stack -= 1
        i = stack[n_stack]
        for k in range(3):
            j = neighbours_of[i, k]
            if j < 0 or seen[j]:
                continue
            u = simplices[i, (k + 1) % 3]
            v = simplices[i, (k + 2) % 3]
            same = True  # whether j lists the edge as v, u
            for q in range(3):
                if simplices[j, q] == u and simplices[j, (q + 1) % 3] == v:
                    same = False
            alike[j] = alike[i] == same
            seen[j] = True
            stack[n_stack] = j
            n_stack += 1
            reached += 1
    return alike, reached == m


@njit(cache=NUMBA_CACHE, nogil=True)
def dual_faces(simplices, outward, vertex_ids, n_duals):
    """List the polygon of every dual point: the vertices of the triangles around it, in order.

    simplices : (m, 3) dual points of each hull triangle; outward[i] is False where the triangle must
    be turned to be counter-clockwise seen from outside. vertex_ids : (m,) primal vertex of each.
    Returns (start, ring): the polygon of dual point p is ring[start[p]:start[p + 1]], repeated
    vertices dropped, empty where fewer than three are left; and whether all rings closed.
    """
    m = simplices.shape[0]
    count = np.zeros(n_duals + 1, np.int64)
    for i in range(m):
        for k in range(3):
            count[simplices[i, k] + 1] += 1
    for p in range(n_duals):
        count[p + 1] += count[p]
    fill = count[:-1].copy()
    first = np.empty(3 * m, np.int64)
    second = np.empty(3 * m, np.int64)
    owner = np.empty(3 * m, np.int64)
    keys = np.empty(3 * m, np.int64)
    order = np.empty(3 * m, np.int64)
    for i in range(m):
        for k in range(3):
            p = simplices[i, k]
            u = simplices[i, (k + 1) % 3]
            v = simplices[i, (k + 2) % 3]
            if not outward[i]:
                u, v = v, u
            first[fill[p]] = u
            second[fill[p]] = v
            owner[fill[p]] = i
            fill[p] += 1
    start = np.zeros(n_duals + 1, np.int64)
    ring = np.empty(3 * m, np.int64)
    used = 0
    closed = True
    for p in range(n_duals):
        low = count[p]
        high = count[p + 1]
        n = high - low
        begin = used
        if n >= 3:
            for j in range(low, high):
                keys[j] = first[j]
                order[j] = j
            sort_range(keys, order, low, high)
            current = low
            steps = 0
            while steps < n:
                vertex = vertex_ids[owner[current]]
                if used == begin or ring[used - 1] != vertex:
                    ring[used] = vertex
                    used += 1
                steps += 1
                j = find_in_range(keys, low, high, second[current])
                if j < 0:
                    closed = False
                    break
                current = order[j]
                if current == low:
                    break
            if steps < n:
                closed = False
            if used > begin + 1 and ring[used - 1] == ring[begin]:
                used -= 1
            if used - begin < 3:
                used = begin
        start[p + 1] = used
    return start, ring[:used].copy(), closed


@njit(cache=NUMBA_CACHE, nogil=True)
def moments(vertices, start, ring):
    """Volume, first and second moments about the origin, area, of polygons seen from the origin inside."""
    volume = 0.0
    area = 0.0
    first = np.zeros(3)
    second = np.zeros((3, 3))
    a = np.empty(3)
    b = np.empty(3)
    c = np.empty(3)
    for f in range(start.shape[0] - 1):
        low = start[f]
        for j in range(low + 1, start[f + 1] - 1):
            for k in range(3):
                a[k] = vertices[ring[low], k]
                b[k] = vertices[ring[j], k]
                c[k] = vertices[ring[j + 1], k]
            ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            area += 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)
            part = (a[0] * nx + a[1] * ny + a[2] * nz) / 6.0
            volume += part
            for k in range(3):
                first[k] += part * (a[k] + b[k] + c[k]) / 4.0
                for m in range(k + 1):
                    total = (a[k] + b[k] + c[k]) * (a[m] + b[m] + c[m])
                    second[k, m] += part * (a[k] * a[m] + b[k] * b[m] + c[k] * c[m] + total) / 20.0
    for k in range(3):
        for m in range(k):
            second[m, k] = second[k, m]
    return volume, first, second, area


@njit(cache=NUMBA_CACHE, nogil=True)
def neighbours(start, ring, n_vertices):
    """List the vertices joined to each vertex by an edge: (first, list), from the rings of all faces."""
    first = np.zeros(n_vertices + 1, np.int64)
    for j in range(ring.shape[0]):
        first[ring[j] + 1] += 1
    for v in range(n_vertices):
        first[v + 1] += first[v]
    fill = first[:-1].copy()
    joined = np.empty(ring.shape[0], np.int64)
    for f in range(start.shape[0] - 1):
        for j in range(start[f], start[f + 1]):
            after = j + 1 if j + 1 < start[f + 1] else start[f]
            joined[fill[ring[j]]] = ring[after]
            fill[ring[j]] += 1
    return first, joined


@njit(cache=NUMBA_CACHE, nogil=True)
def _climb(nx, ny, nz, vertices, first, joined, at):
    """Walk uphill along edges to the vertex farthest in a direction; on a convex polyhedron that is the best one."""
    best = nx * vertices[at, 0] + ny * vertices[at, 1] + nz * vertices[at, 2]
    while True:
        to = -1
        for j in range(first[at], first[at + 1]):
            v = joined[j]
            value = nx * vertices[v, 0] + ny * vertices[v, 1] + nz * vertices[v, 2]
            if value > best:
                best = value
                to = v
        if to < 0:
            return at, best
        at = to


@njit(cache=NUMBA_CACHE, nogil=True)
def planes_reaching(normals, offsets, errors, vertices, first, joined, center, half, slack, keep):
    """One pass: list the planes with n . v - d > -(error + slack) for some vertex v of a convex polyhedron.

    A plane clear of the box center +- half is skipped; for the rest the climb starts where the
    last one ended, because facets that follow each other face alike. Returns the count and the
    largest n . v - d met (at most the box bound where a plane was skipped).
    """
    cx, cy, cz = center[0], center[1], center[2]
    hx, hy, hz = half[0], half[1], half[2]
    size = np.sqrt((abs(cx) + hx) ** 2 + (abs(cy) + hy) ** 2 + (abs(cz) + hz) ** 2) + 1.0
    count = 0
    worst = -np.inf
    at = 0
    for i in range(offsets.shape[0]):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        limit = offsets[i] - errors[i] * size - slack
        if nx * cx + ny * cy + nz * cz + abs(nx) * hx + abs(ny) * hy + abs(nz) * hz < limit:
            continue
        at, best = _climb(nx, ny, nz, vertices, first, joined, at)
        if best >= limit:
            keep[count] = i
            count += 1
        if best - offsets[i] > worst:
            worst = best - offsets[i]
    return count, worst


@njit(cache=NUMBA_CACHE, nogil=True)
def solid_angle(vertices, ring):
    """Signed solid angle of triangles seen from the origin (van Oosterom and Strackee 1983)."""
    total = 0.0
    length = np.empty(3)
    for f in range(ring.shape[0] // 3):
        a = vertices[ring[3 * f]]
        b = vertices[ring[3 * f + 1]]
        c = vertices[ring[3 * f + 2]]
        for k in range(3):
            v = vertices[ring[3 * f + k]]
            length[k] = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        triple = (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
        ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
        below = length[0] * length[1] * length[2] + ab * length[2] + bc * length[0] + ca * length[1]
        total += 2.0 * np.arctan2(triple, below)
    return total
