"""One polyhedral cell out of many, in its own numbers and its own frame."""

import math

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

LARGEST, _SMALLEST = 2.0**150, 2.0**-150


@njit(cache=NUMBA_CACHE, nogil=True)
def largest_sizes(face_offsets, cell_offsets, cell_faces, first, last):
    """Most faces and most corners of any cell."""
    most_faces = 0
    most_corners = 0
    for cell in range(first, last):
        corners = 0
        for at in range(cell_offsets[cell], cell_offsets[cell + 1]):
            f = cell_faces[at]
            corners += face_offsets[f + 1] - face_offsets[f]
        most_faces = max(most_faces, cell_offsets[cell + 1] - cell_offsets[cell])
        most_corners = max(most_corners, corners)
    return most_faces, most_corners


@njit(cache=NUMBA_CACHE, nogil=True)
def gather(vertices, face_offsets, face_vertices, cell_faces, cell_flips, low, high, number, used, raw, ring, start):
    """Copy one cell with its own vertex numbers, faces turned as they are used; the number of vertices, -1 if bad."""
    n_vertices = 0
    n = 0
    smallest = 1 << 60
    for at in range(low, high):
        f = cell_faces[at]
        begin, end = face_offsets[f], face_offsets[f + 1]
        start[at - low] = n
        smallest = min(smallest, end - begin)
        for k in range(end - begin):
            v = face_vertices[end - 1 - k] if cell_flips[at] else face_vertices[begin + k]
            if number[v] < 0:
                number[v] = n_vertices
                used[n_vertices] = v
                for axis in range(3):
                    raw[n_vertices, axis] = vertices[v, axis]
                n_vertices += 1
            ring[n] = number[v]
            n += 1
    start[high - low] = n
    for v in range(n_vertices):
        number[used[v]] = -1
    return n_vertices if smallest >= 3 else -1


@njit(cache=NUMBA_CACHE, nogil=True)
def local_frame(raw, n_vertices, origin):
    """Fill the middle of the bounding box; return a power of two that covers the cell from there, 0 if not finite."""
    square = 0.0
    largest = 0.0
    for axis in range(3):
        low = raw[0, axis]
        high = low
        for v in range(n_vertices):
            value = raw[v, axis]
            if not math.isfinite(value):
                return 0.0, np.inf
            low = min(low, value)
            high = max(high, value)
            largest = max(largest, abs(value))
        origin[axis] = low + 0.5 * (high - low)
        half = max(high - origin[axis], origin[axis] - low)
        square += half * half
    reach = np.sqrt(square) * (1.0 + 1e-12)
    if not _SMALLEST < reach < LARGEST:
        return -1.0, largest
    _, exponent = math.frexp(reach)
    return math.ldexp(1.0, exponent), largest
