"""The space of an HTML picture, with axes, a scale bar and dots that turn and shrink with it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._palette import INK
from voxkernel.pictures.camera import camera_frame
from voxkernel.pictures.furniture import bar_length

__all__ = ["axes_and_bar", "broken_lines", "dots", "furniture_traces", "lit", "space"]


def axes_and_bar(
    points: NDArray[np.float64], view: NDArray[np.float64], up: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[str]]:
    """Axes and a scale bar below points: segments (k, 2, 3), places of words (n, 3) and the words."""
    frame = camera_frame(view, up)
    flat = points @ frame.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = float((high - low)[:2].max()) or 1.0
    hub = np.array([low[0] + 0.08 * size, low[1] - 0.14 * size, 0.5 * (low[2] + high[2])])
    reach, length = 0.08 * size, bar_length(0.3 * size)
    start = hub + np.array([0.2 * size, 0.0, 0.0])
    end, tick = start + np.array([length, 0.0, 0.0]), np.array([0.0, 0.02 * size, 0.0])
    bar = np.array([[start, end], [start - tick, start + tick], [end - tick, end + tick]]) @ frame
    root = np.broadcast_to(hub @ frame, (3, 3))
    axes = np.stack([root, root + reach * np.eye(3)], axis=1)
    middle = 0.5 * (start + end) + np.array([0.0, 0.05 * size, 0.0])
    places = np.concatenate([root + 1.35 * reach * np.eye(3), (middle @ frame)[None]])
    return np.concatenate([axes, bar]), places, ["x", "y", "z", f"{length:g} mesh units"]


def broken_lines(segments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ends of segments (k, 2, 3) one after the other, with a gap behind each, as plotly takes lines."""
    return np.concatenate([segments, np.full((len(segments), 1, 3), np.nan)], axis=1).reshape(-1, 3)


def furniture_traces(
    go: Any, points: NDArray[np.float64], view: NDArray[np.float64], up: NDArray[np.float64]
) -> list[Any]:
    """The same for plotly: lines, and words."""
    lines, places, words = axes_and_bar(points, view, up)
    x, y, z = broken_lines(lines).T
    common: dict[str, Any] = {"hoverinfo": "skip", "showlegend": False}
    bars = go.Scatter3d(x=x, y=y, z=z, mode="lines", line={"color": INK, "width": 4}, **common)
    x, y, z = places.T.tolist()
    font = {"color": INK, "size": 14}
    return [bars, go.Scatter3d(x=x, y=y, z=z, mode="text", text=words, textfont=font, **common)]


def lit(view: NDArray[np.float64], up: NDArray[np.float64]) -> dict[str, Any]:
    """Light of a plotly mesh: from far away, above the left shoulder of who looks; for triangles of any size."""
    over_shoulder = view + 1.1 * up - 0.6 * np.cross(up, view)
    lighting = {
        "ambient": 0.48, "diffuse": 0.8, "specular": 0.2, "roughness": 0.6, "fresnel": 0.1,
        "facenormalsepsilon": 0, "vertexnormalsepsilon": 0,
    }  # fmt: skip
    return {"lighting": lighting, "lightposition": dict(zip("xyz", (3e4 * over_shoulder).tolist(), strict=True))}


def space(
    points: NDArray[np.float64], view: NDArray[np.float64], up: NDArray[np.float64],
    annotations: Sequence[dict[str, Any]] = (),
) -> dict[str, Any]:  # fmt: skip
    """Make the layout of a plotly scene: points, and what stands below them, fill the picture from a direction."""
    lines, places, _ = axes_and_bar(points, view, up)
    everything = np.concatenate([points, lines.reshape(-1, 3), places])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = float((high - low).max()) or 1.0
    # Every axis as long as the longest, so that a flat scene is no case of its own.
    ranges = np.stack([0.5 * (low + high) - 0.5 * size, 0.5 * (low + high) + 0.5 * size], axis=1)
    eye = 1.02 * float(np.linalg.norm((high - low) / size)) * view
    x, y, z = ({"visible": False, "range": ends, "autorange": False} for ends in ranges.tolist())
    return {
        "xaxis": x, "yaxis": y, "zaxis": z, "aspectmode": "cube", "annotations": list(annotations),
        "camera": {
            "eye": dict(zip("xyz", eye.tolist(), strict=True)),
            "up": dict(zip("xyz", up.tolist(), strict=True)),
            "center": {"x": 0, "y": 0, "z": 0},
        },
    }  # fmt: skip


def dots(points: NDArray[np.float64], colors: Iterable[str], names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Dots in front of everything, as annotations of a plotly scene, each with its name beside it."""
    found: list[dict[str, Any]] = []
    for k, (place, color) in enumerate(zip(points.tolist(), colors, strict=True)):
        at = {**dict(zip("xyz", place, strict=True)), "showarrow": False, "text": "●", "hovertext": ""}
        found += [{**at, "font": {"size": size, "color": shade}} for size, shade in ((24, INK), (17, color))]
        if names:
            beside = {"text": names[k], "xshift": 16, "yshift": 12, "bgcolor": "rgba(255,255,255,0.75)"}
            found.append({**at, **beside, "font": {"size": 13, "color": INK}})
    return found
