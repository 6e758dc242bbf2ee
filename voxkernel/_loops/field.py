"""The violation on an octree: its value at voxel centres where it may be small, one value where it is constant."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.octree import _grown_1d, _grown_2d
from voxkernel._loops.relaxed import _domain_state, _keep_crossing, _weights_of


@njit(cache=NUMBA_CACHE, nogil=True)
def _add_points(nx, ny, nz, value, weight, half, sums):  # type: ignore[no-untyped-def]
    """Add to sums (512,), entry 64 x + 8 y + z, the weight of the planes each voxel centre of a brick violates."""
    for t in range(value.shape[0]):
        ax = 2.0 * half * nx[t]
        ay = 2.0 * half * ny[t]
        az = 2.0 * half * nz[t]
        corner = value[t] - 3.5 * (ax + ay + az)
        w = weight[t]
        for c in range(64):
            at_zero = corner + ax * (c >> 3) + ay * (c & 7)
            for z in range(8):
                sums[8 * c + z] += w if at_zero + az * z > 0.0 else np.int64(0)


@njit(cache=NUMBA_CACHE, nogil=True)
def violation_cells(normals, offsets, reach, weights, n_domain, most, units, depth):  # type: ignore[no-untyped-def]
    """Sample the violated weight on the unit cube, 2**depth voxels an edge, where it may be at most `most`.

    Returns (tile_ijk, tile_log2, tile_values, leaf_ijk, leaf_mask, leaf_values): values are weights over
    `units`; voxels are active where the centre is inside the domain planes and violates at most `most`.
    """
    n = offsets.shape[0]
    last_level = depth - 3
    size = 3 * n + 1024
    x = np.empty(size)
    y = np.empty(size)
    z = np.empty(size)
    a_reach = np.empty(size)
    value = np.empty(size)
    weight = np.empty(size, np.int64)
    for i in range(n):
        x[i] = normals[i, 0]
        y[i] = normals[i, 1]
        z[i] = normals[i, 2]
        a_reach[i] = reach[i]
        value[i] = 0.5 * (normals[i, 0] + normals[i, 1] + normals[i, 2]) - offsets[i]
        weight[i] = weights[i]
    # Slot 0 holds all planes and has one child, the root; slot l + 1 is a cell of level l.
    begin = np.zeros(depth + 3, np.int64)
    middle = np.zeros(depth + 3, np.int64)
    end = np.zeros(depth + 3, np.int64)
    child = np.zeros(depth + 3, np.int64)
    cell = np.zeros((depth + 3, 3), np.int64)
    violated = np.zeros(depth + 3, np.int64)
    middle[0] = n_domain
    end[0] = n
    tile_ijk = np.empty((64, 3), np.int32)
    tile_log2 = np.empty(64, np.int8)
    tile_values = np.empty(64, np.float32)
    leaf_ijk = np.empty((64, 3), np.int32)
    leaf_mask = np.empty((64, 8), np.uint64)
    leaf_values = np.empty((64, 512), np.float32)
    n_tiles = 0
    n_leaves = 0
    sums = np.empty(512, np.int64)
    beyond = np.empty(512, np.int64)
    half = 0.5 / (1 << depth)
    slot = 0
    while slot >= 0:
        if child[slot] == 8:
            slot -= 1
            continue
        new = slot
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
        certain, possible = _weights_of(
            x[mid:last], y[mid:last], z[mid:last], a_reach[mid:last], value[mid:last], weight[mid:last], sx, sy, sz, h
        )
        certain += violated[slot]
        if certain > most:
            continue
        if crossing == 0 and certain == possible + violated[slot]:
            if n_tiles == tile_log2.shape[0]:
                tile_ijk = _grown_2d(tile_ijk)
                tile_log2 = _grown_1d(tile_log2)
                tile_values = _grown_1d(tile_values)
            tile_ijk[n_tiles, 0] = x0 << (depth - new)
            tile_ijk[n_tiles, 1] = y0 << (depth - new)
            tile_ijk[n_tiles, 2] = z0 << (depth - new)
            tile_log2[n_tiles] = depth - new
            tile_values[n_tiles] = certain / units
            n_tiles += 1
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
            continue
        sums[:] = certain
        beyond[:] = 0
        _add_points(x[m:q], y[m:q], z[m:q], value[m:q], weight[m:q], half, sums)
        _add_points(x[last:m], y[last:m], z[last:m], value[last:m], weight[last:m], half, beyond)
        if n_leaves == leaf_ijk.shape[0]:
            leaf_ijk = _grown_2d(leaf_ijk)
            leaf_mask = _grown_2d(leaf_mask)
            leaf_values = _grown_2d(leaf_values)
        some = False
        for word in range(8):
            bits = np.uint64(0)
            for bit in range(64):
                v = 64 * word + bit
                leaf_values[n_leaves, v] = sums[v] / units
                if sums[v] <= most and beyond[v] == 0:
                    bits |= np.uint64(1) << np.uint64(bit)
                    some = True
            leaf_mask[n_leaves, word] = bits
        if some:
            leaf_ijk[n_leaves, 0] = x0 << 3
            leaf_ijk[n_leaves, 1] = y0 << 3
            leaf_ijk[n_leaves, 2] = z0 << 3
            n_leaves += 1
    return (
        tile_ijk[:n_tiles].copy(),
        tile_log2[:n_tiles].copy(),
        tile_values[:n_tiles].copy(),
        leaf_ijk[:n_leaves].copy(),
        leaf_mask[:n_leaves].copy(),
        leaf_values[:n_leaves].copy(),
    )
