"""Without the compiled core, or with a broken one, the import says in one line how to install."""

import subprocess
import sys
from pathlib import Path

import pytest

import voxkernel
from voxkernel import _core

PACKAGE = Path(voxkernel.__file__).parent


def copy_without_core(folder):
    """A package of links to this one, without the extension module."""
    package = folder / "voxkernel"
    package.mkdir()
    for path in PACKAGE.iterdir():
        if not (path.name.startswith("_core.") or path.name == "__pycache__"):
            (package / path.name).symlink_to(path)
    return package


def imported(folder):
    # Without site-packages: an editable install would find its own module, and NumPy is not reached.
    code = f"import sys; sys.path.insert(0, {str(folder)!r}); import voxkernel"
    return subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("has_sources", [True, False])
def test_missing(tmp_path, has_sources):
    package = copy_without_core(tmp_path)
    (package / "_core").unlink(missing_ok=True)
    (package / "_core_check.py").unlink()
    (package / "_core_check.py").write_bytes((PACKAGE / "_core_check.py").read_bytes())
    if has_sources:  # a folder without code is an empty package to Python
        (package / "_core").mkdir()
        (package / "_core" / "CMakeLists.txt").touch()
    done = imported(tmp_path)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: the compiled core `voxkernel._core` cannot be loaded (")
    advice = f"'{package}' is the source tree: start Python in another folder" if has_sources else "`pip install .`"
    assert advice in last


def test_broken(tmp_path):
    module = copy_without_core(tmp_path) / Path(_core.__file__).name
    module.write_bytes(b"not a library")
    done = imported(tmp_path)
    assert done.returncode == 1
    assert "ImportError: the compiled core `voxkernel._core` cannot be loaded (" in done.stderr
    assert str(module) in done.stderr.strip().splitlines()[-1]
