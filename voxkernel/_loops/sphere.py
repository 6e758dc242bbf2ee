"""Solid angles of triangles, their derivatives, points of a polytope, and rays through a spherical triangulation."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

_NONE, _OUT, _BACK, _FREE = 0, 1, -1, 2


@njit(cache=NUMBA_CACHE, nogil=True)
def directions_and_radii(vertices, center, directions, radii):
    """Project vertices on the unit sphere around a centre; a vertex at the centre gets NaN and radius 0."""
    for i in range(vertices.shape[0]):
        x = vertices[i, 0] - center[0]
        y = vertices[i, 1] - center[1]
        z = vertices[i, 2] - center[2]
        r = np.sqrt(x * x + y * y + z * z)
        radii[i] = r
        if r > 0.0:
            directions[i, 0] = x / r
            directions[i, 1] = y / r
            directions[i, 2] = z / r
        else:
            directions[i, :] = np.nan


@njit(cache=NUMBA_CACHE, nogil=True)
def _half_tangent(ax, ay, az, bx, by, bz, cx, cy, cz):
    """Numerator and denominator of tan(angle / 2) (van Oosterom and Strackee 1983, eq. 8)."""
    la = np.sqrt(ax * ax + ay * ay + az * az)
    lb = np.sqrt(bx * bx + by * by + bz * bz)
    lc = np.sqrt(cx * cx + cy * cy + cz * cz)
    triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    ab = ax * bx + ay * by + az * bz
    bc = bx * cx + by * cy + bz * cz
    ca = cx * ax + cy * ay + cz * az
    return triple, la * lb * lc + ab * lc + bc * la + ca * lb


@njit(cache=NUMBA_CACHE, nogil=True)
def triangle_angles(vertices, faces, center, side, angles):
    """Signed solid angle of each triangle; returns their sum and that of their sizes, compensated, in order.

    side[i] is 1 or -1 where the sign is known exactly, 2 where it is left to floating point, 0 for
    triangles without area.
    """
    total, carry = 0.0, 0.0
    size, rest = 0.0, 0.0
    for i in range(faces.shape[0]):
        angles[i] = 0.0
        if side[i] == _NONE:
            continue
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        triple, below = _half_tangent(
            vertices[a, 0] - center[0], vertices[a, 1] - center[1], vertices[a, 2] - center[2],
            vertices[b, 0] - center[0], vertices[b, 1] - center[1], vertices[b, 2] - center[2],
            vertices[c, 0] - center[0], vertices[c, 1] - center[1], vertices[c, 2] - center[2],
        )  # fmt: skip
        if side[i] == _FREE:
            angle = 2.0 * np.arctan2(triple, below)
        else:
            angle = side[i] * 2.0 * np.arctan2(abs(triple), below)
        angles[i] = angle
        # Neumaier: the term that is smaller loses digits, keep them.
        new = total + angle
        carry += (total - new) + angle if abs(total) >= abs(angle) else (angle - new) + total
        total = new
        angle = abs(angle)
        new = size + angle
        rest += (size - new) + angle if size >= angle else (angle - new) + size
        size = new
    return total + carry, size + rest


@njit(cache=NUMBA_CACHE, nogil=True)
def cone_angle(starts, ends, apex, x):
    """Solid angle, modulo 4 pi, of a surface with these boundary edges: that of the cone over them.

    The half angles add up as the arguments of complex numbers do, so one arctangent is enough.
    """
    px, py, pz = apex[0] - x[0], apex[1] - x[1], apex[2] - x[2]
    re, im = 1.0, 0.0
    for e in range(starts.shape[0]):
        v, u = _half_tangent(
            px, py, pz,
            starts[e, 0] - x[0], starts[e, 1] - x[1], starts[e, 2] - x[2],
            ends[e, 0] - x[0], ends[e, 1] - x[1], ends[e, 2] - x[2],
        )  # fmt: skip
        length = np.sqrt(u * u + v * v)
        if length > 0.0:
            u, v = u / length, v / length
            re, im = re * u - im * v, re * v + im * u
    return 2.0 * np.arctan2(im, re)


@njit(cache=NUMBA_CACHE, nogil=True)
def cone_angles(starts, ends, apex, points, angles):
    """`cone_angle` of many points."""
    for i in range(points.shape[0]):
        angles[i] = cone_angle(starts, ends, apex, points[i])


@njit(cache=NUMBA_CACHE, nogil=True)
def boundary_field(starts, ends, x, gradient, hessian):
    """Gradient and Hessian of the solid angle: the line integral of dl x r / r^3 along the boundary edges."""
    gradient[:] = 0.0
    hessian[:, :] = 0.0
    for e in range(starts.shape[0]):
        ax, ay, az = starts[e, 0] - x[0], starts[e, 1] - x[1], starts[e, 2] - x[2]
        bx, by, bz = ends[e, 0] - x[0], ends[e, 1] - x[1], ends[e, 2] - x[2]
        la = np.sqrt(ax * ax + ay * ay + az * az)
        lb = np.sqrt(bx * bx + by * by + bz * bz)
        dot = ax * bx + ay * by + az * bz
        below = la * lb * (la * lb + dot)
        if not below > 0.0:  # the point lies on the edge
            continue
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        weight = (la + lb) / below
        gradient[0] += weight * cx
        gradient[1] += weight * cy
        gradient[2] += weight * cz
        # d(weight) along the three axes; moving x by d moves A and B by -d.
        dx, dy, dz = ax - bx, ay - by, az - bz
        cross = np.array([[0.0, dz, -dy], [-dz, 0.0, dx], [dy, -dx, 0.0]])
        for k in range(3):
            ak = ax if k == 0 else (ay if k == 1 else az)
            bk = bx if k == 0 else (by if k == 1 else bz)
            da, db, ddot = -ak / la, -bk / lb, -(ak + bk)
            change = 2.0 * la * lb * (lb * da + la * db) + (da * lb + la * db) * dot + la * lb * ddot
            slope = (da + db) / below - (la + lb) * change / (below * below)
            hessian[0, k] += weight * cross[0, k] + slope * cx
            hessian[1, k] += weight * cross[1, k] + slope * cy
            hessian[2, k] += weight * cross[2, k] + slope * cz


@njit(cache=NUMBA_CACHE, nogil=True)
def edges_meet(starts, ends, normals, offsets):
    """Whether a segment has a point with `normals . x <= offsets`: clip each with the planes, one after the other."""
    for e in range(starts.shape[0]):
        enter, leave = 0.0, 1.0
        for i in range(offsets.shape[0]):
            first, last = offsets[i], offsets[i]
            for k in range(3):
                first -= normals[i, k] * starts[e, k]
                last -= normals[i, k] * ends[e, k]
            if first < 0.0 and last < 0.0:
                leave = -1.0
            elif first < 0.0:
                enter = max(enter, first / (first - last))
            elif last < 0.0:
                leave = min(leave, first / (first - last))
            if enter > leave:
                break
        if enter <= leave:
            return True
    return False


@njit(cache=NUMBA_CACHE, nogil=True)
def _edge_gradient(ax, ay, az, bx, by, bz):
    la = np.sqrt(ax * ax + ay * ay + az * az)
    lb = np.sqrt(bx * bx + by * by + bz * bz)
    below = la * lb * (la * lb + ax * bx + ay * by + az * bz)
    weight = (la + lb) / below if below > 0.0 else 0.0
    return weight * (ay * bz - az * by), weight * (az * bx - ax * bz), weight * (ax * by - ay * bx)


@njit(cache=NUMBA_CACHE, nogil=True)
def density_moments(vertices, faces, areas, center, first, second):
    """Sums of w and w^2 / a over triangles with solid angle w and area a, and the gradients of both.

    For a centre on the inner side of all triangles: no w is negative.
    """
    total, square = 0.0, 0.0
    first[:] = 0.0
    second[:] = 0.0
    for i in range(faces.shape[0]):
        if not areas[i] > 0.0:
            continue
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        ax, ay, az = vertices[a, 0] - center[0], vertices[a, 1] - center[1], vertices[a, 2] - center[2]
        bx, by, bz = vertices[b, 0] - center[0], vertices[b, 1] - center[1], vertices[b, 2] - center[2]
        cx, cy, cz = vertices[c, 0] - center[0], vertices[c, 1] - center[1], vertices[c, 2] - center[2]
        triple, below = _half_tangent(ax, ay, az, bx, by, bz, cx, cy, cz)
        angle = 2.0 * np.arctan2(max(triple, 0.0), below)
        gx, gy, gz = _edge_gradient(ax, ay, az, bx, by, bz)
        hx, hy, hz = _edge_gradient(bx, by, bz, cx, cy, cz)
        kx, ky, kz = _edge_gradient(cx, cy, cz, ax, ay, az)
        gx, gy, gz = gx + hx + kx, gy + hy + ky, gz + hz + kz
        total += angle
        square += angle * angle / areas[i]
        weight = 2.0 * angle / areas[i]
        first[0] += gx
        first[1] += gy
        first[2] += gz
        second[0] += weight * gx
        second[1] += weight * gy
        second[2] += weight * gz
    return total, square


@njit(cache=NUMBA_CACHE, nogil=True)
def _meet(normals, offsets, chosen, n, z, y, multipliers):
    """Project z on the planes `chosen[:n]`; False where their normals are nearly dependent."""
    gram = np.empty((3, 3))
    right = np.empty(3)
    for i in range(n):
        p = chosen[i]
        right[i] = -offsets[p]
        for k in range(3):
            right[i] += normals[p, k] * z[k]
        for j in range(n):
            q = chosen[j]
            gram[i, j] = normals[p, 0] * normals[q, 0] + normals[p, 1] * normals[q, 1] + normals[p, 2] * normals[q, 2]
    for i in range(n):  # elimination without pivots: the Gram matrix is positive definite
        if gram[i, i] < 1e-13:
            return False
        for j in range(i + 1, n):
            factor = gram[j, i] / gram[i, i]
            for k in range(i, n):
                gram[j, k] -= factor * gram[i, k]
            right[j] -= factor * right[i]
    for i in range(n - 1, -1, -1):
        value = right[i]
        for k in range(i + 1, n):
            value -= gram[i, k] * multipliers[k]
        multipliers[i] = value / gram[i, i]
    for k in range(3):
        y[k] = z[k]
        for i in range(n):
            y[k] -= multipliers[i] * normals[chosen[i], k]
    return True


@njit(cache=NUMBA_CACHE, nogil=True)
def nearest_point(normals, offsets, z, tolerance, y):
    """Find the point of a polytope `normals . y <= offsets` nearest to z; False where rounding forbids it.

    At most three planes hold the answer. The most violated plane joins them, the best subset that
    contains it stays: the distance grows with every round, so no subset comes twice.
    """
    working = np.zeros(4, np.int64)
    subset = np.zeros(3, np.int64)
    best = np.zeros(3, np.int64)
    trial = np.empty(3)
    multipliers = np.empty(3)
    n = 0
    for k in range(3):
        y[k] = z[k]
    for _ in range(200):
        worst, at = tolerance, -1
        for i in range(offsets.shape[0]):
            over = normals[i, 0] * y[0] + normals[i, 1] * y[1] + normals[i, 2] * y[2] - offsets[i]
            if over > worst:
                worst, at = over, i
        if at < 0:
            return True
        for i in range(n):
            if working[i] == at:
                return False
        working[n] = at
        nearest, n_best = np.inf, 0
        for mask in range(1 << n):
            size = 1
            subset[0] = at
            for i in range(n):
                if mask >> i & 1 and size < 3:
                    subset[size] = working[i]
                    size += 1
                elif mask >> i & 1:
                    size = 4
            if size > 3 or not _meet(normals, offsets, subset, size, z, trial, multipliers):
                continue
            good = True
            for i in range(size):
                good = good and multipliers[i] >= 0.0
            for i in range(n):
                p = working[i]
                over = normals[p, 0] * trial[0] + normals[p, 1] * trial[1] + normals[p, 2] * trial[2] - offsets[p]
                good = good and over <= tolerance
            distance = (trial[0] - z[0]) ** 2 + (trial[1] - z[1]) ** 2 + (trial[2] - z[2]) ** 2
            if good and distance < nearest:
                nearest, n_best = distance, size
                for i in range(size):
                    best[i] = subset[i]
                for k in range(3):
                    y[k] = trial[k]
        if n_best == 0:
            return False
        n = n_best
        for i in range(n):
            working[i] = best[i]
    return False


@njit(cache=NUMBA_CACHE, nogil=True)
def _side(px, py, pz, qx, qy, qz, dx, dy, dz):
    """Sign of det(p, q, d): on which side of the plane through the centre, p and q a direction lies."""
    return dx * (py * qz - pz * qy) + dy * (pz * qx - px * qz) + dz * (px * qy - py * qx)


@njit(cache=NUMBA_CACHE, nogil=True)
def settle_rays(corners, faces, across, directions, hits, slack, max_steps, radii):
    """Move each hit to the triangle its ray really passes, in double precision, and compute the distance.

    corners : (n, 3) vertices relative to the centre. across : (m, 3) neighbour over edge k (from corner k
    to the next), -1 at a border. hits : (k,) triangle of each ray as a first guess, -1 for none; changed.
    A ray goes over the edge it lies beyond most until it is inside, at most `max_steps` times; where that
    leads nowhere the triangle it misses least stays, but -1 where that is by more than `slack` (a sine).
    """
    for r in range(directions.shape[0]):
        radii[r] = np.nan
        at = hits[r]
        if at < 0:
            continue
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        best, chosen = -np.inf, at
        came_from = -1
        for _ in range(max_steps):
            a, b, c = faces[at, 0], faces[at, 1], faces[at, 2]
            ax, ay, az = corners[a, 0], corners[a, 1], corners[a, 2]
            bx, by, bz = corners[b, 0], corners[b, 1], corners[b, 2]
            cx, cy, cz = corners[c, 0], corners[c, 1], corners[c, 2]
            triple = _side(ax, ay, az, bx, by, bz, cx, cy, cz)
            turn = 1.0 if triple >= 0.0 else -1.0
            low, edge = np.inf, -1
            for k in range(3):
                if k == 0:
                    px, py, pz, qx, qy, qz = ax, ay, az, bx, by, bz
                elif k == 1:
                    px, py, pz, qx, qy, qz = bx, by, bz, cx, cy, cz
                else:
                    px, py, pz, qx, qy, qz = cx, cy, cz, ax, ay, az
                nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                side = turn * (dx * nx + dy * ny + dz * nz) / length if length > 0.0 else 0.0
                if side < low:
                    low, edge = side, k
            if low > best:
                best, chosen = low, at
            if low >= 0.0:
                break
            after = across[at, edge]
            if after < 0 or after == came_from:
                break
            came_from, at = at, after
        if best < -slack:
            hits[r] = -1
            continue
        at = chosen
        a, b, c = faces[at, 0], faces[at, 1], faces[at, 2]
        ux, uy, uz = corners[b, 0] - corners[a, 0], corners[b, 1] - corners[a, 1], corners[b, 2] - corners[a, 2]
        vx, vy, vz = corners[c, 0] - corners[a, 0], corners[c, 1] - corners[a, 1], corners[c, 2] - corners[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        along = nx * dx + ny * dy + nz * dz
        height = nx * corners[a, 0] + ny * corners[a, 1] + nz * corners[a, 2]
        hits[r] = at
        if along != 0.0 and height / along > 0.0:
            radii[r] = height / along
        else:
            hits[r] = -1


@njit(cache=NUMBA_CACHE, nogil=True)
def triangle_distances(points, corners, distances):
    """Distance of each point from its own triangle (Ericson, Real-Time Collision Detection, 5.1.5)."""
    for i in range(points.shape[0]):
        a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
        ab, ac, ap = b - a, c - a, points[i] - a
        d1, d2 = (ab * ap).sum(), (ac * ap).sum()
        bp, cp = points[i] - b, points[i] - c
        d3, d4 = (ab * bp).sum(), (ac * bp).sum()
        d5, d6 = (ab * cp).sum(), (ac * cp).sum()
        va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
        if d1 <= 0.0 and d2 <= 0.0:
            near = a
        elif d3 >= 0.0 and d4 <= d3:
            near = b
        elif d6 >= 0.0 and d5 <= d6:
            near = c
        elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
            near = a + ab * (d1 / (d1 - d3)) if d1 > d3 else a
        elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            near = a + ac * (d2 / (d2 - d6)) if d2 > d6 else a
        elif va <= 0.0 and d4 >= d3 and d5 >= d6:
            near = b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
        else:
            near = a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))
        distances[i] = np.sqrt(((points[i] - near) ** 2).sum())
