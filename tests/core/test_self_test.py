"""A core whose compiler does not keep to IEEE arithmetic refuses to be imported."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import voxkernel

SOURCES = Path(voxkernel.__file__).parent / "_core"


def build(folder, *flags):
    """Build the core with a compiler that has the last word about its flags."""
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None or shutil.which("cmake") is None or shutil.which("ninja") is None or os.name == "nt":
        pytest.skip("needs cmake, ninja and g++ or clang++")
    pytest.importorskip("nanobind", reason="needs nanobind")
    wrapper = folder / "compiler"
    wrapper.write_text(f'#!/bin/sh\nexec {compiler} "$@" {" ".join(flags)}\n', encoding="utf-8")
    wrapper.chmod(wrapper.stat().st_mode | stat.S_IXUSR)
    target = folder / "build"
    options = [f"-DCMAKE_CXX_COMPILER={wrapper}", f"-DPython_EXECUTABLE={sys.executable}"]
    configure = ["cmake", "-S", str(SOURCES), "-B", str(target), "-G", "Ninja", *options]
    subprocess.run(configure, check=True, capture_output=True, timeout=300)
    # The target itself: its stub cannot be made where the import fails.
    subprocess.run(["cmake", "--build", str(target), "-t", "_core"], check=True, capture_output=True, timeout=900)
    return target


def import_core(folder):
    code = "import sys; sys.path.insert(0, sys.argv[1]); import _core"
    return subprocess.run(
        [sys.executable, "-c", code, str(folder)], capture_output=True, text=True, timeout=120, cwd=folder
    )


def machine_has_fma():
    info = Path("/proc/cpuinfo")
    return info.exists() and " fma " in info.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flags", "fault"),
    [
        (("-O1", "-ffast-math"), "reorders sums"),
        (("-O2", "-mfma", "-ffp-contract=fast"), "contracts products and sums"),
        (("-O1", "-ffinite-math-only"), "knows neither infinity nor NaN"),
    ],
)
def test_a_build_with_loose_arithmetic_is_refused(tmp_path, flags, fault):
    if "-mfma" in flags and not machine_has_fma():
        pytest.skip("needs an x86-64 processor with fused multiply-add")
    found = import_core(build(tmp_path, *flags))
    assert found.returncode == 1
    last = found.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: voxkernel._core was built by a compiler that breaks exact arithmetic (it ")
    assert fault in last
    assert last.endswith("; build it without fast-math and contraction")


@pytest.mark.slow
def test_a_build_without_loose_arithmetic_is_imported(tmp_path):
    found = import_core(build(tmp_path, "-O1"))
    assert (found.returncode, found.stderr) == (0, "")
