"""The notebooks of the docs run from their beginning, lie in the repository without outputs, and become pages."""

import os
import re
from pathlib import Path

import pytest
from docs_extensions import extension

import voxkernel

nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
DOCS = Path(__file__).resolve().parent.parent / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def notebooks():
    with extension("notebooks") as module:
        yield module


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_holds_no_outputs_and_is_in_the_contents(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code)
    assert f"made/notebooks/{path.stem}\n" in (DOCS / "index.md").read_text(encoding="utf-8")


@pytest.mark.slow  # the build of the site runs them always
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_runs_and_becomes_a_page(path, notebooks, tmp_path, monkeypatch):
    pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    above = str(Path(voxkernel.__file__).parents[1])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([above, os.environ.get("PYTHONPATH", "")]))
    done = notebooks.executed(path)
    page = notebooks.page_of(done, tmp_path, path.stem)
    assert page.startswith("# ")
    tables = re.findall(r'<table class="voxkernel"><caption[^>]*><b>(\w+)</b>', page)
    assert {"TriangleMesh", "KernelPolytope", "Starshapeness", "Certificate", "StarCenter", "KernelGrid"} <= set(tables)
    assert "Certificate(kind=" in page
    assert [file.suffix for file in tmp_path.iterdir()] == [".png"]
    assert len(page) < 200_000
