"""A fit -> one offline HTML page: panels to turn, two in a row, legend, histogram and colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel.pictures.fit_scene import UNEXPLAINED, Fit, Panel, bar_colors
from voxkernel.pictures.parts import heading, save_page
from voxkernel.pictures.space_furniture import furniture_traces, lit, space

__all__ = ["write_fit_html"]


def write_fit_html(
    path: Path, title: str, words: str, panels: Sequence[Panel], fit: Fit, legend: Sequence[tuple[str, str]]
) -> None:
    """Write the page; all panels begin with their own directions."""
    go = optional("plotly.graph_objects")
    rows = (len(panels) + 1) // 2
    specs: list[list[Any]] = [[{"type": "scene"}, {"type": "scene"}] for _ in range(rows)]
    specs.append([{"type": "xy", "colspan": 2}, None])
    figure = optional("plotly.subplots").make_subplots(
        rows=rows + 1, cols=2, specs=specs, horizontal_spacing=0.02, vertical_spacing=0.06,
        row_heights=[1.0] * rows + [0.38],
        subplot_titles=[*(p.name for p in panels), *[""] * (2 * rows - len(panels)),
                        "share of the area at each distance from the other surface"],
    )  # fmt: skip
    for k, panel in enumerate(panels):
        for layer in panel.layers:
            x, y, z = layer.vertices.T.astype(np.float32)
            i, j, m = layer.faces.T.astype(np.int32)
            figure.add_trace(
                go.Mesh3d(
                    x=x, y=y, z=z, i=i, j=j, k=m, vertexcolor=_names(layer.colors), name=layer.name, hoverinfo="name",
                    **lit(panel.view, panel.up),
                ), row=1 + k // 2, col=1 + k % 2,
            )  # fmt: skip
        points = np.concatenate([layer.vertices for layer in panel.layers])
        for trace in furniture_traces(go, points, panel.view, panel.up):
            figure.add_trace(trace, row=1 + k // 2, col=1 + k % 2)
        name = "scene" if k == 0 else f"scene{k + 1}"
        figure.layout[name].update(space(points, panel.view, panel.up))
    _add_histogram(go, figure, fit, rows + 1)
    for name, color in legend:
        marker = {"color": color, "size": 12, "symbol": "square"}
        figure.add_trace(go.Scatter(x=[None], y=[None], mode="markers", marker=marker, name=name), row=rows + 1, col=1)
    figure.update_layout(
        title=heading(title, words), margin={"l": 50, "r": 20, "t": 110, "b": 20}, paper_bgcolor="white",
        plot_bgcolor="white", legend={"orientation": "h", "y": -0.07}, bargap=0.04, height=380 * rows + 360,
        font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
    )  # fmt: skip
    save_page(path, figure, title or "registration")


def _add_histogram(go: Any, figure: Any, fit: Fit, row: int) -> None:
    middles = 0.5 * (fit.edges[1:] + fit.edges[:-1])
    width = float(fit.edges[1] - fit.edges[0])
    colors = _names(bar_colors((np.arange(len(middles)) + 0.5) / len(middles)))
    grey = fit.end + 4 * width
    figure.add_trace(
        go.Bar(
            x=[*middles, grey], y=[*(100 * fit.shares), 100 * fit.unexplained],
            marker={"color": [*colors, UNEXPLAINED]},
            width=[width] * len(middles) + [3 * width], showlegend=False, hovertemplate="%{y:.2f} %<extra></extra>",
        ), row=row, col=1,
    )  # fmt: skip
    ticks = [0.0, 0.25 * fit.end, 0.5 * fit.end, 0.75 * fit.end]
    words = [f"{t:.3g}" for t in ticks] + [f"{fit.end:.3g} and more"]
    figure.update_xaxes(
        tickvals=[*ticks, fit.end, grey], ticktext=[*words, "<br>unexplained"], title_text="mesh units", row=row, col=1
    )
    figure.update_yaxes(title_text="% of the area", rangemode="tozero", row=row, col=1)


def _names(colors: Any) -> list[str]:
    return [f"rgb({r},{g},{b})" for r, g, b in colors.tolist()]
