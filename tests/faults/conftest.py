"""Starts the fuzzing before the first test, and asks for its results behind the last."""

import sys

import pytest

if sys.platform == "linux":
    from fuzz_beside import Fuzzing

    RUNNING = pytest.StashKey[Fuzzing]()


def is_of_fuzzing(item):
    return item.path.name == "test_fuzz.py"


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    items.sort(key=is_of_fuzzing)


def pytest_collection_finish(session):
    wanted = {"some": [], "many": []}
    for item in session.items:
        if is_of_fuzzing(item) and hasattr(item, "callspec") and item.get_closest_marker("skip") is None:
            params = item.callspec.params
            if "amount" in params:
                wanted[params["amount"]].append(params["name"])
    if sys.platform == "linux" and any(wanted.values()) and not session.config.option.collectonly:
        session.config.stash[RUNNING] = Fuzzing(wanted)


def pytest_unconfigure(config):
    if sys.platform == "linux" and RUNNING in config.stash:
        config.stash[RUNNING].stop()


@pytest.fixture
def fuzzing(request):
    return request.config.stash[RUNNING]
