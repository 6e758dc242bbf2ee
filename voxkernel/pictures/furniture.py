"""What stands below a picture: axes, a scale bar in mesh units, and what the colours mean."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._palette import INK, PALE
from voxkernel.pictures.scene import CENTER, DOMAIN, SURFACE, WITNESS, Scene

__all__ = ["add_furniture", "bar_length", "legend_of"]

# By letter and shade, not by colours: those have their meanings in the legend.
_AXES = (("x", "#18222d"), ("y", "#4a5866"), ("z", "#8a97a4"))

Write = Callable[..., None]


def bar_length(room: float) -> float:
    """Give the longest of 1, 2 and 5 times a power of ten that is not above `room`."""
    power = 10.0 ** math.floor(math.log10(room))
    return max(k * power for k in (1.0, 2.0, 5.0) if k * power <= room * (1.0 + 1e-9))


def legend_of(scene: Scene) -> list[tuple[str, str]]:
    """Colours and words of what the scene holds."""
    entries = [(SURFACE, "surface")]
    if len(scene.kernel_vertices):
        entries.append((scene.kernel_color, scene.kernel_name))
    if len(scene.center):
        entries.append((CENTER, scene.center_name))
    if len(scene.domain_lines):
        entries.append((DOMAIN, f"domain: {scene.domain_name}"))
    if len(scene.witness_faces):
        entries.append((WITNESS, "facets of the proof"))
    return entries


def add_furniture(
    pen: Any,
    write: Write,
    legend: list[tuple[str, str]],
    axes: NDArray[np.float64],
    units_per_pixel: float,
    box: tuple[int, int, int, int],
    unit: float,
) -> None:
    """Draw into the box (left, top, right, bottom).

    `legend` holds colours and words, `axes` are right, up and towards the viewer as rows; `units_per_pixel` holds in
    the middle of the surface.
    """
    left, top, right, bottom = box
    middle = 0.5 * (top + bottom)
    reach, line = 34 * unit, max(2, round(3 * unit))
    hub = np.array([left + 1.2 * reach, middle])
    flat = axes[:2].T * [1.0, -1.0]  # of each world axis, pixels to the right and down
    for k in np.argsort(axes[2]):  # those that point away first
        name, color = _AXES[k]
        end = hub + reach * flat[k]
        pen.line([tuple(hub), tuple(end)], fill=color, width=line)
        place = hub + (reach + 11 * unit) * flat[k]
        write(pen, (round(place[0] - 6 * unit), round(place[1] - 11 * unit)), name, 19 * unit, color, 40)
    start = left + 3.2 * reach
    length = bar_length(0.16 * (right - left) * units_per_pixel)
    end = start + length / units_per_pixel
    y, tick = middle + 12 * unit, 7 * unit
    pen.line([(start, y), (end, y)], fill=INK, width=line)
    for x in (start, end):
        pen.line([(x, y - tick), (x, y + tick)], fill=INK, width=line)
    words = f"{length:g} mesh units"
    write(pen, (round(start), round(middle - 24 * unit)), words, 20 * unit, INK, right - round(start))
    _draw_legend(pen, write, legend, (max(end, start + 170 * unit) + 50 * unit, middle, right), unit)


def _draw_legend(
    pen: Any, write: Write, entries: list[tuple[str, str]], box: tuple[float, float, float], unit: float
) -> None:
    """Draw into (left, middle, right): in one line, or two where it is longer than that."""
    left, middle, right = box
    side = 20 * unit
    widths = [1.5 * side + 11.0 * unit * len(words) + 28 * unit for _, words in entries]
    rows: list[list[tuple[str, str, float]]] = [[]] if sum(widths) <= right - left else [[], []]
    for k, width in enumerate(widths):
        rows[len(rows) == 2 and sum(widths[:k]) >= 0.5 * sum(widths)].append((*entries[k], width))
    for row, y in zip(rows, (middle,) if len(rows) == 1 else (middle - 18 * unit, middle + 18 * unit), strict=True):
        x = left
        for color, words, width in row:
            if color == CENTER:
                dot = [x + 2, y - side / 2 + 2, x + side - 2, y + side / 2 - 2]
                pen.ellipse(dot, fill=color, outline=INK, width=2)
            elif color == DOMAIN:
                pen.line([(x, y), (x + side, y)], fill=color, width=max(2, round(2 * unit)))
            else:
                pen.rectangle([x, y - side / 2, x + side, y + side / 2], fill=color)
            write(pen, (round(x + 1.5 * side), round(y - 13 * unit)), words, 20 * unit, PALE, right - round(x))
            x += width
