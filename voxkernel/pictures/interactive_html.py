"""Scenes -> one offline HTML page to turn by hand, by plotly."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from voxkernel._extras import optional
from voxkernel._palette import INK, PALE
from voxkernel.pictures.parts import save_page
from voxkernel.pictures.scene import Scene
from voxkernel.pictures.scene_traces import center_dots, kernel_traces, surface_traces
from voxkernel.pictures.space_furniture import furniture_traces, space

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
    return space(scene.points, scene.view, scene.up, center_dots(scene))


def _traces(go: Any, scene: Scene) -> list[Any]:
    opacity = 0.3 if len(scene.kernel_vertices) else 0.5
    traces = [*surface_traces(go, scene, opacity=opacity), *kernel_traces(go, scene)]
    return [*traces, *furniture_traces(go, scene.points, scene.view, scene.up)]
