"""`slider_page`: surface and kernels as one offline page, with a slider over a fixed set of tolerances."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from voxkernel._checks import as_path
from voxkernel._extras import optional
from voxkernel.exact import Kernel
from voxkernel.guarding import Guards
from voxkernel.mesh import MeshLike
from voxkernel.pictures.parts import heading, save_page
from voxkernel.pictures.scene import LINE, make_scene
from voxkernel.pictures.scene_traces import center_dots, kernel_traces, surface_traces
from voxkernel.pictures.space_furniture import furniture_traces, space
from voxkernel.view.shown import Shown, gathered

__all__ = ["slider_page", "write_slider_page"]


def slider_page(
    path: str | os.PathLike[str],
    surface: MeshLike,
    kernel: Kernel | None = None,
    *,
    tolerances: Sequence[float] | None = None,
    depth: int = 6,
    domain: Any = None,
    guards: Guards | None = None,
    title: str = "",
    up: ArrayLike | None = None,
) -> None:
    """Write a surface and its kernels as one page that needs no network, with a slider over the tolerances.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.html``; about 5 MB, and more for large surfaces.
    surface, kernel, tolerances, depth, domain, guards, title, up : optional
        As for `open_viewer`.

    Raises
    ------
    ValueError
        If the suffix is another; as `open_viewer`.
    MissingExtraError
        If plotly is not installed.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "tetrahedron.html"
    ...     slider_page(file, tetrahedron, tolerances=[0.1, 0.2], depth=4)
    ...     "relaxed, up to 20 % of the area turned away" in file.read_text(encoding="utf-8")
    True
    """
    target = as_path("path", path)
    if target.suffix.lower() != ".html":
        raise ValueError(f"`path` must end in .html; got '{target.name}'")
    optional("plotly")
    shown = gathered(
        surface, kernel, tolerances=tolerances, depth=depth, domain=domain, guards=guards, title=title, up=up
    )
    write_slider_page(target, shown)


def write_slider_page(path: Path, shown: Shown) -> None:
    """Write what is shown; the surface is in the page once, whatever the number of kernels."""
    go = optional("plotly.graph_objects")
    scenes = [make_scene(shown.mesh, kernel, up=shown.up) for kernel in shown.kernels]
    first, guards = scenes[0], np.zeros((0, 3)) if shown.guards is None else shown.guards.points
    points = np.concatenate([*(scene.points for scene in scenes), guards])
    fixed = surface_traces(go, first, opacity=0.35)
    if len(guards):
        x, y, z = guards.T.tolist()
        marker = {"size": 6, "color": LINE}
        fixed.append(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name="guards", hoverinfo="name"))
    fixed += furniture_traces(go, points, first.view, first.up)
    stops = [kernel_traces(go, scene, name=shown.stop_name(i)) for i, scene in enumerate(scenes)]
    owner = np.array([-1] * len(fixed) + [i for i, traces in enumerate(stops) for _ in traces])
    figure = go.Figure([*fixed, *(trace for traces in stops for trace in traces)])
    for trace, stop in zip(figure.data, owner, strict=True):
        trace.visible = bool(stop <= 0)
    steps = [
        {
            "label": "exact" if i == 0 else f"{100 * scene.tolerance:.4g} %", "method": "update",
            "args": [{"visible": ((owner == -1) | (owner == i)).tolist()},
                     {"title.text": heading(shown.title, shown.stop_words(i))["text"],
                      "scene.annotations": center_dots(scene)}],
        } for i, scene in enumerate(scenes)
    ]  # fmt: skip
    slider = {
        "active": 0, "steps": steps, "x": 0.08, "len": 0.84, "pad": {"t": 10, "b": 20},
        "currentvalue": {"prefix": "area that may be turned away: "},
    }  # fmt: skip
    figure.update_layout(
        title=heading(shown.title, shown.stop_words(0)), sliders=[slider] if len(steps) > 1 else [],
        scene=space(points, first.view, first.up, center_dots(first)),
        margin={"l": 0, "r": 0, "t": 90, "b": 0}, paper_bgcolor="white",
        font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
        legend={"x": 0.99, "xanchor": "right", "y": 0.97, "yanchor": "top", "bgcolor": "rgba(255,255,255,0.8)"},
    )  # fmt: skip
    save_page(path, figure, shown.title, style="overflow:hidden")
