"""The build backend: scikit-build-core, and PyPI's `ziglang` as the compiler where the machine has none."""

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scikit_build_core import build as scikit
from scikit_build_core.build import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

Settings = dict[str, str | list[str]]
ZIG = "ziglang>=0.13"
COMPILERS = ("c++", "g++", "clang++")
# Zig compiles for the processor it runs on unless told otherwise; pip may carry the wheel to another one. It builds its
# C++ library at the first link, two minutes of work, and once more for each mode: these words give CMake's test of the
# compiler the mode of the module, optimised and stripped, without traps for undefined behaviour.
ZIG_TOOLS = {"c++": "c++ -mcpu=baseline -O3 -s -fno-sanitize=undefined", "ar": "ar", "ranlib": "ranlib"}


def has_compiler() -> bool:
    """Whether CMake will find a C++ compiler; one that was named is taken at its word."""
    if os.environ.get("CXX") or "CMAKE_CXX_COMPILER" in os.environ.get("CMAKE_ARGS", ""):
        return True
    if sys.platform == "win32":
        installer = Path(os.environ.get("ProgramFiles(x86)", "C:/"), "Microsoft Visual Studio/Installer/vswhere.exe")
        if shutil.which("cl") or installer.exists():
            return True
    return any(map(compiles, filter(None, map(shutil.which, COMPILERS))))


def compiles(compiler: str) -> bool:
    """Whether a compiler finds its headers: macOS has a `c++` that only asks for the developer tools."""
    command = [compiler, "-std=c++17", "-x", "c++", "-E", "-"]
    try:
        return subprocess.run(command, input=b"#include <vector>\n", capture_output=True, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


@contextmanager
def compiler(settings: Settings | None, folder: Path | None = None) -> Iterator[Settings]:
    """Settings that let CMake use zig where there is no other compiler; its scripts are in `folder` if that must last.

    Zig's own cache (a C++ library, compiled once) goes with the scripts, so that nothing is left in the home folder.
    """
    chosen = dict(settings or {})
    if has_compiler():
        yield chosen
        return
    sys.stderr.write("voxkernel: no C++ compiler found, building with ziglang\n")
    before = dict(os.environ)
    with tempfile.TemporaryDirectory(prefix="voxkernel-zig-") as temporary:
        tools = {name: write_script(folder or Path(temporary), name, call) for name, call in ZIG_TOOLS.items()}
        os.environ["CXX"] = str(tools["c++"])
        os.environ.setdefault("ZIG_GLOBAL_CACHE_DIR", str(Path(temporary, "cache")))
        if sys.platform == "win32":
            os.environ.setdefault("CMAKE_GENERATOR", "Ninja")
        try:
            yield {
                "cmake.define.CMAKE_AR": str(tools["ar"]),
                "cmake.define.CMAKE_RANLIB": str(tools["ranlib"]),
                **chosen,
            }
        finally:
            os.environ.clear()
            os.environ.update(before)


def write_script(folder: Path, name: str, call: str) -> Path:
    """Write a script that calls a tool of zig: CMake wants a file it can run."""
    folder.mkdir(parents=True, exist_ok=True)
    if sys.platform == "win32":
        path, text = folder / f"zig-{name}.cmd", f'@"{sys.executable}" -m ziglang {call} %*\n'
    else:
        path, text = folder / f"zig-{name}", f'#!/bin/sh\nexec "{sys.executable}" -m ziglang {call} "$@"\n'
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)
    return path


def zig_requirements() -> list[str]:
    """What to install for a build without a compiler."""
    if has_compiler():
        return []
    return [ZIG, "ninja"] if sys.platform == "win32" else [ZIG]


def get_requires_for_build_wheel(config_settings: Settings | None = None) -> list[str]:
    """Return scikit-build-core's requirements and perhaps a compiler."""
    return [*scikit.get_requires_for_build_wheel(config_settings), *zig_requirements()]


def get_requires_for_build_editable(config_settings: Settings | None = None) -> list[str]:
    """Return scikit-build-core's requirements and perhaps a compiler."""
    return [*scikit.get_requires_for_build_editable(config_settings), *zig_requirements()]


def build_wheel(
    wheel_directory: str, config_settings: Settings | None = None, metadata_directory: str | None = None
) -> str:
    """Build with the compiler of the machine, or zig; once, where `VOXKERNEL_WHEELS` names a folder that keeps it.

    That is for one source that is installed several times in a row; nothing looks whether it has changed.
    """
    kept = kept_wheels()
    if kept is not None and not config_settings:
        for wheel in sorted(kept.glob("*.whl")):
            shutil.copy2(wheel, wheel_directory)
            return wheel.name
    with compiler(config_settings) as settings:
        name = scikit.build_wheel(wheel_directory, settings, metadata_directory)
    if kept is not None and not config_settings:
        kept.mkdir(parents=True, exist_ok=True)
        shutil.copy2(Path(wheel_directory, name), kept)
    return name


def kept_wheels() -> Path | None:
    """Where wheels of this Python are kept, if anywhere."""
    folder = os.environ.get("VOXKERNEL_WHEELS")
    return Path(folder, str(sys.implementation.cache_tag)) if folder else None


def build_editable(
    wheel_directory: str, config_settings: Settings | None = None, metadata_directory: str | None = None
) -> str:
    """Build an editable install; it rebuilds on import where the tools of the build stay installed."""
    with compiler(config_settings, Path("build/zig").resolve()) as settings:
        if not is_isolated():
            settings = {"editable.rebuild": "true", "build-dir": "build/editable/{wheel_tag}", **settings}
        return scikit.build_editable(wheel_directory, settings, metadata_directory)


def is_isolated() -> bool:
    """Whether the tools of the build are in a folder of their own, which pip removes after it."""
    spec = importlib.util.find_spec("nanobind")
    home = Path(sysconfig.get_path("purelib")).resolve()
    return spec is None or spec.origin is None or home not in Path(spec.origin).resolve().parents
