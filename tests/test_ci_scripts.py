"""What the scripts of `.ci/` name is there: a leg that names a file of yesterday fails only where it is run."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = sorted(path for path in (ROOT / ".ci").iterdir() if path.is_file())
TEST = re.compile(r"(?<![\w/])(tests/[\w/]*)(\.py)?(?:::(\w+))?")


def named_tests(text):
    return [(path + suffix, function) for path, suffix, function in TEST.findall(text)]


def test_names_are_found():
    text = 'pytest tests/core "tests/a/test_b.py::test_c[$size-25]" not/tests/x.py'
    assert named_tests(text) == [("tests/core", ""), ("tests/a/test_b.py", "test_c")]
    assert sum(len(named_tests(path.read_text(encoding="utf-8"))) for path in SCRIPTS) > 15


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_tests_that_a_script_names_exist(script):
    for name, function in named_tests(script.read_text(encoding="utf-8")):
        path = ROOT / name
        assert path.exists(), name
        if function:
            assert f"def {function}(" in path.read_text(encoding="utf-8"), f"{name}::{function}"


def test_legs_that_run_names_exist():
    legs = re.search(r"VOXKERNEL_CI_LEGS-([\w ]+)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))
    assert legs is not None
    assert set(legs[1].split()) - {"site"} <= {path.name for path in SCRIPTS}
