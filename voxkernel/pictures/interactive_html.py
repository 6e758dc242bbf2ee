"""Scenes -> one offline HTML page to turn by hand, by plotly."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.pictures.furniture import bar_length
from voxkernel.pictures.parts import save_page
from voxkernel.pictures.scene import CENTER, DOMAIN, LINE, SURFACE, WITNESS, Scene

__all__ = ["Plate", "write_html"]

_INK, _PALE = "#1d2733", "#5d6b7a"


class Plate(NamedTuple):
    """One scene of a page."""

    scene: Scene
    title: str
    caption: str


def write_html(path: Path, plates: Sequence[Plate]) -> None:
    """Write a page that shows the first plate; a menu changes between several."""
    go = optional("plotly.graph_objects")
    groups = [_traces(go, plate.scene) for plate in plates]
    figure = go.Figure([trace for group in groups for trace in group])
    owner = np.repeat(np.arange(len(groups)), [len(g) for g in groups])
    for trace, which in zip(figure.data, owner, strict=True):
        trace.visible = bool(which == 0)
    buttons = [
        {
            "label": plate.title,
            "method": "update",
            "args": [{"visible": (owner == i).tolist()}, {"title.text": _heading(plate), "scene": _space(plate.scene)}],
        }
        for i, plate in enumerate(plates)
    ]
    menu = {"buttons": buttons, "x": 0.985, "xanchor": "right", "y": 1.1, "yanchor": "top"}
    font = {"color": _INK, "size": 24}
    figure.update_layout(
        title={"text": _heading(plates[0]), "x": 0.03, "xanchor": "left", "y": 0.95, "font": font},
        scene=_space(plates[0].scene), margin={"l": 0, "r": 0, "t": 90, "b": 0}, paper_bgcolor="white",
        font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
        legend={
            "font": {"size": 15}, "x": 0.99, "xanchor": "right", "y": 0.02, "yanchor": "bottom",
            "bgcolor": "rgba(255,255,255,0.8)",
        },
        updatemenus=[menu] if len(plates) > 1 else [],
    )  # fmt: skip
    name = _clean(plates[0].title if len(plates) == 1 else "voxkernel")
    save_page(path, figure, name, style="overflow:hidden")


def _heading(plate: Plate) -> str:
    title, caption = (html.escape(_clean(text)) for text in (plate.title, plate.caption))
    return f"{title}<br><span style='font-size:15px;color:{_PALE}'>{caption}</span>"


def _clean(text: str) -> str:
    return text.encode("utf-8", "replace").decode()


def _space(scene: Scene) -> dict[str, Any]:
    lines, places, _ = _furniture(scene)
    points = np.concatenate([scene.points, lines.reshape(-1, 3), places])
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max()) or 1.0
    # Every axis as long as the longest, so that a flat scene is no case of its own.
    ranges = np.stack([0.5 * (low + high) - 0.5 * size, 0.5 * (low + high) + 0.5 * size], axis=1)
    eye = 1.02 * float(np.linalg.norm((high - low) / size)) * scene.view
    x, y, z = ({"visible": False, "range": ends, "autorange": False} for ends in ranges.tolist())
    return {
        "xaxis": x, "yaxis": y, "zaxis": z, "aspectmode": "cube",
        "annotations": _dots(scene.center),
        "camera": {
            "eye": dict(zip("xyz", eye.tolist(), strict=True)),
            "up": dict(zip("xyz", scene.up.tolist(), strict=True)),
            "center": {"x": 0, "y": 0, "z": 0},
        },
    }  # fmt: skip


def _traces(go: Any, scene: Scene) -> list[Any]:
    light = {
        "ambient": 0.48, "diffuse": 0.8, "specular": 0.2, "roughness": 0.6, "fresnel": 0.1,
        "facenormalsepsilon": 0, "vertexnormalsepsilon": 0,
    }  # fmt: skip
    over_shoulder = scene.view + 1.1 * scene.up - 0.6 * np.cross(scene.up, scene.view)
    shine = dict(zip("xyz", (3e4 * over_shoulder).tolist(), strict=True))
    solid: dict[str, Any] = {"lighting": light, "lightposition": shine}
    has_kernel = len(scene.kernel_vertices) > 0
    opacity = 0.3 if has_kernel else 0.5
    traces = [_mesh(go, scene.vertices, scene.faces, "surface", SURFACE, opacity=opacity, **solid)]
    if len(scene.surface_lines):
        traces.append(_lines(go, scene.surface_lines, LINE, 2))
    if len(scene.kernel_faces):
        look = scene.kernel_name, scene.kernel_color
        inner = {"flatshading": not scene.is_smooth}
        traces.append(_mesh(go, scene.kernel_vertices, scene.kernel_faces, *look, **inner, **solid))
        if 0 < len(scene.kernel_lines) <= 4000:
            traces.append(_lines(go, scene.kernel_lines, scene.kernel_line_color, 2))
    elif len(scene.kernel_lines):
        traces.append(_lines(go, scene.kernel_lines, scene.kernel_color, 8, name=scene.kernel_name))
    small = has_kernel and float(np.linalg.norm(np.ptp(scene.kernel_vertices, axis=0))) < 0.03 * scene.diagonal
    if small:
        x, y, z = scene.kernel_vertices.mean(axis=0)[:, None].tolist()
        marker = {"size": 7, "color": scene.kernel_color, "symbol": "circle-open", "line": {"width": 2}}
        name = f"{scene.kernel_name} (here)"
        traces.append(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=name, showlegend=True))
    if len(scene.witness_faces):
        traces += _witness(go, scene)
    if len(scene.center):
        x, y, z = scene.center.T.tolist()
        marker = {"size": 6, "color": CENTER, "line": {"color": _INK, "width": 1.5}}
        name = scene.center_name
        traces.append(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=name, showlegend=True))
    if len(scene.domain_lines):
        traces.append(_lines(go, scene.domain_lines, DOMAIN, 2, name=f"domain: {scene.domain_name}"))
    lines, places, words = _furniture(scene)
    return [*traces, _lines(go, lines, _INK, 4), _words(go, places, words)]


def _furniture(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64], list[str]]:
    """Axes and a scale bar below the scene, as segments and words of the world: they turn and shrink with it."""
    right = np.cross(scene.up, scene.view)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(scene.view, right), scene.view])
    flat = scene.points @ frame.T
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


def _dots(points: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Dots in front of everything: the centre is inside the kernel."""
    found: list[dict[str, Any]] = []
    for place in points.tolist():
        at = {**dict(zip("xyz", place, strict=True)), "showarrow": False, "text": "●", "hovertext": ""}
        found += [{**at, "font": {"size": size, "color": color}} for size, color in ((24, _INK), (17, CENTER))]
    return found


def _words(go: Any, points: NDArray[np.float64], words: Sequence[str]) -> Any:
    x, y, z = points.T.tolist()
    font = {"color": _INK, "size": 14}
    return go.Scatter3d(
        x=x, y=y, z=z, mode="text", text=list(words), textfont=font, hoverinfo="skip", showlegend=False
    )


def _witness(go: Any, scene: Scene) -> list[Any]:
    facets = scene.faces[scene.witness_faces]
    traces = [_mesh(go, scene.vertices, facets, "facets of the proof", WITNESS, flatshading=True)]
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    for center, inward in zip(scene.witness_centers, scene.witness_inward, strict=True):
        aside = np.cross(inward, np.eye(3)[np.argmin(np.abs(inward))])
        aside /= np.linalg.norm(aside)
        circle = np.outer(np.cos(turn), aside) + np.outer(np.sin(turn), np.cross(inward, aside))
        points = np.concatenate([center[None], center + 0.06 * scene.diagonal * circle])
        ring = 1 + np.arange(len(turn))
        fan = np.column_stack([np.zeros(len(turn), np.int64), ring, 1 + ring % len(turn)])
        traces.append(_mesh(go, points, fan, "", WITNESS, opacity=0.45))
        end = center + 0.13 * scene.diagonal * inward
        traces.append(_lines(go, np.array([[center, end]]), WITNESS, 6))
        x, y, z = end[:, None].tolist()
        u, v, w = (0.06 * scene.diagonal * inward)[:, None].tolist()
        traces.append(
            go.Cone(
                x=x, y=y, z=z, u=u, v=v, w=w, sizemode="raw", anchor="center", showscale=False,
                colorscale=[[0, WITNESS], [1, WITNESS]], hoverinfo="skip",
            )
        )  # fmt: skip
    return traces


def _mesh(go: Any, vertices: NDArray[np.float64], faces: NDArray[np.int64], name: str, color: str, **style: Any) -> Any:
    x, y, z = vertices.T
    i, j, k = faces.T.astype(np.int32)
    return go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, color=color, name=name, showlegend=bool(name),
        hoverinfo="name" if name else "skip", **style,
    )  # fmt: skip


def _lines(go: Any, segments: NDArray[np.float64], color: str, width: int, *, name: str = "") -> Any:
    broken = np.concatenate([segments, np.full((len(segments), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    x, y, z = broken.T
    return go.Scatter3d(
        x=x, y=y, z=z, mode="lines", line={"color": color, "width": width}, name=name, showlegend=bool(name),
        hoverinfo="skip",
    )  # fmt: skip
