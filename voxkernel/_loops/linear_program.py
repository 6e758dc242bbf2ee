"""Deepest point of a working set of half-spaces by a dual simplex, and passes over all of them."""

import numpy as np
from numba import njit

from voxkernel._loops import NUMBA_CACHE

N_BINS = 6 * 8 * 8
_STALLED = 12


@njit(cache=NUMBA_CACHE, nogil=True)
def _solve4(matrix, right):
    """Solve a 4 x 4 system in place by elimination with row pivoting; False when singular."""
    for k in range(4):
        pivot = k
        for i in range(k + 1, 4):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if abs(matrix[pivot, k]) < 1e-14:
            return False
        if pivot != k:
            for j in range(k, 4):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, 4):
            f = matrix[i, k] / matrix[k, k]
            if f != 0.0:
                for j in range(k + 1, 4):
                    matrix[i, j] -= f * matrix[k, j]
                right[i] -= f * right[k]
    for k in range(3, -1, -1):
        for j in range(k + 1, 4):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
    return True


@njit(cache=NUMBA_CACHE, nogil=True)
def _row(index, normals, offsets, rows, box, cap, out):
    """Write constraint `index` as (n, tau) into out and return its right-hand side.

    Rows 0..5 are the box, row 6 caps t, the others are half-spaces of the working set.
    """
    for k in range(4):
        out[k] = 0.0
    if index < 6:
        out[index >> 1] = 1.0 if index & 1 else -1.0
        return box
    if index == 6:
        out[3] = 1.0
        return cap
    i = rows[index - 7]
    out[0] = normals[i, 0]
    out[1] = normals[i, 1]
    out[2] = normals[i, 2]
    out[3] = 1.0
    return offsets[i]


@njit(cache=NUMBA_CACHE, nogil=True)
def deepest_point(normals, offsets, rows, n_rows, box, basis, multipliers, point, tolerance, max_steps):
    """Maximise t with n . x + t <= d over the working set, |x|_inf <= box, t <= 2 box.

    `basis` holds four constraint numbers (see `_row`) and is used as the start when it is dual
    feasible; otherwise the start is the corner of the box. Fills basis, multipliers and
    point = (x, t). Returns the number of steps, negative when the steps ran out.
    """
    cap = 2.0 * box
    matrix = np.empty((4, 4))
    right = np.empty(4)
    row = np.empty(4)
    solution = np.empty(4)
    started = True
    for j in range(4):
        right[j] = 1.0 if j == 3 else 0.0
        _row(basis[j], normals, offsets, rows, box, cap, row)
        for k in range(4):
            matrix[k, j] = row[k]
    if not _solve4(matrix, right):
        started = False
    else:
        for j in range(4):
            if right[j] < 0.0:
                started = False
    if not started:
        for j in range(3):
            basis[j] = 2 * j + 1
        basis[3] = 6
    stalled = 0
    lowest = np.inf
    for step in range(max_steps):
        for j in range(4):
            right[j] = 1.0 if j == 3 else 0.0
        for j in range(4):
            solution[j] = _row(basis[j], normals, offsets, rows, box, cap, row)
            for k in range(4):
                matrix[k, j] = row[k]
        if not _solve4(matrix, right):
            return -1 - step
        for j in range(4):
            multipliers[j] = max(right[j], 0.0)
            _row(basis[j], normals, offsets, rows, box, cap, row)
            for k in range(4):
                matrix[j, k] = row[k]
        if not _solve4(matrix, solution):
            return -1 - step
        for k in range(4):
            point[k] = solution[k]
        # Parallel faces leave multipliers zero and t as it is: the lowest numbers first (Bland) cannot cycle.
        stalled = 0 if point[3] < lowest else stalled + 1
        lowest = min(lowest, point[3])
        worst = tolerance
        entering = -1
        for k in range(3):
            if point[k] - box > worst:
                worst = point[k] - box
                entering = 2 * k + 1
            if -point[k] - box > worst:
                worst = -point[k] - box
                entering = 2 * k
        if point[3] - cap > worst:
            worst = point[3] - cap
            entering = 6
        x, y, z, t = point[0], point[1], point[2], point[3]
        for w in range(n_rows):
            i = rows[w]
            violation = normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z + t - offsets[i]
            if violation > worst:
                worst = violation
                entering = 7 + w
                if stalled > _STALLED:
                    break
        if entering < 0:
            return step
        for j in range(4):
            _row(basis[j], normals, offsets, rows, box, cap, row)
            for k in range(4):
                matrix[k, j] = row[k]
        _row(entering, normals, offsets, rows, box, cap, right)
        if not _solve4(matrix, right):
            return -1 - step
        leaving = -1
        ratio = np.inf
        for j in range(4):
            if right[j] > 1e-11:
                quotient = multipliers[j] / right[j] if multipliers[j] > 1e-13 else 0.0
                if quotient < ratio or (quotient == ratio and basis[j] < basis[leaving]):
                    ratio = quotient
                    leaving = j
        if leaving < 0:
            return -1 - step
        basis[leaving] = entering
    return -1 - max_steps


@njit(cache=NUMBA_CACHE, nogil=True)
def _bin(nx, ny, nz):
    """Direction bin of a normal: a face of the cube and a cell of its 8 x 8 grid."""
    ax, ay, az = abs(nx), abs(ny), abs(nz)
    if ax >= ay and ax >= az:
        face = 0 if nx > 0 else 1
        u, v, m = ny, nz, ax
    elif ay >= az:
        face = 2 if ny > 0 else 3
        u, v, m = nx, nz, ay
    else:
        face = 4 if nz > 0 else 5
        u, v, m = nx, ny, az
    p = int((u / m + 1.0) * 3.9999)
    q = int((v / m + 1.0) * 3.9999)
    return (face * 8 + p) * 8 + q


@njit(cache=NUMBA_CACHE, nogil=True)
def tightest_by_direction(normals, offsets, errors, point, limit, ids, slacks):
    """One pass: the smallest slack d - n . x, the least certain one, and the tightest plane of each direction bin.

    Planes with slack >= limit are left out of the bins. `ids` is -1 where a bin is empty.
    Returns (smallest slack, smallest slack minus its error bound, its plane).
    """
    x, y, z = point[0], point[1], point[2]
    size = np.sqrt(x * x + y * y + z * z) + 1.0
    ids[:] = -1
    slacks[:] = np.inf
    smallest = np.inf
    certain = np.inf
    where = -1
    for i in range(offsets.shape[0]):
        slack = offsets[i] - (normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z)
        if slack < smallest:
            smallest = slack
            where = i
        safe = slack - errors[i] * size
        if safe < certain:
            certain = safe
        if slack < limit:
            b = _bin(normals[i, 0], normals[i, 1], normals[i, 2])
            if slack < slacks[b]:
                slacks[b] = slack
                ids[b] = i
    return smallest, certain, where


@njit(cache=NUMBA_CACHE, nogil=True)
def plane_signs(normals, offsets, errors, point, slack_error, undecided):
    """One pass: list the planes whose sign at a point is not certainly negative (inside).

    `slack_error` is a bound on the distance between `point` and the exact point meant.
    Returns how many were listed in `undecided`.
    """
    x, y, z = point[0], point[1], point[2]
    size = np.sqrt(x * x + y * y + z * z) + 1.0
    count = 0
    for i in range(offsets.shape[0]):
        value = normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z - offsets[i]
        if value >= -(errors[i] * size + slack_error):
            undecided[count] = i
            count += 1
    return count
