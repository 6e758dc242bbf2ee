"""The kernel of one small cell: proof that it is empty, proof that it is the cell, its volume otherwise."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.convexity import orientation

UNIT = 2.0**-53
# A square of this half edge about the foot of the centre holds every face of a kernel in the unit ball.
_SQUARE = 2.5
_FAR = 2.0**23


@njit(cache=NUMBA_CACHE, nogil=True)
def proves_empty(normals, offsets, errors, ids):
    """Whether four planes in general position certainly have no common inner point, by signs of cofactors.

    The cofactors m of the true unit normals satisfy sum(m n) = 0 exactly; all of one sign and
    sum(m d) < 0 make them a witness (Farkas). Every sign is taken with a bound on its error: a plane's
    normal and offset are each off by at most its `errors`.
    """
    total = 0.0
    doubt = 0.0
    n_positive = 0
    for skip in range(4):
        a = ids[1] if skip == 0 else ids[0]
        b = ids[2] if skip <= 1 else ids[1]
        c = ids[3] if skip <= 2 else ids[2]
        value = (
            normals[a, 0] * (normals[b, 1] * normals[c, 2] - normals[b, 2] * normals[c, 1])
            + normals[a, 1] * (normals[b, 2] * normals[c, 0] - normals[b, 0] * normals[c, 2])
            + normals[a, 2] * (normals[b, 0] * normals[c, 1] - normals[b, 1] * normals[c, 0])
        )
        if skip & 1:
            value = -value
        error = 1.1 * (errors[a] + errors[b] + errors[c]) + 32.0 * UNIT
        if abs(value) <= error:
            return False
        if value > 0.0:
            n_positive += 1
        d = offsets[ids[skip]]
        total += value * d
        e = errors[ids[skip]]
        doubt += error * (abs(d) + e) + abs(value) * (e + 8.0 * UNIT * abs(d))
    if n_positive == 0:
        total = -total
    elif n_positive < 4:
        return False
    return total < -doubt


@njit(cache=NUMBA_CACHE, nogil=True)
def proves_empty_near(normals, offsets, errors, n_planes, volume, area, basis, multipliers):
    """Whether planes that are nearly parallel exclude each other in a ball, and the kernel reaches no farther.

    `basis` and `multipliers` are those of `deepest_point`. For x in the kernel the multipliers l >= 0, sum 1, give
    0 >= sum(l (n . x - d)) = r . x - sum(l d) with a small r: not for |x| <= _FAR where -sum(l d) is larger than
    |r| _FAR and the errors. A kernel point at |x| > _FAR is on the inner side of every facet, so that
    n . u <= 1 / _FAR + error for u = x / |x|. On a closed surface the sum of A (n . u) is zero, so that of A |n . u|
    is at most 2 (1 / _FAR + error) times the area; and it is at least the volume, by the divergence theorem on
    z = x . u, |z| <= 1. A volume far above that excludes such points.
    """
    largest = 0.0
    for p in range(n_planes):
        largest = max(largest, errors[p])
    if largest > 0.1 / _FAR or volume < 100.0 / _FAR * area or volume < 100.0 / _FAR:
        return False
    total = 0.0
    for k in range(4):
        if basis[k] >= 7:
            total += multipliers[k]
    if not total > 0.5:
        return False
    rx, ry, rz, right, error = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(4):
        if basis[k] >= 7:
            p = basis[k] - 7
            share = multipliers[k] / total
            rx += share * normals[p, 0]
            ry += share * normals[p, 1]
            rz += share * normals[p, 2]
            right += share * offsets[p]
            error += share * errors[p]
    rest = np.sqrt(rx * rx + ry * ry + rz * rz) + 16.0 * UNIT
    return -right > (rest + error) * (_FAR + 1.0) + 32.0 * UNIT


@njit(cache=NUMBA_CACHE, nogil=True)
def excess_and_convexity(
    raw, points, n_vertices, ring, start, corners, plane_face, is_planar, normals, offsets, errors, n_planes, own
):
    """Largest n . v - d over all planes and vertices, and whether every vertex certainly is behind every plane.

    `raw` are the input coordinates, `points` the local ones. The corners of a facet count as on its plane.
    What floating point cannot tell is decided exactly.
    """
    worst = 0.0
    is_convex = True
    for v in range(n_vertices):
        own[v] = -1
    for p in range(n_planes):
        f = plane_face[p]
        if is_planar[f]:
            for k in range(start[f], start[f + 1]):
                own[ring[k]] = p
        else:
            for k in range(3):
                own[corners[p, k]] = p
        nx, ny, nz, d = normals[p, 0], normals[p, 1], normals[p, 2], offsets[p]
        error = 2.0 * errors[p]
        for v in range(n_vertices):
            value = nx * points[v, 0] + ny * points[v, 1] + nz * points[v, 2] - d
            if value < -error:
                continue
            worst = max(worst, value + error)
            if not is_convex or own[v] == p:
                continue
            if value > error:
                is_convex = False
            elif orientation(raw[corners[p, 0]], raw[corners[p, 1]], raw[corners[p, 2]], raw[v]) > 0.0:
                is_convex = False
    return worst, is_convex


@njit(cache=NUMBA_CACHE, nogil=True)
def _sorted_by_slack(normals, offsets, n_planes, center, order, slacks, sorted_normals):
    """Nearest planes first: they cut the most away."""
    for p in range(n_planes):
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        slack = offsets[p] - (nx * center[0] + ny * center[1] + nz * center[2])
        k = p - 1
        while k >= 0 and slacks[k] > slack:
            slacks[k + 1] = slacks[k]
            order[k + 1] = order[k]
            k -= 1
        slacks[k + 1] = slack
        order[k + 1] = p
    for k in range(n_planes):
        for axis in range(3):
            sorted_normals[k, axis] = normals[order[k], axis]


@njit(cache=NUMBA_CACHE, nogil=True)
def _face(i, normals, slacks, n_planes, same, x, y, label, values):
    """Cut the polygon of plane i out of a square; (corners left, their largest distance squared from the foot).

    x, y, label hold two polygons, the current one in row `now`, which is returned as well; `label` names
    the plane that made the edge from a corner to the next, -1 for the square.
    """
    nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
    # An orthonormal frame of the plane (Duff et al. 2017).
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    ux, uy, uz = 1.0 + sign * nx * nx * a, sign * b, -sign * nx
    vx, vy, vz = b, sign + ny * ny * a, -ny
    now = 0
    n = 4
    for k in range(4):
        x[0, k] = _SQUARE if k == 0 or k == 3 else -_SQUARE
        y[0, k] = _SQUARE if k < 2 else -_SQUARE
        label[0, k] = -1
    reach = 2.0 * _SQUARE * _SQUARE
    for j in range(n_planes):
        if j == i:
            continue
        mx, my, mz = normals[j, 0], normals[j, 1], normals[j, 2]
        alike = nx * mx + ny * my + nz * mz
        p = mx * ux + my * uy + mz * uz
        q = mx * vx + my * vy + mz * vz
        square = p * p + q * q
        if square < same * same and alike > 0.0:
            gap = slacks[j] - slacks[i]
            if gap < -same or (gap <= same and j < i):
                return 0, 0.0, now
            continue
        right = slacks[j] - slacks[i] * alike
        if right > 0.0 and right * right > reach * square:
            continue
        outside = 0
        for k in range(n):
            values[k] = p * x[now, k] + q * y[now, k] - right
            if values[k] > 0.0:
                outside += 1
        if outside == 0:
            continue
        if outside == n:
            return 0, 0.0, now
        other = 1 - now
        m = 0
        before = n - 1
        for k in range(n):
            value, last = values[k], values[before]
            if (value > 0.0) != (last > 0.0):
                t = last / (last - value)
                x[other, m] = x[now, before] + t * (x[now, k] - x[now, before])
                y[other, m] = y[now, before] + t * (y[now, k] - y[now, before])
                # Leaving the half-plane, the new edge runs along plane j; entering, the old one goes on.
                label[other, m] = j if value > 0.0 else label[now, before]
                m += 1
            if value <= 0.0:
                x[other, m] = x[now, k]
                y[other, m] = y[now, k]
                label[other, m] = label[now, k]
                m += 1
            before = k
        now = other
        n = m
        if n < 3:
            return 0, 0.0, now
        reach = 0.0
        for k in range(n):
            reach = max(reach, x[now, k] * x[now, k] + y[now, k] * y[now, k])
    return n, reach, now


@njit(cache=NUMBA_CACHE, nogil=True)
def clipped_volume(
    normals, offsets, n_planes, center, same, order, slacks, sorted_normals, x, y, label, values, shared
):
    """Volume of the kernel about a point inside it, its extent, and how badly its faces fit together.

    Every face is cut out of its own plane by all others. Two faces that meet list their common edge
    each by itself: the sum of the differences of these lengths says whether the faces close. Planes
    that differ by less than `same` are one. A negative misfit means that a face has no end.
    """
    _sorted_by_slack(normals, offsets, n_planes, center, order, slacks, sorted_normals)
    for i in range(n_planes):
        for j in range(n_planes):
            shared[i, j] = 0.0
    volume = 0.0
    extent = 0.0
    for i in range(n_planes):
        n, reach, now = _face(i, sorted_normals, slacks, n_planes, same, x, y, label, values)
        if n < 3:
            continue
        extent = max(extent, reach + slacks[i] * slacks[i])
        area = 0.0
        for k in range(n):
            after = k + 1 if k + 1 < n else 0
            area += x[now, k] * y[now, after] - x[now, after] * y[now, k]
            dx, dy = x[now, after] - x[now, k], y[now, after] - y[now, k]
            if label[now, k] < 0:
                return 0.0, 0.0, -1.0
            shared[i, label[now, k]] += np.sqrt(dx * dx + dy * dy)
        volume += 0.5 * area * slacks[i] / 3.0
    misfit = 0.0
    for i in range(n_planes):
        for j in range(i):
            misfit += abs(shared[i, j] - shared[j, i])
    return volume, np.sqrt(extent), misfit
