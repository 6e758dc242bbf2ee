"""Sorting inside compiled loops."""

import re
from pathlib import Path

import numpy as np
import pytest

import voxkernel
from voxkernel._loops.sorting import find_in_range, sort_keys, sort_range


@pytest.mark.parametrize("n", [0, 1, 2, 31, 32, 33, 34, 100, 1000])
@pytest.mark.parametrize("n_values", [2, 20, 10**9])
def test_ranges_are_sorted_and_nothing_else(n, n_values, rng):
    keys = rng.integers(0, n_values, n + 9)
    before = keys.copy()
    values = np.arange(len(keys))
    sort_range(keys, values, 4, 4 + n)
    assert (keys[4 : 4 + n] == np.sort(before[4 : 4 + n])).all()
    assert (before[values] == keys).all()
    assert sorted(values) == list(range(len(keys)))
    outside = np.r_[0:4, 4 + n : len(keys)]
    assert (values[outside] == outside).all()
    alone = before.copy()
    sort_keys(alone, 4, 4 + n)
    assert (alone == keys).all()


def test_every_key_is_found_and_no_other(rng):
    keys = np.unique(rng.integers(0, 300, 100))
    for key in range(-1, 302):
        found = find_in_range(keys, 3, len(keys) - 2, key)
        here = np.flatnonzero(keys[3:-2] == key) + 3
        assert found == (here[0] if len(here) else -1)


def test_cached_loops_leave_the_sorts_of_numba_alone():
    """Numba names their inner functions by a counter of the process that compiled them.

    Two functions cached by two processes then share names, and one is linked to the other's halves:
    rings of more than 15 dual points came out wrong, in some processes only.
    """
    folder = Path(voxkernel.__file__).parent / "_loops"
    for file in folder.glob("*.py"):
        code = re.sub(r'""".*?"""', "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"\.(sort|argsort|searchsorted|unique|partition|argpartition|median)\(", code), file.name
