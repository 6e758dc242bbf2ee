"""Two surfaces and their kernels before and after registration, as a picture or a page."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.pictures.parts import check_picture, heading, save_page, write_parts
from voxkernel.registration import Registration
from voxkernel.registration.prepare import PreparedSurface

__all__ = ["registration_picture"]

_SOURCE, _TARGET = "#d9822b", "#5b8db8"
_NAMES = ("surfaces before", "surfaces after", "kernels before", "kernels after")


class _Body(NamedTuple):
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    color: str
    name: str


def registration_picture(
    path: str | os.PathLike[str],
    source: PreparedSurface,
    target: PreparedSurface,
    found: Registration,
    *,
    title: str = "",
    size: tuple[int, int] = (1400, 1200),
) -> None:
    """Draw source (orange) and target (blue), and their relaxed kernels below, as given and after the motion.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.png`` (no display needed) or ``.html`` (one offline page that can be turned).
    source, target : PreparedSurface
        From `prepare_surface`.
    found : Registration
        What `register` found for them.
    title : str
        Heading.
    size : (int, int)
        Pixels of a ``.png``.

    Raises
    ------
    ValueError
        If the suffix is another.
    OSError
        If the file cannot be written.
    """
    place, kind = check_picture(path)
    before, after = _bodies(source, target, np.eye(4)), _bodies(source, target, found.T_target_source)
    scenes = before[0], after[0], before[1], after[1]
    words = (
        f"{100 * found.fitness:.1f} % of the source within {found.max_distance:.3g}, RMS {found.inlier_rmse:.3g}"
        + (f"; {found.reason}" if found.reason else "")
    )
    if kind == ".html":
        _write_html(place, scenes, title, words)
    else:
        parts = [(name, partial(_draw, bodies=bodies)) for name, bodies in zip(_NAMES, scenes, strict=True)]
        write_parts(place, title, words, parts, size)


def _bodies(
    source: PreparedSurface, target: PreparedSurface, motion: NDArray[np.float64]
) -> tuple[list[_Body], list[_Body]]:
    """Give the two surfaces and their kernels of the smallest margin that are not empty."""
    surfaces: list[_Body] = []
    kernels: list[_Body] = []
    for surface, move, color, name in ((target, np.eye(4), _TARGET, "target"), (source, motion, _SOURCE, "source")):
        world = move @ surface.T_world_local
        surfaces.append(_Body(_moved(surface.vertices, world), surface.faces, color, name))
        kernel = next((k for k in surface.kernels if k.active_voxel_count), None)
        if kernel is not None:
            mesh = kernel.to_mesh()
            kernels.append(_Body(_moved(mesh.vertices, world), mesh.faces, color, f"kernel of the {name}"))
    return surfaces, kernels


def _moved(points: NDArray[np.float64], motion: NDArray[np.float64]) -> NDArray[np.float64]:
    return points @ motion[:3, :3].T + motion[:3, 3]


def _write_html(path: Path, scenes: Sequence[list[_Body]], title: str, words: str) -> None:
    go = optional("plotly.graph_objects")
    figure = optional("plotly.subplots").make_subplots(
        rows=2, cols=2, subplot_titles=_NAMES, horizontal_spacing=0.02, vertical_spacing=0.05,
        specs=[[{"type": "scene"}, {"type": "scene"}]] * 2,
    )  # fmt: skip
    for place, bodies in enumerate(scenes):
        for body in bodies:
            x, y, z = body.vertices.T.astype(np.float32)
            i, j, k = body.faces.T.astype(np.int32)
            figure.add_trace(
                go.Mesh3d(
                    x=x, y=y, z=z, i=i, j=j, k=k, color=body.color, name=body.name, hoverinfo="name",
                    showlegend=place % 2 == 0, legendgroup=body.name, flatshading=place >= 2,
                ), row=1 + place // 2, col=1 + place % 2,
            )  # fmt: skip
    hidden = {"visible": False}
    figure.update_scenes(xaxis=hidden, yaxis=hidden, zaxis=hidden, aspectmode="data")
    figure.update_layout(
        title=heading(title, words), margin={"l": 10, "r": 10, "t": 110, "b": 20}, paper_bgcolor="white",
        legend={"orientation": "h", "y": -0.02}, font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
    )  # fmt: skip
    save_page(path, figure, title or "registration")


def _draw(plotter: Any, pyvista: Any, bodies: list[_Body]) -> None:
    for body in bodies:
        data = pyvista.PolyData.from_regular_faces(body.vertices, body.faces)
        plotter.add_mesh(
            data, color=body.color, smooth_shading=True, split_sharp_edges=True,
            ambient=0.3, diffuse=0.75, specular=0.2, specular_power=28,
        )  # fmt: skip
    plotter.camera_position = "iso"
    plotter.camera.zoom(1.25)
