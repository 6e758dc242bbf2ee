"""What points violate: the points are divided like a kd-tree, each part with the planes that may cross it.

A plane that all of a part violates for certain is added once; one that none of it does is dropped. Signs
within rounding of a plane are decided with expansions. Weights are integers.
"""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.convexity import orientation
from voxkernel._loops.octree import _grown_1d, _grown_2d

_LEAF_POINTS = 12
_UNIT = 2.0**-53


@njit(cache=NUMBA_CACHE, nogil=True)
def _divide(order, keys, first, last):  # type: ignore[no-untyped-def]
    """Reorder order[first:last] so that the keys of the lower half are not above those of the upper half."""
    target = (first + last) // 2
    low = first
    high = last - 1
    while low < high:
        pivot = keys[order[(low + high) // 2]]
        i = low
        j = high
        while i <= j:
            while keys[order[i]] < pivot:
                i += 1
            while keys[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if target <= j:
            high = j
        elif target >= i:
            low = i
        else:
            return target
    return target


@njit(cache=NUMBA_CACHE, nogil=True)
def _point_weight(x, y, z, offset, error, weight, px, py, pz, size):  # type: ignore[no-untyped-def]
    """Add up what a point violates for certain; count the planes it is within rounding of."""
    certain = np.int64(0)
    near = np.int64(0)
    for t in range(offset.shape[0]):
        s = (x[t] * px + y[t] * py + z[t] * pz) - offset[t]
        e = error[t] * size
        certain += weight[t] if s > e else np.int64(0)
        near += np.int64(0) if s > e or s < -e else np.int64(1)
    return certain, near


@njit(cache=NUMBA_CACHE, nogil=True)
def violated_weights(  # type: ignore[no-untyped-def]
    local, world, normals, offsets, errors, weights, corners, vertices, by_expansions, order, sums
):
    """Fill sums[i] with the weight that point i violates, for the points of `order` (which is reordered).

    `local` are columns (3, n), `world` the same points as given, (n, 3). `errors[i]` bounds the error of
    n . x - d over |x| + 1. Planes without corners, and all with `by_expansions` false, are left to exact
    arithmetic elsewhere: returns the pairs (point, plane) whose sign is open.
    """
    n = offsets.shape[0]
    size = 3 * n + 1024
    x = np.empty(size)
    y = np.empty(size)
    z = np.empty(size)
    offset = np.empty(size)
    error = np.empty(size)
    weight = np.empty(size, np.int64)
    row = np.empty(size, np.int64)
    for i in range(n):
        x[i] = normals[i, 0]
        y[i] = normals[i, 1]
        z[i] = normals[i, 2]
        offset[i] = offsets[i]
        error[i] = errors[i] + 4.0 * _UNIT
        weight[i] = weights[i]
        row[i] = i
    open_pairs = np.empty((64, 2), np.int64)
    n_open = 0
    # A part is points lower..upper of `order` with the planes first..last; both halves share its list.
    part = np.zeros((160, 4), np.int64)
    violated = np.zeros(160, np.int64)
    part[0, 1] = order.shape[0]
    part[0, 3] = n
    depth = 1 if order.shape[0] else 0
    low = np.empty(3)
    high = np.empty(3)
    while depth > 0:
        depth -= 1
        lower = part[depth, 0]
        upper = part[depth, 1]
        first = part[depth, 2]
        last = part[depth, 3]
        certain = violated[depth]
        if upper - lower > 1:
            far = 0.0
            for k in range(3):
                low[k] = np.inf
                high[k] = -np.inf
                for j in range(lower, upper):
                    low[k] = min(low[k], local[k, order[j]])
                    high[k] = max(high[k], local[k, order[j]])
                far += max(abs(low[k]), abs(high[k]))
            cx, cy, cz = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
            widen = 0.5 * (1.0 + 1e-12)
            hx, hy, hz = widen * (high[0] - low[0]), widen * (high[1] - low[1]), widen * (high[2] - low[2])
            while last + (last - first) + 1 > offset.shape[0]:
                x = _grown_1d(x)
                y = _grown_1d(y)
                z = _grown_1d(z)
                offset = _grown_1d(offset)
                error = _grown_1d(error)
                weight = _grown_1d(weight)
                row = _grown_1d(row)
            q = last
            for t in range(first, last):
                s = (x[t] * cx + y[t] * cy + z[t] * cz) - offset[t]
                r = abs(x[t]) * hx + abs(y[t]) * hy + abs(z[t]) * hz + 2.0 * error[t] * (far + 1.0)
                if s > r:
                    certain += weight[t]
                x[q] = x[t]
                y[q] = y[t]
                z[q] = z[t]
                offset[q] = offset[t]
                error[q] = error[t]
                weight[q] = weight[t]
                row[q] = row[t]
                q += 0 if s > r or s < -r else 1
            first = last
            last = q
        if upper - lower > _LEAF_POINTS and last > first:
            axis = 0
            for k in range(1, 3):
                if high[k] - low[k] > high[axis] - low[axis]:
                    axis = k
            cut = _divide(order, local[axis], lower, upper)
            for lower_end, upper_end in ((cut, upper), (lower, cut)):
                part[depth, 0] = lower_end
                part[depth, 1] = upper_end
                part[depth, 2] = first
                part[depth, 3] = last
                violated[depth] = certain
                depth += 1
            continue
        for j in range(lower, upper):
            p = order[j]
            px, py, pz = local[0, p], local[1, p], local[2, p]
            extent = abs(px) + abs(py) + abs(pz) + 1.0
            more, near = _point_weight(
                x[first:last], y[first:last], z[first:last], offset[first:last], error[first:last], weight[first:last],
                px, py, pz, extent,
            )  # fmt: skip
            sums[p] = certain + more
            if near == 0:
                continue
            for t in range(first, last):
                s = (x[t] * px + y[t] * py + z[t] * pz) - offset[t]
                e = error[t] * extent
                if s > e or s < -e:
                    continue
                i = row[t]
                if by_expansions and corners[i, 0] >= 0:
                    a, b, c = vertices[corners[i, 0]], vertices[corners[i, 1]], vertices[corners[i, 2]]
                    if orientation(a, b, c, world[p]) > 0.0:
                        sums[p] += weight[t]
                    continue
                if n_open == open_pairs.shape[0]:
                    open_pairs = _grown_2d(open_pairs)
                open_pairs[n_open, 0] = p
                open_pairs[n_open, 1] = i
                n_open += 1
    return open_pairs[:n_open].copy()


@njit(cache=NUMBA_CACHE, nogil=True)
def faces_away(vertices, faces, point):  # type: ignore[no-untyped-def]
    """Tell for every triangle whether the point is strictly on its outer side; every sign exact."""
    away = np.empty(faces.shape[0], np.bool_)
    for f in range(faces.shape[0]):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        away[f] = orientation(a, b, c, point) > 0.0
    return away
