"""The relaxed kernel on an octree: the weight that is violated for certain, and the list of undecided planes.

Cells are cubes of the unit cube. A plane is (a, b): a . u <= b, with |a| = 1 up to rounding. For a cell with
centre c and half edge h, s = a . c - b and r = h * reach: s > r proves that the whole cell violates the plane,
s < -r that none of it does. `reach` is |a|_1 plus the bound on all rounding over the half edge of a voxel, so
both are certain at every level. Weights are integers: their sums are exact, in whatever order they are made.

The planes of a list are stored side by side, one array per number, so that the tests of a cell are loops over
contiguous memory. Planes of the domain come first in every list and have no weight: one that is violated for
certain puts a cell outside.

Several thresholds are handled at once. Threshold k is settled in a cell when more than outs[k] is violated
for certain (outside), or at most ins[k] can be (inside); both are increasing, so the unsettled ones are a range.
"""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.octree import ALL_BITS, _grown_1d, _grown_2d, _ones

OUTSIDE = np.int64(1) << np.int64(62)  # more than all weights together
_CHUNK = 512


@njit(cache=NUMBA_CACHE, nogil=True)
def _domain_state(x, y, z, reach, value, sx, sy, sz, h):  # type: ignore[no-untyped-def]
    """Return -1 when the cell is certainly outside a domain plane, else the number of planes it may cross."""
    crossing = 0
    for t in range(value.shape[0]):
        s = value[t] + (x[t] * sx + y[t] * sy + z[t] * sz)
        r = h * reach[t]
        if s > r:
            return -1
        if s >= -r:
            crossing += 1
    return crossing


@njit(cache=NUMBA_CACHE, nogil=True)
def _weights_of(x, y, z, reach, value, weight, sx, sy, sz, h):  # type: ignore[no-untyped-def]
    """Add up what the cell violates for certain, and what it can violate."""
    certain = np.int64(0)
    possible = np.int64(0)
    for t in range(value.shape[0]):
        s = value[t] + (x[t] * sx + y[t] * sy + z[t] * sz)
        r = h * reach[t]
        certain += weight[t] if s > r else np.int64(0)
        possible += weight[t] if s >= -r else np.int64(0)
    return certain, possible


@njit(cache=NUMBA_CACHE, nogil=True)
def _keep_crossing(x, y, z, reach, value, weight, first, last, at, sx, sy, sz, h):  # type: ignore[no-untyped-def]
    """Copy the planes first..last that the cell may cross to `at` and after; return where they end."""
    for t in range(first, last):
        s = value[t] + (x[t] * sx + y[t] * sy + z[t] * sz)
        r = h * reach[t]
        x[at] = x[t]
        y[at] = y[t]
        z[at] = z[t]
        reach[at] = reach[t]
        value[at] = s
        weight[at] = weight[t]
        at += 1 if -r <= s <= r else 0
    return at


@njit(cache=NUMBA_CACHE, nogil=True)
def _add_columns(nx, ny, nz, reach, value, weight, half, low, high, at_low, at_high):  # type: ignore[no-untyped-def]
    """Add planes to the difference arrays of an 8^3 brick; return what they violate at the start of every column.

    Along a column (x, y) a plane is violated on one side of a limit that is linear in x and y. low and high
    are (9 * 64,): entry 64 * z + 8 * x + y is what changes at voxel z, for certain and at most.
    """
    base = np.int64(0)
    for t in range(value.shape[0]):
        ax = 2.0 * half * nx[t]
        ay = 2.0 * half * ny[t]
        az = 2.0 * half * nz[t]
        r = half * (reach[t] + 1e-13)
        if abs(az) < 2e-9 * half:
            # Nearly parallel to the columns: tilt it a little and pay with the pad.
            az = 2e-9 * half if az >= 0 else -2e-9 * half
            r += 1.6e-8 * half
        corner = value[t] - 3.5 * (ax + ay + az)  # the value at voxel (0, 0, 0)
        inverse = 1.0 / az
        certain = (r - corner) * inverse  # where the value is r, -r, along z
        possible = (-r - corner) * inverse
        step_x = -ax * inverse
        step_y = -ay * inverse
        for c in range(64):
            shift = step_x * (c >> 3) + step_y * (c & 7)
            at_low[c] = c + 64 * np.int32(np.ceil(min(8.0, max(0.0, certain + shift))))
            at_high[c] = c + 64 * np.int32(np.ceil(min(8.0, max(0.0, possible + shift))))
        w = weight[t]
        if az < 0:  # violated below the limit: everywhere, less what is above
            base += w
            w = -w
        for c in range(64):
            low[np.uint32(at_low[c])] += w
            high[np.uint32(at_high[c])] += w
    return base


@njit(cache=NUMBA_CACHE, nogil=True)
def _add_up(low, high, base):  # type: ignore[no-untyped-def]
    """Turn changes along the columns into what each voxel violates, entry 64 * z + 8 * x + y."""
    for c in range(64):
        low[c] += base
        high[c] += base
    for c in range(64, 512):
        low[c] += low[c - 64]
        high[c] += high[c - 64]


@njit(cache=NUMBA_CACHE, nogil=True)
def _leave_outside(low, high, outside_low, outside_high):  # type: ignore[no-untyped-def]
    """Make voxels that cross a domain plane undecided at best, those beyond one outside."""
    for c in range(512):
        if outside_low[c] > 0:
            low[c] = OUTSIDE
        if outside_high[c] > 0:
            high[c] = OUTSIDE


@njit(cache=NUMBA_CACHE, nogil=True)
def _leaf(low, high, most_inside, least_outside, inside, boundary):  # type: ignore[no-untyped-def]
    """Fill the masks of a brick; return 0 when they are empty, 1 when everything is inside, 2 otherwise."""
    some = np.uint64(0)
    full = ALL_BITS
    for x in range(8):
        in_word = np.uint64(0)
        out_word = np.uint64(0)
        for y in range(8):
            for z in range(8):
                c = 64 * z + 8 * x + y
                bit = np.uint64(8 * y + z)
                in_word |= np.uint64(high[c] <= most_inside) << bit
                out_word |= np.uint64(low[c] > least_outside) << bit
        inside[x] = in_word
        boundary[x] = ~(in_word | out_word)
        some |= ~out_word
        full &= in_word
    if some == np.uint64(0):
        return 0
    return 1 if full == ALL_BITS else 2


@njit(cache=NUMBA_CACHE, nogil=True)
def relaxed_cells(  # type: ignore[no-untyped-def]
    numbers, weights, n_domain, certain_before, ins, outs, k_before, depth, start_level, start, stop_level, count_only
):
    """Classify the unit cube, or one cell of it, down to 2**depth voxels an edge for every threshold.

    `numbers` are the planes of the cell `start` at `start_level`, with level -1 those of the cube before its
    root is looked at: normal, reach, value at the centre; the first `n_domain` are the domain's.
    `certain_before` is what the cell violates for certain, `k_before` the range of its unsettled thresholds.
    Cells still unsettled at `stop_level` are listed, not divided (none with stop_level >= depth).

    Returns (tile_ijk, tile_log2, tile_of, leaf_ijk, leaf_of, leaf_inside, leaf_boundary, n_inside, n_boundary,
    pending, pending_numbers, pending_weights): `*_of` is the threshold a row belongs to, counts are in voxels
    per threshold. A row of `pending` is a cell to go on with: ijk, first plane, first facet plane, end,
    certain weight, range of thresholds.
    """
    n = weights.shape[0]
    n_thresholds = ins.shape[0]
    last_level = depth - 3
    size = 3 * n + 1024
    x = np.empty(size)
    y = np.empty(size)
    z = np.empty(size)
    a_reach = np.empty(size)
    value = np.empty(size)
    weight = np.empty(size, np.int64)
    for i in range(n):
        x[i] = numbers[i, 0]
        y[i] = numbers[i, 1]
        z[i] = numbers[i, 2]
        a_reach[i] = numbers[i, 3]
        value[i] = numbers[i, 4]
        weight[i] = weights[i]
    # Slot l + 1 is a cell of level l whose children are open; slot 0 has one child, the root.
    begin = np.zeros(depth + 3, np.int64)
    middle = np.zeros(depth + 3, np.int64)
    end = np.zeros(depth + 3, np.int64)
    child = np.zeros(depth + 3, np.int64)
    cell = np.zeros((depth + 3, 3), np.int64)
    violated = np.zeros(depth + 3, np.int64)
    lowest = np.zeros(depth + 3, np.int64)
    highest = np.zeros(depth + 3, np.int64)
    slot = start_level + 1
    lowest_slot = slot
    middle[slot] = n_domain
    end[slot] = n
    for k in range(3):
        cell[slot, k] = start[k]
    violated[slot] = certain_before
    lowest[slot] = k_before[0]
    highest[slot] = k_before[1]
    tile_ijk = np.empty((64, 3), np.int32)
    tile_log2 = np.empty(64, np.int8)
    tile_of = np.empty(64, np.int32)
    leaf_ijk = np.empty((64, 3), np.int32)
    leaf_of = np.empty(64, np.int32)
    leaf_inside = np.empty((64, 8), np.uint64)
    leaf_boundary = np.empty((64, 8), np.uint64)
    pending = np.empty((8, 9), np.int64)
    pending_numbers = np.empty((64, 5))
    pending_weights = np.empty(64, np.int64)
    n_tiles = 0
    n_leaves = 0
    n_pending = 0
    n_listed = 0
    n_inside = np.zeros(n_thresholds, np.int64)
    n_boundary = np.zeros(n_thresholds, np.int64)
    difference = np.zeros((4, 9 * 64), np.int64)
    at = np.empty((2, 64), np.int32)
    while slot >= lowest_slot:
        if child[slot] == 8:
            slot -= 1
            continue
        new = slot  # level of the child
        c = child[slot]
        child[slot] = 8 if new == 0 else c + 1
        h = 0.5 / (1 << new)
        x0, y0, z0 = np.int64(0), np.int64(0), np.int64(0)
        sx, sy, sz = 0.0, 0.0, 0.0
        if new > 0:
            sx = h if c & 4 else -h
            sy = h if c & 2 else -h
            sz = h if c & 1 else -h
            x0 = 2 * cell[slot, 0] + ((c >> 2) & 1)
            y0 = 2 * cell[slot, 1] + ((c >> 1) & 1)
            z0 = 2 * cell[slot, 2] + (c & 1)
        first = begin[slot]
        mid = middle[slot]
        last = end[slot]
        crossing = _domain_state(
            x[first:mid], y[first:mid], z[first:mid], a_reach[first:mid], value[first:mid], sx, sy, sz, h
        )
        if crossing < 0:
            continue
        k_high = highest[slot]
        certain = violated[slot]
        possible = certain
        t = mid
        while t < last and certain <= outs[k_high - 1]:
            u = min(t + _CHUNK, last)
            more, at_most = _weights_of(x[t:u], y[t:u], z[t:u], a_reach[t:u], value[t:u], weight[t:u], sx, sy, sz, h)
            certain += more
            possible += at_most
            t = u
        if certain > outs[k_high - 1]:
            continue
        k_low = lowest[slot]
        while certain > outs[k_low]:
            k_low += 1
        while crossing == 0 and k_high > k_low and possible <= ins[k_high - 1]:
            k_high -= 1
            n_inside[k_high] += np.int64(1) << (3 * (depth - new))
            if not count_only:
                if n_tiles == tile_log2.shape[0]:
                    tile_ijk = _grown_2d(tile_ijk)
                    tile_log2 = _grown_1d(tile_log2)
                    tile_of = _grown_1d(tile_of)
                tile_ijk[n_tiles, 0] = x0 << (depth - new)
                tile_ijk[n_tiles, 1] = y0 << (depth - new)
                tile_ijk[n_tiles, 2] = z0 << (depth - new)
                tile_log2[n_tiles] = depth - new
                tile_of[n_tiles] = k_high
                n_tiles += 1
        if k_low == k_high:
            continue
        while last + (last - first) + 1 > value.shape[0]:
            x = _grown_1d(x)
            y = _grown_1d(y)
            z = _grown_1d(z)
            a_reach = _grown_1d(a_reach)
            value = _grown_1d(value)
            weight = _grown_1d(weight)
        m = _keep_crossing(x, y, z, a_reach, value, weight, first, mid, last, sx, sy, sz, h)
        q = _keep_crossing(x, y, z, a_reach, value, weight, mid, last, m, sx, sy, sz, h)
        if new == stop_level:
            if n_pending == pending.shape[0]:
                pending = _grown_2d(pending)
            while n_listed + q - last > pending_weights.shape[0]:
                pending_numbers = _grown_2d(pending_numbers)
                pending_weights = _grown_1d(pending_weights)
            row = (x0, y0, z0, n_listed, n_listed + m - last, n_listed + q - last, certain, k_low, k_high)
            for k in range(9):
                pending[n_pending, k] = row[k]
            n_pending += 1
            for t in range(last, q):
                pending_numbers[n_listed, 0] = x[t]
                pending_numbers[n_listed, 1] = y[t]
                pending_numbers[n_listed, 2] = z[t]
                pending_numbers[n_listed, 3] = a_reach[t]
                pending_numbers[n_listed, 4] = value[t]
                pending_weights[n_listed] = weight[t]
                n_listed += 1
            continue
        if new < last_level:
            slot += 1
            begin[slot] = last
            middle[slot] = m
            end[slot] = q
            child[slot] = 0
            cell[slot, 0] = x0
            cell[slot, 1] = y0
            cell[slot, 2] = z0
            violated[slot] = certain
            lowest[slot] = k_low
            highest[slot] = k_high
            continue
        half = 0.5 / (1 << depth)
        difference[0] = 0
        difference[1] = 0
        low, high = difference[0], difference[1]
        base = _add_columns(
            x[m:q], y[m:q], z[m:q], a_reach[m:q], value[m:q], weight[m:q], half, low, high, at[0], at[1]
        )
        _add_up(low, high, base + certain)
        if m > last:
            difference[2] = 0
            difference[3] = 0
            base = _add_columns(
                x[last:m], y[last:m], z[last:m], a_reach[last:m], value[last:m], weight[last:m],
                half, difference[2], difference[3], at[0], at[1],
            )  # fmt: skip
            _add_up(difference[2], difference[3], base)
            _leave_outside(low, high, difference[2], difference[3])
        while n_leaves + k_high - k_low > leaf_of.shape[0]:
            leaf_ijk = _grown_2d(leaf_ijk)
            leaf_of = _grown_1d(leaf_of)
            leaf_inside = _grown_2d(leaf_inside)
            leaf_boundary = _grown_2d(leaf_boundary)
        for k in range(k_low, k_high):
            state = _leaf(low, high, ins[k], outs[k], leaf_inside[n_leaves], leaf_boundary[n_leaves])
            for word in range(8):
                n_inside[k] += _ones(leaf_inside[n_leaves, word])
                n_boundary[k] += _ones(leaf_boundary[n_leaves, word])
            if count_only or state == 0:
                continue
            if state == 1:
                if n_tiles == tile_log2.shape[0]:
                    tile_ijk = _grown_2d(tile_ijk)
                    tile_log2 = _grown_1d(tile_log2)
                    tile_of = _grown_1d(tile_of)
                tile_ijk[n_tiles, 0] = x0 << 3
                tile_ijk[n_tiles, 1] = y0 << 3
                tile_ijk[n_tiles, 2] = z0 << 3
                tile_log2[n_tiles] = 3
                tile_of[n_tiles] = k
                n_tiles += 1
                continue
            leaf_ijk[n_leaves, 0] = x0 << 3
            leaf_ijk[n_leaves, 1] = y0 << 3
            leaf_ijk[n_leaves, 2] = z0 << 3
            leaf_of[n_leaves] = k
            n_leaves += 1
    return (
        tile_ijk[:n_tiles].copy(),
        tile_log2[:n_tiles].copy(),
        tile_of[:n_tiles].copy(),
        leaf_ijk[:n_leaves].copy(),
        leaf_of[:n_leaves].copy(),
        leaf_inside[:n_leaves].copy(),
        leaf_boundary[:n_leaves].copy(),
        n_inside,
        n_boundary,
        pending[:n_pending].copy(),
        pending_numbers[:n_listed].copy(),
        pending_weights[:n_listed].copy(),
    )
