"""Notebooks of ``docs/notebooks``, run and written as pages: they lie in the repository without outputs."""

import base64
import os
import re
from pathlib import Path
from typing import Any

__all__ = ["executed", "page_of", "setup"]

_SECONDS = 300  # for one cell


def executed(path: Path) -> Any:
    """Run a notebook from its beginning; the first error ends it, with the cell and the traceback."""
    import nbclient
    import nbformat

    notebook: Any = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=_SECONDS, kernel_name="python3")
    os.environ["OPEN3D_DISABLE_WEB_VISUALIZER"] = "true"  # it would tell the page that it found a notebook
    client.execute(cwd=str(path.parent))
    return notebook


def page_of(notebook: Any, images: Path, stem: str) -> str:
    """Write a notebook that was run as MyST Markdown; pictures go to the folder as files."""
    parts: list[str] = []
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                name = f"{stem}_{number}.png"
                (images / name).write_bytes(base64.b64decode(data["image/png"]))
                parts.append(f"![what the cell shows]({name})")
            elif "text/html" in data:
                parts.append(f"```{{raw}} html\n{data['text/html']}\n```")
            else:
                words = output.get("text") or data.get("text/plain", "")
                parts.append(f"```text\n{words.rstrip()}\n```")
    return "\n\n".join(parts) + "\n"


def write_pages(source: Path, target: Path) -> None:
    """Run every notebook of a folder and write its page."""
    target.mkdir(parents=True, exist_ok=True)
    for path in sorted(source.glob("*.ipynb")):
        text = page_of(executed(path), target, path.stem)
        link = f"Download: {{download}}`{path.name} <../../notebooks/{path.name}>`.\n"
        (target / f"{path.stem}.md").write_text(re.sub(r"\A(# .*\n)", rf"\1\n{link}", text), encoding="utf-8")


def setup(app: Any) -> dict[str, Any]:
    """Before the pages are read."""
    here = Path(__file__).resolve().parent.parent
    app.connect("builder-inited", lambda _: write_pages(here / "notebooks", here / "made" / "notebooks"))
    return {"parallel_read_safe": True}
