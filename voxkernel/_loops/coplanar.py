"""Groups of exactly coplanar facets, decided with floating-point expansions.

Expansion arithmetic after Shewchuk, "Adaptive precision floating-point arithmetic and fast robust
geometric predicates" (1997): a number is a sum of doubles that do not overlap. Exact while nothing
underflows or overflows; the caller keeps coordinates within 2**-300 .. 2**300.
"""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

_SPLITTER = 134217729.0  # 2**27 + 1


@njit(cache=NUMBA_CACHE, nogil=True)
def _two_sum(a, b):
    x = a + b
    virtual = x - a
    return x, (a - (x - virtual)) + (b - virtual)


@njit(cache=NUMBA_CACHE, nogil=True)
def _two_product(a, b):
    x = a * b
    c = _SPLITTER * a
    a_high = c - (c - a)
    a_low = a - a_high
    c = _SPLITTER * b
    b_high = c - (c - b)
    b_low = b - b_high
    return x, a_low * b_low - (((x - a_high * b_high) - a_low * b_high) - a_high * b_low)


@njit(cache=NUMBA_CACHE, nogil=True)
def _add(e, n_e, f, n_f, h):
    """Write the exact sum of two expansions to h without zeros; return its length."""
    if n_e == 0 and n_f == 0:
        return 0
    i = 0
    j = 0
    n = 0
    q = 0.0
    while i < n_e or j < n_f:
        if j >= n_f or (i < n_e and abs(e[i]) < abs(f[j])):
            term = e[i]
            i += 1
        else:
            term = f[j]
            j += 1
        q, low = _two_sum(q, term)
        if low != 0.0:
            h[n] = low
            n += 1
    if q != 0.0:
        h[n] = q
        n += 1
    return n


@njit(cache=NUMBA_CACHE, nogil=True)
def _scale(e, n_e, b, h):
    """Write the exact product of an expansion and a double to h without zeros; return its length."""
    n = 0
    if n_e == 0 or b == 0.0:
        return 0
    q, low = _two_product(e[0], b)
    if low != 0.0:
        h[n] = low
        n += 1
    for i in range(1, n_e):
        high, low = _two_product(e[i], b)
        s, rest = _two_sum(q, low)
        if rest != 0.0:
            h[n] = rest
            n += 1
        q, rest = _two_sum(high, s)
        if rest != 0.0:
            h[n] = rest
            n += 1
    if q != 0.0:
        h[n] = q
        n += 1
    return n


@njit(cache=NUMBA_CACHE, nogil=True)
def _cross_term(ax, ay, bx, by, sign, t, u, out):
    """Write sign * (ax by - bx ay) exactly to out; return its length."""
    high, low = _two_product(ax, by)
    t[0] = sign * low
    t[1] = sign * high
    high, low = _two_product(bx, ay)
    u[0] = -sign * low
    u[1] = -sign * high
    return _add(t, 2, u, 2, out)


@njit(cache=NUMBA_CACHE, nogil=True)
def orient3d_exact(a, b, c, d):
    """Sign of the determinant of (a - d, b - d, c - d), exact."""
    t = np.empty(2)
    u = np.empty(2)
    p = np.empty(4)
    q = np.empty(4)
    r = np.empty(4)
    s8 = np.empty(8)
    s12 = np.empty(12)
    s24 = np.empty(24)
    total = np.empty(96)
    other = np.empty(96)
    n_total = 0
    # det = z_a [bcd] - z_b [cda] + z_c [dab] - z_d [abc], each a sum of three 2 x 2 minors.
    for k in range(4):
        if k == 0:
            x, y, z, w, sign = b, c, d, a[2], 1.0
        elif k == 1:
            x, y, z, w, sign = c, d, a, b[2], -1.0
        elif k == 2:
            x, y, z, w, sign = d, a, b, c[2], 1.0
        else:
            x, y, z, w, sign = a, b, c, d[2], -1.0
        n_p = _cross_term(x[0], x[1], y[0], y[1], 1.0, t, u, p)
        n_q = _cross_term(y[0], y[1], z[0], z[1], 1.0, t, u, q)
        n_r = _cross_term(z[0], z[1], x[0], x[1], 1.0, t, u, r)
        n_8 = _add(p, n_p, q, n_q, s8)
        n_12 = _add(s8, n_8, r, n_r, s12)
        n_24 = _scale(s12, n_12, sign * w, s24)
        n_other = _add(total, n_total, s24, n_24, other)
        for i in range(n_other):
            total[i] = other[i]
        n_total = n_other
    if n_total == 0:
        return 0.0
    return 1.0 if total[n_total - 1] > 0.0 else -1.0


@njit(cache=NUMBA_CACHE, nogil=True)
def _coplanar(vertices, plane, other):
    """Whether the corners of one triangle lie exactly on the plane of another."""
    a = vertices[plane[0]]
    b = vertices[plane[1]]
    c = vertices[plane[2]]
    for k in range(3):
        v = other[k]
        if v == plane[0] or v == plane[1] or v == plane[2]:
            continue
        d = vertices[v]
        same_z = a[2] == b[2] and a[2] == c[2] and a[2] == d[2]
        same_y = a[1] == b[1] and a[1] == c[1] and a[1] == d[1]
        same_x = a[0] == b[0] and a[0] == c[0] and a[0] == d[0]
        if same_x or same_y or same_z:
            continue
        if orient3d_exact(a, b, c, d) != 0.0:
            return False
    return True


@njit(cache=NUMBA_CACHE, nogil=True)
def coplanar_groups(normals, offsets, vertices, corners, order, keys, window, groups):
    """Fill groups[i] with the first facet (in `order`) that is exactly coplanar with facet i and faces the same way.

    `keys` are the sorted values of a random linear function of (n, d); candidates lie within `window`.
    Rows of `corners` that are negative are never grouped.
    """
    heads = np.empty(order.shape[0], np.int64)  # positions in `order` of the first facet of each group
    n_heads = 0
    for p in range(order.shape[0]):
        i = order[p]
        groups[i] = i
        if corners[i, 0] < 0:
            continue
        tried = 0
        h = n_heads - 1
        while h >= 0 and tried < 6 and keys[p] - keys[heads[h]] <= window:
            j = order[heads[h]]
            h -= 1
            tried += 1
            gap = abs(offsets[i] - offsets[j])
            for k in range(3):
                gap += abs(normals[i, k] - normals[j, k])
            if gap <= 4.0 * window and _coplanar(vertices, corners[j], corners[i]):
                groups[i] = j
                break
        if groups[i] == i:
            heads[n_heads] = p
            n_heads += 1
