"""What pictures share: the suffix check, four parts under a heading as PNG, and a plotly figure as a page."""

from __future__ import annotations

import html
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_integers, as_path
from voxkernel._extras import optional
from voxkernel._palette import INK, PALE
from voxkernel.pictures.furniture import add_furniture

__all__ = ["Draw", "check_picture", "check_size", "drawn", "heading", "save_page", "write_parts"]

_HEAD, _TOP, _FOOT = 120, 40, 90
_MOST = 4096  # pixels each way: of 8192 each way it takes 9 GB
_LINE = 150  # letters in a line of a caption

Draw = Callable[[Any, Any], None]


def check_picture(path: str | os.PathLike[str]) -> tuple[Path, str]:
    """Give the path and its suffix, which says what to write."""
    target = as_path("path", path)
    kind = target.suffix.lower()
    if kind not in (".png", ".html"):
        raise ValueError(f"`path` must end in .png or .html; got '{target.name}'")
    return target, kind


def check_size(size: tuple[int, int], least: tuple[int, int]) -> tuple[int, int]:
    """Check the pixels of a PNG: no smaller than what it must hold."""
    pixels = as_integers("size", size, shape="(2,)", ndim=1).tolist()
    if len(pixels) != 2 or not all(a <= v <= _MOST for a, v in zip(least, pixels, strict=True)):
        room = f"from {least[0]} x {least[1]} to {_MOST} x {_MOST} pixels"
        raise ValueError(f"`size` must be a width and a height {room}; got {tuple(pixels)}")
    return pixels[0], pixels[1]


def heading(title: str, words: str) -> dict[str, Any]:
    """Title and caption for the layout of a plotly figure, as text and not as markup."""
    shown = "<br>".join(html.escape(line) for line in wrap(words, _LINE))
    text = f"{html.escape(title)}<br><span style='font-size:15px;color:{PALE}'>{shown}</span>"
    return {"text": text, "x": 0.03, "xanchor": "left", "y": 0.97, "font": {"color": INK, "size": 24}}


def save_page(path: Path, figure: Any, name: str, *, style: str = "") -> None:
    """Write a plotly figure as one page that fills the window and needs no network."""
    config = {"displaylogo": False, "responsive": True}
    page: str = figure.to_html(include_plotlyjs=True, full_html=True, config=config, default_height="100%")
    head = f"<head><title>{html.escape(name)}</title><style>html,body{{height:100%;margin:0;{style}}}</style>"
    path.write_text(page.replace("<head>", head, 1), encoding="utf-8")


def write_parts(
    path: Path, title: str, words: str, parts: Sequence[tuple[str, Draw]], size: tuple[int, int], *,
    legend: Sequence[tuple[str, str]], frame: NDArray[np.float64],
) -> None:  # fmt: skip
    """Draw up to four named parts, two in a row, under a title and a caption.

    Below stand the axes of `frame` (right, up and towards the viewer as rows), the scale of the first part, and the
    legend: colours and words.
    """
    from voxkernel.pictures.png import _write

    Image, ImageDraw = optional("PIL.Image"), optional("PIL.ImageDraw")

    part = (size[0] // 2, (size[1] - _HEAD - _FOOT) // 2)
    page = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(page)
    _write(pen, (36, 18), title, 38, INK, size[0] - 72)
    _write(pen, (36, 68), words, 22, PALE, size[0] - 72)
    scales: list[float] = []
    for i, (name, draw) in enumerate(parts):
        left, upper = (i % 2) * part[0], _HEAD + (i // 2) * part[1]
        room = (part[0], part[1] - _TOP)
        pixels, scale = drawn(draw, room)
        page.paste(Image.fromarray(pixels).resize(room, Image.Resampling.LANCZOS), (left, upper + _TOP))
        scales.append(scale)
        _write(pen, (left + 36, upper + 8), name, 21, INK, part[0] - 72)
    box = 36, size[1] - _FOOT, size[0] - 36, size[1]
    add_furniture(pen, _write, list(legend), frame, scales[0], box, 0.9)
    page.save(path, optimize=True)


def drawn(draw: Draw, size: tuple[int, int]) -> tuple[NDArray[np.uint8], float]:
    """One part, larger than needed, and the world units of a pixel of `size`, where the camera looks at."""
    from voxkernel.pictures.png import _light
    from voxkernel.pictures.silent_vtk import silent_vtk

    pyvista = optional("pyvista")

    with silent_vtk():
        pixels = [round(1.5 * v) for v in size]
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=pixels, lighting="none")
        try:
            _light(plotter, pyvista)
            plotter.set_background("white")
            draw(plotter, pyvista)
            plotter.render_window.SetMultiSamples(0)
            plotter.render_window.AlphaBitPlanesOn()
            plotter.enable_depth_peeling(12)
            image = np.asarray(plotter.screenshot(None, return_img=True))[..., :3]
            camera = plotter.camera
            slope = np.tan(0.5 * np.radians(camera.view_angle))
            half = camera.parallel_scale if camera.parallel_projection else slope * camera.distance
            return image, 2.0 * float(half) / size[1]
        finally:
            plotter.close()
