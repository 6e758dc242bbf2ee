"""The examples in the docstrings are run."""

import doctest
import pkgutil
from importlib import import_module

import pytest

import voxkernel

MODULES = [m.name for m in pkgutil.walk_packages(voxkernel.__path__, "voxkernel.") if m.name != "voxkernel._core"]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(import_module(name), optionflags=flags).failed == 0
