"""Sphinx settings: ``sphinx-build -W -b html docs docs/_build/html``."""

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")

import voxkernel  # noqa: E402

project = "voxkernel"
author = "The voxkernel developers"
copyright = f"2026, {author}"
release = version = voxkernel.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "api_pages",
    "gallery_tools",
    "mathml",
    "notebooks",
]
exclude_patterns = [
    *("_build", "_ext", "gallery", "gallery_data", "notebooks"),
    *("made/**/sg_execution_times.rst", "**/README.*"),
]
default_role = "public-name"
nitpicky = False

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3

autosummary_generate = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

# Real meshes are looked for where the tests look for them; without them their gallery is one page that says so.
DATA = Path(os.environ.get("VOXKERNEL_DATA", HERE.parent.parent / "shared" / "data"))
HAS_DATA = (DATA / "manifest.csv").exists()
if HAS_DATA:
    os.environ["VOXKERNEL_DATA"] = str(DATA)
(HERE / "made" / "extra").mkdir(parents=True, exist_ok=True)
MESHES = HERE / "made" / "meshes"
if not HAS_DATA:
    MESHES.mkdir(parents=True, exist_ok=True)
    for old in MESHES.glob("*.*"):
        old.unlink()
    (MESHES / "index.rst").write_text((HERE / "gallery_data" / "without_data.txt").read_text(encoding="utf-8"))

sphinx_gallery_conf = {
    "examples_dirs": ["gallery", *(["gallery_data"] if HAS_DATA else [])],
    "gallery_dirs": ["made/gallery", *(["made/meshes"] if HAS_DATA else [])],
    "filename_pattern": r"/plot_",
    "ignore_pattern": r"/_",
    "within_subsection_order": "gallery_tools.PageOrder",
    "image_scrapers": ("matplotlib", "gallery_tools"),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
    "write_computation_times": False,
    "min_reported_time": 1e9,
    "capture_repr": (),
    "thumbnail_size": (480, 340),
}

html_theme = "furo"
html_title = f"voxkernel {release}"
html_static_path = ["static"]
html_css_files = ["voxkernel.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sourcelink = False
