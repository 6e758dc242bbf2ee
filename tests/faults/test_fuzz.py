"""Damaged files of every format: read, or refused in one line, in bounded time and memory (`fuzz.py` says how)."""

import os
import re
import subprocess
import sys
from pathlib import Path

import fuzz
import pytest
from fuzz_beside import INPUTS
from fuzz_formats import FORMATS, Format

HERE = Path(__file__).parent
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of a process as Linux has them")


@pytest.mark.parametrize("amount", ["some", pytest.param("many", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files(name, amount, fuzzing):
    state = fuzzing.state(name, amount)
    assert isinstance(state, dict), state
    assert not state["failures"], "\n".join([fuzz.summary(state), *fuzz.lines_of(state)])
    assert state["next"] == INPUTS[amount]
    assert state["accepted"] > 0  # damage that is always seen at once tests nothing
    # There it costs a cell, a fact of a row, or a picture.
    assert state["refused"] > 0 or name in ("cell_folder", "report_rows", "report_view")
    assert state["same"] > 0 or FORMATS[name].same is None


# ---------------------------------------------------------------- the suite finds what it looks for


def act(path):
    """A reader with every fault: what it does stands in the file."""
    import ctypes
    import time
    import warnings

    from voxkernel.errors import MeshReadError

    word = path.read_text().split()[0]
    if word == "die":
        ctypes.string_at(0)
    elif word == "leave":
        os._exit(0)
    elif word == "spin":
        while True:
            pass
    elif word == "sleep":
        time.sleep(1000)
    elif word == "eat":
        bytearray(2**30)
    elif word == "hide":
        try:
            bytearray(2**30)
        except MemoryError as error:
            raise MeshReadError("too large") from error
    elif word == "print":
        os.write(2, b"noise\n")
    elif word == "warn":
        warnings.warn("careful", stacklevel=1)
    elif word == "lines":
        raise MeshReadError("one\ntwo")
    elif word == "refuse":
        raise MeshReadError("no mesh")
    elif word == "wrong":
        raise AssertionError("no mesh, but taken for one")
    elif word == "key":
        raise KeyError("x")
    return ()


@pytest.mark.parametrize(
    ("word", "kind", "match"),
    [
        ("die", "death", "SIGSEGV"),
        ("leave", "death", "exit 0"),
        ("spin", "time", "SIGPROF.*test_fuzz.py"),
        ("sleep", "hang", "SIGKILL"),
        ("eat", "memory", "MemoryError"),
        ("hide", "memory", "too large"),
        ("print", "printed", "noise"),
        ("warn", "warning", "careful"),
        ("lines", "message", "one two"),
        ("wrong", "meaning", "taken for one"),
        ("key", "exception", "KeyError.*test_fuzz.py.* in act"),
        ("refuse", None, ""),
        ("accept", None, ""),
    ],
)
def test_each_kind_of_failure_is_found(word, kind, match, tmp_path, monkeypatch):
    monkeypatch.setitem(FORMATS, "acts", Format(".txt", lambda: [b"accept"], None, act))
    monkeypatch.setattr(fuzz, "HANG", 1.0 if word == "sleep" else 60.0)
    monkeypatch.setattr(fuzz, "SECONDS", 0.3)
    files = [b"accept", word.encode(), b"refuse"]
    found, died, counts = fuzz.in_child("acts", 0, range(3), tmp_path, files)
    if kind is None:
        assert found == []
        assert counts == ([2, 1, 0] if word == "accept" else [1, 2, 0])
        return
    ((number, found_kind, details),) = found
    assert (number, found_kind) == (1, kind)
    assert re.search(match, details)
    assert died == (1 if kind in ("death", "time", "hang") else None)
    assert counts == ([1, 0, 0] if died else [1, 1, 0])


def test_inputs_depend_on_the_seed_and_the_number_alone():
    for name in ("ply_little", "vtu", "npz", "report_rows"):
        one = [fuzz.make_input(name, 3, k)[0] for k in range(20)]
        FORMATS[name].__dict__.pop("seeds", None)
        assert [fuzz.make_input(name, 3, k)[0] for k in reversed(range(20))] == one[::-1]
        assert fuzz.make_input(name, 4, 0)[0] != one[0]


def test_a_run_goes_on_where_it_stopped(tmp_path):
    whole = fuzz.run_format("labels_csv", 1, 90, tmp_path / "a")
    fuzz.run_format("labels_csv", 1, 40, tmp_path / "b")
    parts = fuzz.run_format("labels_csv", 1, 90, tmp_path / "b")
    for key in ("next", "accepted", "refused", "same", "failed"):
        assert parts[key] == whole[key]


# ---------------------------------------------------------------- atheris


@pytest.mark.parametrize("name", ["ply_ascii", "off", "obj", "npz"])
def test_guided_by_coverage(name, tmp_path):
    pytest.importorskip("atheris", reason="atheris is not installed: pip install atheris (Linux)")
    words = [name, f"-artifact_prefix={tmp_path}/", "-runs=1500", "-seed=1", "-timeout=200"]
    done = subprocess.run(
        [sys.executable, str(HERE / "fuzz_atheris.py"), *words], capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stderr[-3000:]
