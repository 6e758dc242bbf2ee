"""Sorting inside compiled loops.

`np.sort` and `np.argsort` must not be used in cached functions: Numba builds both from inner functions
of the same names, told apart by a counter that starts anew in every process, so that two functions
cached by two processes can be linked to each other's halves.
"""

from numba import njit

from voxkernel._loops import NUMBA_CACHE

_INSERTION = 32


@njit(cache=NUMBA_CACHE, nogil=True)
def sort_range(keys, values, low, high):
    """Sort keys[low:high] in place, smallest first, and carry `values` along; equal keys in any order.

    `values` may be `keys` itself. Insertion for short ranges, a heap for long ones: never quadratic, no memory.
    """
    n = high - low
    if n <= _INSERTION:
        for j in range(low + 1, high):
            key = keys[j]
            value = values[j]
            p = j - 1
            while p >= low and keys[p] > key:
                keys[p + 1] = keys[p]
                values[p + 1] = values[p]
                p -= 1
            keys[p + 1] = key
            values[p + 1] = value
        return
    for root in range(n // 2 - 1, -1, -1):
        _sink(keys, values, low, root, n, keys[low + root], values[low + root])
    for end in range(n - 1, 0, -1):
        key = keys[low + end]
        value = values[low + end]
        keys[low + end] = keys[low]
        values[low + end] = values[low]
        _sink(keys, values, low, 0, end, key, value)


@njit(cache=NUMBA_CACHE, nogil=True)
def sort_keys(keys, low, high):
    """Sort keys[low:high] in place, smallest first."""
    if high - low > _INSERTION:
        sort_range(keys, keys, low, high)
        return
    for j in range(low + 1, high):
        key = keys[j]
        p = j - 1
        while p >= low and keys[p] > key:
            keys[p + 1] = keys[p]
            p -= 1
        keys[p + 1] = key


@njit(cache=NUMBA_CACHE, nogil=True)
def _sink(keys, values, low, root, n, key, value):
    """Put an element in at `root` of the heap keys[low:low + n] and let it sink to its place."""
    while True:
        child = 2 * root + 1
        if child >= n:
            break
        if child + 1 < n and keys[low + child + 1] > keys[low + child]:
            child += 1
        if keys[low + child] <= key:
            break
        keys[low + root] = keys[low + child]
        values[low + root] = values[low + child]
        root = child
    keys[low + root] = key
    values[low + root] = value


@njit(cache=NUMBA_CACHE, nogil=True)
def find_in_range(keys, low, high, key):
    """Position of a key in the sorted keys[low:high], -1 where it is not there."""
    first = low
    last = high
    while first < last:
        middle = (first + last) >> 1
        if keys[middle] < key:
            first = middle + 1
        else:
            last = middle
    if first < high and keys[first] == key:
        return first
    return -1
