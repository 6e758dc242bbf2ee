"""The least violated point: branch and bound over octree cells, with the lists of `relaxed.py`.

A cell can do no better than what all of it violates for certain; its centre can do no worse than what is
violated there. Weights are integers, so both bounds are exact.
"""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.octree import _grown_1d


@njit(cache=NUMBA_CACHE, nogil=True)
def _domain_state(x, y, z, reach, pad, value, sx, sy, sz, h, blur):  # type: ignore[no-untyped-def]
    """Return -1 when the cell is certainly outside the domain, 1 when its centre is certainly inside, else 0."""
    centre = 1
    for t in range(value.shape[0]):
        s = value[t] + (x[t] * sx + y[t] * sy + z[t] * sz)
        if s > h * reach[t] + pad[t]:
            return -1
        if s > -pad[t] - blur:
            centre = 0
    return centre


@njit(cache=NUMBA_CACHE, nogil=True)
def _weights_of(x, y, z, reach, pad, value, weight, sx, sy, sz, h, blur):  # type: ignore[no-untyped-def]
    """Add up what all of the cell violates for certain, and what its centre violates at most."""
    certain = np.int64(0)
    at_centre = np.int64(0)
    for t in range(value.shape[0]):
        s = value[t] + (x[t] * sx + y[t] * sy + z[t] * sz)
        certain += weight[t] if s > h * reach[t] + pad[t] else np.int64(0)
        at_centre += weight[t] if s > -pad[t] - blur else np.int64(0)
    return certain, at_centre


@njit(cache=NUMBA_CACHE, nogil=True)
def _keep_crossing(x, y, z, reach, pad, value, weight, first, last, at, sx, sy, sz, h):  # type: ignore[no-untyped-def]
    """Copy the planes first..last that the cell may cross to `at` and after; return where they end."""
    for t in range(first, last):
        s = value[t] + (x[t] * sx + y[t] * sy + z[t] * sz)
        r = h * reach[t] + pad[t]
        x[at] = x[t]
        y[at] = y[t]
        z[at] = z[t]
        reach[at] = reach[t]
        pad[at] = pad[t]
        value[at] = s
        weight[at] = weight[t]
        at += 1 if -r <= s <= r else 0
    return at


@njit(cache=NUMBA_CACHE, nogil=True)
def least_violated(  # type: ignore[no-untyped-def]
    normals, offsets, reach, pads, weights, n_domain, blur, best, gap, ratio, max_level, max_cells, center, open_cell
):
    """Find the least violated weight in the unit cube within `gap`, or within `ratio` of it where that is more.

    The first `n_domain` planes are the domain's. `best` is a weight known to be reached; when a centre does
    better, it is written to `center`. `blur` is by how much a centre may move later. Children are visited
    in the order of what their centre violates, so that a good point is found early.

    Returns (best, lower, n_cells): `lower` is certain; it is further below than asked for when cells of
    `max_level` stay open or `max_cells` have been looked at. `open_cell` is then centre and half edge of
    the least violated cell of `max_level`.
    """
    n = offsets.shape[0]
    size = 3 * n + 1024
    x = np.empty(size)
    y = np.empty(size)
    z = np.empty(size)
    a_reach = np.empty(size)
    pad = np.empty(size)
    value = np.empty(size)
    weight = np.empty(size, np.int64)
    for i in range(n):
        x[i] = normals[i, 0]
        y[i] = normals[i, 1]
        z[i] = normals[i, 2]
        a_reach[i] = reach[i]
        pad[i] = pads[i]
        value[i] = 0.5 * (normals[i, 0] + normals[i, 1] + normals[i, 2]) - offsets[i]
        weight[i] = weights[i]
    begin = np.zeros(max_level + 2, np.int64)
    middle = np.zeros(max_level + 2, np.int64)
    end = np.zeros(max_level + 2, np.int64)
    position = np.zeros(max_level + 2, np.int64)
    violated = np.zeros(max_level + 2, np.int64)
    centre = np.zeros((max_level + 2, 3))
    certain = np.zeros((max_level + 2, 8), np.int64)
    order = np.zeros((max_level + 2, 8), np.int64)
    n_children = np.zeros(max_level + 2, np.int64)
    keys = np.empty(8, np.int64)
    lower = best
    least_open = best
    n_cells = 0
    # Slot l is a cell of level l whose children are open; slot 0 is the root.
    middle[0] = n_domain
    end[0] = n
    centre[0] = 0.5
    expand = True
    level = 0
    while level >= 0:
        h = 0.25 / (1 << level)
        first = begin[level]
        mid = middle[level]
        last = end[level]
        if expand:
            expand = False
            position[level] = 0
            m = 0
            for c in range(8):
                sx = h if c & 4 else -h
                sy = h if c & 2 else -h
                sz = h if c & 1 else -h
                state = _domain_state(
                    x[first:mid], y[first:mid], z[first:mid], a_reach[first:mid], pad[first:mid], value[first:mid],
                    sx, sy, sz, h, blur,
                )  # fmt: skip
                if state < 0:
                    continue
                sure, at_centre = _weights_of(
                    x[mid:last], y[mid:last], z[mid:last], a_reach[mid:last], pad[mid:last], value[mid:last],
                    weight[mid:last], sx, sy, sz, h, blur,
                )  # fmt: skip
                sure += violated[level]
                at_centre += violated[level]
                if state == 1 and at_centre < best:
                    best = at_centre
                    center[0] = centre[level, 0] + sx
                    center[1] = centre[level, 1] + sy
                    center[2] = centre[level, 2] + sz
                certain[level, c] = sure
                p = m
                while p > 0 and keys[p - 1] > at_centre:
                    keys[p] = keys[p - 1]
                    order[level, p] = order[level, p - 1]
                    p -= 1
                keys[p] = at_centre
                order[level, p] = c
                m += 1
            n_children[level] = m
            n_cells += m
        if position[level] == n_children[level]:
            level -= 1
            continue
        c = order[level, position[level]]
        position[level] += 1
        sure = certain[level, c]
        enough = best - max(gap, np.int64(ratio * best))
        if sure >= enough or level + 1 >= max_level or n_cells >= max_cells:
            lower = min(lower, sure)
            if sure < enough and sure < least_open and level + 1 >= max_level:
                least_open = sure
                open_cell[0] = centre[level, 0] + (h if c & 4 else -h)
                open_cell[1] = centre[level, 1] + (h if c & 2 else -h)
                open_cell[2] = centre[level, 2] + (h if c & 1 else -h)
                open_cell[3] = h
            continue
        sx = h if c & 4 else -h
        sy = h if c & 2 else -h
        sz = h if c & 1 else -h
        while last + (last - first) + 1 > value.shape[0]:
            x = _grown_1d(x)
            y = _grown_1d(y)
            z = _grown_1d(z)
            a_reach = _grown_1d(a_reach)
            pad = _grown_1d(pad)
            value = _grown_1d(value)
            weight = _grown_1d(weight)
        m = _keep_crossing(x, y, z, a_reach, pad, value, weight, first, mid, last, sx, sy, sz, h)
        q = _keep_crossing(x, y, z, a_reach, pad, value, weight, mid, last, m, sx, sy, sz, h)
        level += 1
        begin[level] = last
        middle[level] = m
        end[level] = q
        violated[level] = sure
        centre[level, 0] = centre[level - 1, 0] + sx
        centre[level, 1] = centre[level - 1, 1] + sy
        centre[level, 2] = centre[level - 1, 2] + sz
        expand = True
    return best, min(lower, best), n_cells
