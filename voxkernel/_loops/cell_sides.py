"""Which side of its faces is the inside of a cell, where the file does not say."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE
from voxkernel._loops.cell_gather import gather, largest_sizes, local_frame
from voxkernel._loops.cell_planes import fan_volume
from voxkernel._loops.sorting import sort_range


@njit(cache=NUMBA_CACHE, nogil=True)
def _root(parent, turned, f):
    """Find the root of a face and whether it is turned against it."""
    turn = False
    while parent[f] != f:
        turn ^= turned[f]
        f = parent[f]
    return f, turn


@njit(cache=NUMBA_CACHE, nogil=True)
def orient_cells(vertices, face_offsets, face_vertices, cell_offsets, cell_faces, cell_flips, answer):
    """Turn the faces of each cell alike, then outward; `cell_flips` is changed in place.

    answer[cell]: 1 done, 0 the sign of the volume is in doubt, -1 some edge does not have two faces,
    -2 no way of turning fits (one-sided), -3 the faces are not connected. Only the first two change the flips.
    """
    n_cells = cell_offsets.shape[0] - 1
    n_f, n_c = largest_sizes(face_offsets, cell_offsets, cell_faces, 0, n_cells)
    number = np.full(vertices.shape[0], -1, np.int64)
    used, ring = np.empty(n_c, np.int64), np.empty(n_c, np.int64)
    keys, uses = np.empty(n_c, np.int64), np.empty(n_c, np.int64)
    start, apex, raw = np.empty(n_f + 1, np.int64), np.zeros(n_f, np.int64), np.empty((n_c, 3))
    parent, turned, origin = np.empty(n_f, np.int64), np.empty(n_f, np.bool_), np.empty(3)
    for cell in range(n_cells):
        low, high = cell_offsets[cell], cell_offsets[cell + 1]
        n_faces = high - low
        n_vertices = gather(
            vertices, face_offsets, face_vertices, cell_faces, cell_flips, low, high, number, used, raw, ring, start
        )
        answer[cell] = -1
        if n_vertices <= 0:
            continue
        n = 0
        for f in range(n_faces):
            parent[f] = f
            turned[f] = False
            a = ring[start[f + 1] - 1]
            for j in range(start[f], start[f + 1]):
                b = ring[j]
                if a != b:
                    keys[n] = min(a, b) * n_vertices + max(a, b)
                    uses[n] = 2 * f + (1 if a < b else 0)
                    n += 1
                a = b
        sort_range(keys, uses, 0, n)
        state = 1 if n % 2 == 0 else -1
        for j in range(0, n - 1, 2):
            if keys[j] != keys[j + 1] or (j + 2 < n and keys[j + 2] == keys[j]):
                state = -1
                break
            f, turn_f = _root(parent, turned, uses[j] >> 1)
            g, turn_g = _root(parent, turned, uses[j + 1] >> 1)
            turn = turn_f ^ turn_g ^ ((uses[j] & 1) == (uses[j + 1] & 1))
            if f == g:
                if turn:
                    state = -2
                    break
            else:
                parent[g] = f
                turned[g] = turn
        if state == 1:
            top, _ = _root(parent, turned, 0)
            for f in range(1, n_faces):
                if _root(parent, turned, f)[0] != top:
                    state = -3
        answer[cell] = state
        if state != 1:
            continue
        for f in range(n_faces):
            if _root(parent, turned, f)[1]:
                cell_flips[low + f] ^= True
                begin, end = start[f], start[f + 1]
                for k in range((end - begin) // 2):
                    ring[begin + k], ring[end - 1 - k] = ring[end - 1 - k], ring[begin + k]
        scale, _ = local_frame(raw, n_vertices, origin)
        if scale <= 0.0:
            answer[cell] = 0
            continue
        for v in range(n_vertices):
            for axis in range(3):
                raw[v, axis] = (raw[v, axis] - origin[axis]) / scale
        volume, doubt = fan_volume(raw, ring, start, apex, n_faces)
        if abs(volume) <= doubt:
            answer[cell] = 0
        elif volume < 0.0:
            for f in range(low, high):
                cell_flips[f] ^= True
