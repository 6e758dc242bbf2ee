"""The build backend chooses zig only where there is no compiler; nothing is built here."""

import importlib.util
import os
import stat
import sys
from pathlib import Path

import pytest

pytest.importorskip("scikit_build_core")
SOURCE = Path(__file__).resolve().parents[2] / "voxkernel/_core/build_backend.py"
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the scripts here are for a POSIX shell")


@pytest.fixture
def backend(monkeypatch):
    spec = importlib.util.spec_from_file_location("build_backend", SOURCE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name in ("CXX", "CMAKE_ARGS"):
        monkeypatch.delenv(name, raising=False)
    return module


def program(folder, name, code):
    path = folder / name
    path.write_text(f"#!/bin/sh\nexit {code}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.mark.parametrize("name", ["c++", "g++", "clang++"])
def test_a_compiler_that_works_is_used(backend, monkeypatch, tmp_path, name):
    program(tmp_path, name, 0)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert backend.zig_requirements() == []
    with backend.compiler({"build-dir": "b"}) as settings:
        assert settings == {"build-dir": "b"}
        assert "CXX" not in os.environ


def test_zig_where_there_is_none_or_a_stub(backend, monkeypatch, tmp_path):
    program(tmp_path, "c++", 1)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert [r.partition(">")[0] for r in backend.zig_requirements()] == ["ziglang"]
    with backend.compiler({"cmake.define.CMAKE_AR": "mine"}) as settings:
        script = Path(os.environ["CXX"])
        words = "c++ -mcpu=baseline -O3 -s -fno-sanitize=undefined"
        assert f'"{sys.executable}" -m ziglang {words} "$@"' in script.read_text()
        assert os.access(script, os.X_OK)
        assert settings["cmake.define.CMAKE_AR"] == "mine"
        assert Path(settings["cmake.define.CMAKE_RANLIB"]).exists()
    assert not script.exists()
    assert "CXX" not in os.environ


def test_scripts_of_an_editable_install_stay(backend, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", "")
    with backend.compiler(None, tmp_path / "zig"):
        pass
    assert sorted(p.name for p in (tmp_path / "zig").iterdir()) == ["zig-ar", "zig-c++", "zig-ranlib"]


def test_a_compiler_that_is_named_is_believed(backend, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert backend.zig_requirements() != []
    monkeypatch.setenv("CXX", "my-compiler")
    assert backend.zig_requirements() == []
    monkeypatch.delenv("CXX")
    monkeypatch.setenv("CMAKE_ARGS", "-DCMAKE_CXX_COMPILER=/opt/c++")
    assert backend.zig_requirements() == []


def test_a_kept_wheel_is_not_built_again(backend, monkeypatch, tmp_path):
    built = []

    def build(folder, settings, metadata):
        built.append(settings)
        Path(folder, "voxkernel-1-py3-none-any.whl").write_bytes(b"wheel")
        return "voxkernel-1-py3-none-any.whl"

    monkeypatch.setattr(backend.scikit, "build_wheel", build)
    monkeypatch.setattr(backend, "has_compiler", lambda: True)
    for folder in ("one", "two", "three", "four"):
        (tmp_path / folder).mkdir()
    backend.build_wheel(str(tmp_path / "one"))
    monkeypatch.setenv("VOXKERNEL_WHEELS", str(tmp_path / "kept"))
    backend.build_wheel(str(tmp_path / "two"))
    assert len(built) == 2
    name = backend.build_wheel(str(tmp_path / "three"))
    assert len(built) == 2
    assert (tmp_path / "three" / name).read_bytes() == b"wheel"
    backend.build_wheel(str(tmp_path / "four"), {"cmake.define.VOXKERNEL_CHECKED": "ON"})
    assert len(built) == 3
