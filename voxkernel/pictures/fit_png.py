"""A fit -> PNG: panels of one scale, two in a row, and below them legend, histogram and colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel._palette import INK, PALE
from voxkernel.pictures.camera import camera_frame
from voxkernel.pictures.fit_scene import UNEXPLAINED, Fit, Panel, bar_colors
from voxkernel.pictures.furniture import add_furniture
from voxkernel.pictures.parts import drawn
from voxkernel.pictures.png import _write as write_line
from voxkernel.pictures.png import broken

__all__ = ["LEAST", "write_fit_png"]

_HEAD, _LINE, _TOP, _FOOT, _BELOW = 110, 27, 36, 210, 80
LEAST = 600, 800
"""Width and height of a picture that has room for six panels."""
_MUCH_LARGER = 1.4  # than the panel of the surfaces laid together: drawn in a scale of its own, which is told


def write_fit_png(
    path: Path, title: str, words: str, panels: Sequence[Panel], fit: Fit, legend: Sequence[tuple[str, str]],
    size: tuple[int, int],
) -> None:  # fmt: skip
    """Draw the panels, all from their directions and in one scale, and what their colours mean."""
    Image, ImageDraw = optional("PIL.Image"), optional("PIL.ImageDraw")
    rows = (len(panels) + 1) // 2
    page = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(page)
    write_line(pen, (36, 16), title, 36, INK, size[0] - 72)
    lines = broken(pen, words, 20, size[0] - 72)
    for k, line in enumerate(lines):
        write_line(pen, (36, 66 + _LINE * k), line, 20, PALE, size[0] - 72)
    head = _HEAD + _LINE * (len(lines) - 1)
    part = size[0] // 2, (size[1] - head - _FOOT - _BELOW) // rows
    scales = [_half_height(panel, part[0] / (part[1] - _TOP)) for panel in panels]
    common = min(max(scales), _MUCH_LARGER * scales[1])
    for i, (panel, own) in enumerate(zip(panels, scales, strict=True)):
        left, upper = (i % 2) * part[0], head + (i // 2) * part[1]
        shown = max(own, common)
        name = panel.name + (f" (at {100 * common / shown:.0f} % of the size)" if shown > 1.01 * common else "")
        room = (part[0], part[1] - _TOP)
        pixels, _ = drawn(partial(_draw, panel=panel, scale=shown), room)
        image = Image.fromarray(pixels)
        page.paste(image.resize(room, Image.Resampling.LANCZOS), (left, upper + _TOP))
        write_line(pen, (left + 36, upper + 6), name, 20 if len(name) < 40 else 16, INK, part[0] - 50)
    bottom = size[1] - _BELOW
    _legend(pen, (size[0], bottom), legend)
    _histogram(pen, (size[0] // 2 + 40, bottom - _FOOT + 8), (size[0] // 2 - 80, _FOOT - 20), fit)
    frame, scale = camera_frame(panels[1].view, panels[1].up), 2.0 * common / (part[1] - _TOP)
    add_furniture(pen, write_line, [], frame, scale, (36, bottom, size[0] // 2, size[1]), 0.9)
    page.save(path, optimize=True)


def _half_height(panel: Panel, aspect: float) -> float:
    """Half of what the height of a panel must hold, with a margin."""
    points = np.concatenate([layer.vertices for layer in panel.layers])
    wide, high, _ = np.ptp(points @ camera_frame(panel.view, panel.up).T, axis=0)
    return 0.53 * float(max(high, wide / aspect)) or 1.0


def _draw(plotter: Any, pyvista: Any, panel: Panel, scale: float) -> None:
    for layer in panel.layers:
        data = pyvista.PolyData.from_regular_faces(layer.vertices, layer.faces)
        data["colors"] = layer.colors
        plotter.add_mesh(
            data, scalars="colors", rgb=True, smooth_shading=True, ambient=0.4, diffuse=0.65, specular=0.08
        )
    points = np.concatenate([layer.vertices for layer in panel.layers])
    frame = camera_frame(panel.view, panel.up)
    there = points @ frame.T
    focus = 0.5 * (there.min(axis=0) + there.max(axis=0)) @ frame
    far = 2.0 * float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    plotter.camera_position = [tuple(focus + far * panel.view), tuple(focus), tuple(frame[1])]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = scale
    plotter.reset_camera_clipping_range()


def _legend(pen: Any, size: tuple[int, int], legend: Sequence[tuple[str, str]]) -> None:
    """Write the names beside squares of their colours, in columns."""
    top, step = size[1] - _FOOT + 14, 30
    per_column = (_FOOT - 30) // step
    columns = max(1, (len(legend) + per_column - 1) // per_column)
    width = (size[0] // 2 - 36) // columns
    for k, (name, color) in enumerate(legend):
        x, y = 36 + (k // per_column) * width, top + (k % per_column) * step
        pen.rectangle((x, y, x + 20, y + 20), fill=color)
        write_line(pen, (x + 30, y), name, 17, INK, width - 40)


def _histogram(pen: Any, corner: tuple[int, int], room: tuple[int, int], fit: Fit) -> None:
    """Draw the histogram of distances on the colour bar, and a grey column for what nothing explains."""
    left, top = corner
    grey = round(0.12 * room[0])
    width, height = room[0] - 2 * grey, room[1] - 74
    colors = bar_colors((np.arange(len(fit.shares)) + 0.5) / len(fit.shares))
    most = float(max(fit.shares.max(initial=0.0), 1e-12))
    write_line(pen, (left, top), "share of the area at each distance from the other surface", 16, PALE, room[0])
    base = top + 24 + height
    for k, share in enumerate(fit.shares):
        x0, x1 = (left + round(width * v / len(fit.shares)) for v in (k, k + 1))
        color = tuple(int(c) for c in colors[k])
        pen.rectangle((x0, base - round(height * share / most), x1 - 1, base), fill=color)
        pen.rectangle((x0, base + 4, x1 - 1, base + 18), fill=color)
    for at, text in ((0.0, "0"), (0.5, f"{0.5 * fit.end:.3g}"), (1.0, f"{fit.end:.3g} and more")):
        write_line(pen, (left + round(at * width) - (0 if at == 0 else 16), base + 22), text, 16, INK, 160)
    write_line(pen, (left + round(0.16 * width), base + 22), "mesh units", 16, PALE, 140)
    x = left + width + grey
    bar = round(height * min(1.0, fit.unexplained))
    pen.rectangle((x, base - height, x + grey // 2, base), outline=UNEXPLAINED)
    pen.rectangle((x, base - bar, x + grey // 2, base + 18), fill=UNEXPLAINED)
    write_line(pen, (x + grey // 2 + 6, base - 8), f"{100 * fit.unexplained:.0f} %", 16, INK, grey)
