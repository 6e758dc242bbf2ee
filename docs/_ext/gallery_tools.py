"""What the gallery needs: pictures that a script writes as files, the order of pages, a picture first on each."""

import os
import re
from pathlib import Path
from typing import Any

from sphinx.errors import ExtensionError
from sphinx_gallery.scrapers import figure_rst

_FIRST_IMAGE = re.compile(r"\n\.\. image-sg:: .*\n(?:  +:.*\n)+")
_BELOW_TITLE = re.compile(r"\n(=+)\n(?:\n|\Z)")


def png_scraper(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any], **_: Any) -> str:
    """Show the PNG files a block has written beside its script, keep its HTML: the calls are those of a user."""
    folder = Path(block_vars["src_file"]).parent
    shown: list[str] = []
    for file in sorted(folder.glob("*.png"), key=lambda f: f.stat().st_mtime_ns):
        target = next(block_vars["image_path_iterator"])
        os.replace(file, target)
        shown.append(target)
    for file in sorted(folder.glob("*.html")):
        os.replace(file, Path(gallery_conf["src_dir"]) / "made" / "extra" / file.name)
    return figure_rst(shown, gallery_conf["src_dir"]) if shown else ""


def _get_sg_image_scraper() -> Any:
    """Let ``image_scrapers`` name this module."""
    return png_scraper


ORDER = (
    "plot_surface_grid_kernel", "plot_samples", "plot_radial_functions", "plot_three_centres", "plot_registration",
    "plot_depths", "plot_relaxed", "plot_vdb_volume", "plot_failed_star", "plot_domains",
    "plot_bodies", "plot_report", "plot_polyhedral", "plot_benchmarks",
    "plot_real_surface_grid_kernel", "plot_real_kernels", "plot_real_radial_functions", "plot_real_three_centres",
    "plot_real_registration", "plot_real_relaxed", "plot_real_polyhedral",
)  # fmt: skip


class PageOrder:
    """Sort key of the pages of a gallery."""

    def __init__(self, src_dir: str) -> None:
        """Take the folder, which does not matter."""

    def __call__(self, filename: str) -> tuple[int, str]:
        """Give the place in `ORDER`; others follow by name."""
        stem = Path(filename).stem
        return (ORDER.index(stem) if stem in ORDER else len(ORDER), stem)


def picture_first(app: Any, docname: str, source: list[str]) -> None:
    """Move the first picture of a gallery page up, below its title."""
    if not re.match(r"made/(gallery|meshes)/plot_", docname):
        return
    text = source[0]
    image = _FIRST_IMAGE.search(text)
    if image is None:
        raise ExtensionError(f"{docname} has no picture")
    text = text[: image.start()] + "\n" + text[image.end() :]
    title = _BELOW_TITLE.search(text)
    if title is None:
        raise ExtensionError(f"{docname} has no title")
    source[0] = text[: title.end()] + image.group() + "\n" + text[title.end() :]


def setup(app: Any) -> dict[str, bool]:
    """Connect the hook."""
    app.connect("source-read", picture_first)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
