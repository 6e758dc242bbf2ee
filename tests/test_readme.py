"""The README's own words are run."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import voxkernel

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
PYTHON = [text for language, text in BLOCKS if language == "python"]
SHELL = [text.strip().splitlines() for language, text in BLOCKS if language == "sh"]


def test_set_up_is_two_commands_and_ci_runs_them():
    assert SHELL[0] == ['pip install ".[all]" && voxkernel demo', 'pip install ".[test]" && pytest']
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for part in ('\npip install ".[all]" && voxkernel demo', '\npip install ".[test]"\n', "\npytest "):
        assert part in ci


@pytest.mark.parametrize("code", PYTHON)
def test_python_block_runs(code, tmp_path):
    command = [sys.executable, "-W", "error", "-c", code]
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1])}
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=env)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("3 0.559")
    assert lines[1] == "True"
    assert lines[2].startswith("star-shaped 0.0989")
    assert lines[3].endswith("[ True]")


def test_commands_run(tmp_path, monkeypatch):
    # The demo is not repeated here: its folder is stood in for by one of its shapes.
    from voxkernel.cli.main import main
    from voxkernel.demo_shapes import urchin

    monkeypatch.chdir(tmp_path)
    (tmp_path / "voxkernel-demo").mkdir()
    urchin(subdivisions=3).write("voxkernel-demo/urchin.ply")
    for line in SHELL[1]:
        words = shlex.split(line)
        assert words[0] == "voxkernel"
        words = [str(p) for w in words[1:] for p in (sorted(Path().glob(w)) if "*" in w else [w])]
        assert main([*words, "--quiet"]) == 0, line
    assert (tmp_path / "kernel.ply").stat().st_size > 0
    assert (tmp_path / "kernel.png").stat().st_size > 0


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`(?:voxkernel\.)?([a-z_]+(?:\.[a-z_]+)?)`", README))))
def test_names_in_the_text_exist(name):
    import importlib

    words = {"kernel", "score", "sphere", "info", "demo", "ruff", "pyright", "verify"}
    if name in words or hasattr(voxkernel, name):
        return
    module, _, attribute = name.partition(".")
    loaded = importlib.import_module(f"voxkernel.{module}")
    assert not attribute or hasattr(loaded, attribute)


def test_fits_two_screens():
    assert len(README.splitlines()) <= 90
