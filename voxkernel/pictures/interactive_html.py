"""Scenes -> one offline HTML page to turn by hand, by plotly."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._palette import INK, PALE
from voxkernel.pictures.parts import save_page
from voxkernel.pictures.scene import CENTER, DOMAIN, LINE, SURFACE, WITNESS, Scene
from voxkernel.pictures.space_furniture import broken_lines, dots, furniture_traces, lit, space

__all__ = ["Plate", "write_html"]



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
    font = {"color": INK, "size": 24}
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
    return f"{title}<br><span style='font-size:15px;color:{PALE}'>{caption}</span>"


def _clean(text: str) -> str:
    return text.encode("utf-8", "replace").decode()


def _space(scene: Scene) -> dict[str, Any]:
    return space(scene.points, scene.view, scene.up, dots(scene.center, [CENTER] * len(scene.center)))


def _traces(go: Any, scene: Scene) -> list[Any]:
    solid = lit(scene.view, scene.up)
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
        marker = {"size": 6, "color": CENTER, "line": {"color": INK, "width": 1.5}}
        name = scene.center_name
        traces.append(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=name, showlegend=True))
    if len(scene.domain_lines):
        traces.append(_lines(go, scene.domain_lines, DOMAIN, 2, name=f"domain: {scene.domain_name}"))
    return [*traces, *furniture_traces(go, scene.points, scene.view, scene.up)]


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
    x, y, z = broken_lines(segments).T
    return go.Scatter3d(
        x=x, y=y, z=z, mode="lines", line={"color": color, "width": width}, name=name, showlegend=bool(name),
        hoverinfo="skip",
    )  # fmt: skip
