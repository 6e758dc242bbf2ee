"""Fixtures every test file shares."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent

settings.register_profile(
    "default", deadline=None, derandomize=bool(os.environ.get("CI")), suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("default")

# A shell starts jobs in the background deaf to Ctrl-C, and the tests of interrupts would wait for ever.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


# The installed package is tested: a child started in the checkout would find the source tree, which has no core.
os.environ["PYTHONSAFEPATH"] = "1"


@pytest.fixture
def rng():
    return np.random.default_rng(20261122)


@pytest.fixture(scope="session")
def data_dir():
    path = Path(os.environ.get("VOXKERNEL_DATA", ROOT.parent / "shared" / "data"))
    if not (path / "manifest.csv").exists():
        pytest.skip(f"real meshes not found at {path}; set VOXKERNEL_DATA")
    return path


@pytest.fixture
def datasets_tools(monkeypatch):
    """The folder of the scripts on the path, as it is when one of them runs."""
    folder = ROOT / "datasets_tools"
    monkeypatch.syspath_prepend(str(folder))
    return folder


def pytest_collection_modifyitems(config, items):
    """Skip what is marked slow unless `-m` asks for it."""
    if "slow" in (config.option.markexpr or ""):
        return
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.skip(reason="long; run with -m slow"))
