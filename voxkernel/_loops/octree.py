"""The exact kernel on an octree: depth-first, with the list of undecided half-spaces of every cell.

Cells are cubes of the unit cube. A half-space is (a, b): a . u <= b, with |a| = 1 up to rounding. For
a cell with centre c and half edge h, s = a . c - b and r = h |a|_1: s > r + pad proves that the whole
cell is outside, s < -r - pad that it is inside. `pad` covers all rounding, so both are certain.
"""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

ALL_BITS = np.uint64(0xFFFFFFFFFFFFFFFF)


@njit(cache=NUMBA_CACHE, nogil=True)
def _grown_1d(array):
    bigger = np.empty(2 * array.shape[0] + 64, array.dtype)
    bigger[: array.shape[0]] = array
    return bigger


@njit(cache=NUMBA_CACHE, nogil=True)
def _grown_2d(array):
    bigger = np.empty((2 * array.shape[0] + 64, array.shape[1]), array.dtype)
    bigger[: array.shape[0]] = array
    return bigger


@njit(cache=NUMBA_CACHE, nogil=True)
def _brick(half, normals, reach, pads, ids, values, first, last, inside, possible):
    """Fill the masks of an 8^3 brick: voxels inside all half-spaces, voxels not certainly outside one.

    In the column (x, y), a half-space leaves the voxels on one side of a plane: z below or above a
    limit that is linear in x and y, so a column costs two additions and two shifts.
    Returns 0 when nothing is possible, 1 when everything is inside, 2 otherwise.
    """
    for x in range(8):
        inside[x] = ALL_BITS
        possible[x] = ALL_BITS
    for t in range(first, last):
        i = ids[t]
        ax = 2.0 * half * normals[i, 0]
        ay = 2.0 * half * normals[i, 1]
        az = 2.0 * half * normals[i, 2]
        r = half * reach[i] + pads[i] + 1e-13 * half
        if abs(az) < 2e-9 * half:
            # Nearly parallel to the columns: tilt it a little and pay with the pad.
            az = 2e-9 * half if az >= 0 else -2e-9 * half
            r += 1.6e-8 * half
        corner = values[t] - 3.5 * (ax + ay + az)  # the value at voxel (0, 0, 0)
        inverse = 1.0 / az
        low = (-r - corner) * inverse  # where the value is -r, r, along z
        high = (r - corner) * inverse
        step_x = -ax * inverse
        step_y = -ay * inverse
        some = np.uint64(0)
        if az > 0:
            for x in range(8):
                in_word = np.uint64(0)
                may_word = np.uint64(0)
                for y in range(8):
                    shift = step_x * x + step_y * y
                    # inside: z < low; possible: z <= high
                    k = int(min(8.0, max(0.0, np.ceil(low + shift))))
                    m = int(min(8.0, max(0.0, np.floor(high + shift) + 1.0)))
                    in_word |= np.uint64((1 << k) - 1) << np.uint64(8 * y)
                    may_word |= np.uint64((1 << m) - 1) << np.uint64(8 * y)
                inside[x] &= in_word
                possible[x] &= may_word
                some |= possible[x]
        else:
            for x in range(8):
                in_word = np.uint64(0)
                may_word = np.uint64(0)
                for y in range(8):
                    shift = step_x * x + step_y * y
                    # inside: z > low; possible: z >= high
                    k = int(min(8.0, max(0.0, np.floor(low + shift) + 1.0)))
                    m = int(min(8.0, max(0.0, np.ceil(high + shift))))
                    in_word |= np.uint64(0xFF & ~((1 << k) - 1)) << np.uint64(8 * y)
                    may_word |= np.uint64(0xFF & ~((1 << m) - 1)) << np.uint64(8 * y)
                inside[x] &= in_word
                possible[x] &= may_word
                some |= possible[x]
        if some == np.uint64(0):
            return 0
    full = ALL_BITS
    for x in range(8):
        full &= inside[x]
    return 1 if full == ALL_BITS else 2


@njit(cache=NUMBA_CACHE, nogil=True)
def exact_cells(normals, offsets, reach, pads, depth, count_only):
    """Classify the unit cube down to 2**depth voxels an edge; bricks of 8^3 are the last level.

    Returns (tile_ijk, tile_log2, leaf_ijk, leaf_inside, leaf_boundary, n_inside, n_boundary); the
    counts are in voxels. With `count_only` the arrays stay empty.
    """
    n = offsets.shape[0]
    last_level = depth - 3
    ids = np.empty(4 * n + 1024, np.int32)
    values = np.empty(4 * n + 1024, np.float64)
    begin = np.zeros(depth + 2, np.int64)
    end = np.zeros(depth + 2, np.int64)
    child = np.zeros(depth + 2, np.int64)
    cell = np.zeros((depth + 2, 3), np.int64)
    tile_ijk = np.empty((64, 3), np.int32)
    tile_log2 = np.empty(64, np.int8)
    leaf_ijk = np.empty((64, 3), np.int32)
    leaf_inside = np.empty((64, 8), np.uint64)
    leaf_boundary = np.empty((64, 8), np.uint64)
    inside = np.empty(8, np.uint64)
    possible = np.empty(8, np.uint64)
    n_tiles = 0
    n_leaves = 0
    n_inside = 0
    n_boundary = 0
    # Level 0 is the whole cube.
    state = 2
    q = 0
    for i in range(n):
        s = 0.5 * (normals[i, 0] + normals[i, 1] + normals[i, 2]) - offsets[i]
        r = 0.5 * reach[i] + pads[i]
        if s > r:
            state = 0
            break
        if s >= -r:
            ids[q] = i
            values[q] = s
            q += 1
    if state == 2 and q == 0:
        state = 1
    end[0] = q
    level = 0
    if state == 1:
        n_inside = (1 << depth) ** 3
        tile_ijk[0] = 0
        tile_log2[0] = depth
        n_tiles = 1
        level = -1
    elif state == 0:
        level = -1
    elif last_level == 0:
        code = _brick(0.5 / (1 << depth), normals, reach, pads, ids, values, 0, q, inside, possible)
        if code != 0:
            leaf_ijk[0] = 0
            for x in range(8):
                leaf_inside[0, x] = inside[x]
                leaf_boundary[0, x] = possible[x] & ~inside[x]
                n_inside += _ones(leaf_inside[0, x])
                n_boundary += _ones(leaf_boundary[0, x])
            n_leaves = 1
        level = -1
    while level >= 0:
        if child[level] == 8:
            level -= 1
            continue
        c = child[level]
        child[level] += 1
        new = level + 1
        h = 0.5 / (1 << new)
        sx = h if c & 4 else -h
        sy = h if c & 2 else -h
        sz = h if c & 1 else -h
        first = begin[level]
        last = end[level]
        if last + (last - first) > ids.shape[0]:
            ids = _grown_1d(ids)
            values = _grown_1d(values)
        q = last
        outside = False
        for t in range(first, last):
            i = ids[t]
            s = values[t] + (normals[i, 0] * sx + normals[i, 1] * sy + normals[i, 2] * sz)
            r = h * reach[i] + pads[i]
            if s > r:
                outside = True
                # The plane that decided is tried first for the next sibling.
                j = ids[first]
                v = values[first]
                ids[first] = ids[t]
                values[first] = values[t]
                ids[t] = j
                values[t] = v
                break
            if s >= -r:
                ids[q] = i
                values[q] = s
                q += 1
        if outside:
            continue
        x0 = 2 * cell[level, 0] + ((c >> 2) & 1)
        y0 = 2 * cell[level, 1] + ((c >> 1) & 1)
        z0 = 2 * cell[level, 2] + (c & 1)
        if q == last:
            code = 1
        elif new == last_level:
            code = _brick(0.5 / (1 << depth), normals, reach, pads, ids, values, last, q, inside, possible)
        else:
            begin[new] = last
            end[new] = q
            child[new] = 0
            cell[new, 0] = x0
            cell[new, 1] = y0
            cell[new, 2] = z0
            level = new
            continue
        if code == 1:
            n_inside += 1 << (3 * (depth - new))
            if not count_only:
                if n_tiles == tile_log2.shape[0]:
                    tile_ijk = _grown_2d(tile_ijk)
                    tile_log2 = _grown_1d(tile_log2)
                tile_ijk[n_tiles, 0] = x0 << (depth - new)
                tile_ijk[n_tiles, 1] = y0 << (depth - new)
                tile_ijk[n_tiles, 2] = z0 << (depth - new)
                tile_log2[n_tiles] = depth - new
                n_tiles += 1
        elif code == 2:
            for x in range(8):
                possible[x] &= ~inside[x]
                n_inside += _ones(inside[x])
                n_boundary += _ones(possible[x])
            if not count_only:
                if n_leaves == leaf_ijk.shape[0]:
                    leaf_ijk = _grown_2d(leaf_ijk)
                    leaf_inside = _grown_2d(leaf_inside)
                    leaf_boundary = _grown_2d(leaf_boundary)
                leaf_ijk[n_leaves, 0] = x0 << 3
                leaf_ijk[n_leaves, 1] = y0 << 3
                leaf_ijk[n_leaves, 2] = z0 << 3
                for x in range(8):
                    leaf_inside[n_leaves, x] = inside[x]
                    leaf_boundary[n_leaves, x] = possible[x]
                n_leaves += 1
    return (
        tile_ijk[:n_tiles].copy(),
        tile_log2[:n_tiles].copy(),
        leaf_ijk[:n_leaves].copy(),
        leaf_inside[:n_leaves].copy(),
        leaf_boundary[:n_leaves].copy(),
        n_inside,
        n_boundary,
    )


@njit(cache=NUMBA_CACHE, nogil=True)
def _ones(word):
    """Count the set bits of a 64-bit word."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
