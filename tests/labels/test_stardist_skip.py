"""What the tests beside StarDist say where they are skipped: the package that is missing, also one that it needs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ORACLE = Path(__file__).with_name("test_stardist_oracle.py")


@pytest.mark.parametrize("missing", ["stardist", "no_such_package"])
def test_the_reason_names_what_is_missing(tmp_path, missing):
    inner = tmp_path / "stardist"
    inner.mkdir()
    (inner / "__init__.py").write_text(f"raise ModuleNotFoundError(\"No module named '{missing}'\")")
    path = os.pathsep.join(filter(None, [str(tmp_path), str(ORACLE.parents[1]), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, str(ORACLE)], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path},
        check=False,
    )  # fmt: skip
    assert f"StarDist cannot be imported: No module named '{missing}' (pip install --no-deps stardist" in done.stderr
    assert "pip install tqdm scikit-image numba six" in done.stderr
