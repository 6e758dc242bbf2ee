"""A surface and its kernels in, a window in the browser out: a live one, or a page with the same slider."""

from voxkernel.view.slider_page import slider_page
from voxkernel.view.viewer import Viewer, open_viewer

__all__ = [
    "Viewer",
    "open_viewer",
    "slider_page",
]
