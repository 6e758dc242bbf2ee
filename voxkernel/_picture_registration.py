"""Two surfaces and their kernels before and after registration, as a picture or a page."""

from __future__ import annotations

import html
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._register_prepare import PreparedSurface
from voxkernel.registration import Registration

__all__ = ["registration_picture"]

_SOURCE, _TARGET = "#d9822b", "#5b8db8"
_INK, _PALE = "#1d2733", "#5c6b7a"
_NAMES = ("surfaces before", "surfaces after", "kernels before", "kernels after")


class _Body(NamedTuple):
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    color: str
    name: str


def registration_picture(
    source: PreparedSurface,
    target: PreparedSurface,
    found: Registration,
    path: str | os.PathLike[str],
    *,
    title: str = "",
    size: tuple[int, int] = (1400, 1200),
) -> None:
    """Draw source (orange) and target (blue), and their relaxed kernels below, as given and after the motion.

    Parameters
    ----------
    source, target : PreparedSurface
        From `prepare_surface`.
    found : Registration
        What `register` found for them.
    path : str or os.PathLike
        Ends in ``.png`` (no display needed) or ``.html`` (one offline page that can be turned).
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
    place = Path(path)
    kind = place.suffix.lower()
    if kind not in (".png", ".html"):
        raise ValueError(f"`path` must end in .png or .html; got '{place.name}'")
    before, after = _bodies(source, target, np.eye(4)), _bodies(source, target, found.T_target_source)
    scenes = before[0], after[0], before[1], after[1]
    words = (
        f"{100 * found.fitness:.1f} % of the source within {found.max_distance:.3g}, RMS {found.inlier_rmse:.3g}"
        + (f"; {found.reason}" if found.reason else "")
    )
    (_write_png if kind == ".png" else _write_html)(scenes, place, title, words, size)


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


def _write_html(scenes: Any, path: Path, title: str, words: str, size: tuple[int, int]) -> None:
    from importlib import import_module

    go: Any = import_module("plotly.graph_objects")
    figure = import_module("plotly.subplots").make_subplots(
        rows=2, cols=2, subplot_titles=_NAMES, horizontal_spacing=0.02, vertical_spacing=0.05,
        specs=[[{"type": "scene"}, {"type": "scene"}]] * 2,
    )  # fmt: skip
    del size
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
    heading = f"{html.escape(title)}<br><span style='font-size:15px;color:{_PALE}'>{html.escape(words)}</span>"
    figure.update_layout(
        title={"text": heading, "x": 0.03, "xanchor": "left", "y": 0.97, "font": {"color": _INK, "size": 24}},
        margin={"l": 10, "r": 10, "t": 110, "b": 20}, paper_bgcolor="white",
        legend={"orientation": "h", "y": -0.02}, font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
    )  # fmt: skip
    config = {"displaylogo": False, "responsive": True}
    page: str = figure.to_html(include_plotlyjs=True, full_html=True, config=config, default_height="100%")
    style = "<style>html,body{height:100%;margin:0}</style>"
    name = html.escape(title or "registration")
    path.write_text(page.replace("<head>", f"<head><title>{name}</title>{style}", 1), encoding="utf-8")


def _write_png(scenes: Any, path: Path, title: str, words: str, size: tuple[int, int]) -> None:
    from PIL import Image, ImageDraw

    from voxkernel._picture_png import _write

    head, top = 120, 40
    room = (size[0] // 2, (size[1] - head) // 2 - top)
    page = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(page)
    _write(pen, (36, 18), title, 38, _INK, size[0] - 72)
    _write(pen, (36, 68), words, 22, _PALE, size[0] - 72)
    for place, bodies in enumerate(scenes):
        left, upper = (place % 2) * room[0], head + (place // 2) * (room[1] + top)
        image = Image.fromarray(_drawn(bodies, room)).resize(room, Image.Resampling.LANCZOS)
        page.paste(image, (left, upper + top))
        _write(pen, (left + 36, upper + 8), _NAMES[place], 21, _INK, room[0] - 72)
    page.save(path, optimize=True)


def _drawn(bodies: list[_Body], size: tuple[int, int]) -> NDArray[np.uint8]:
    import pyvista

    from voxkernel._picture_png import _light, _silent_vtk

    with _silent_vtk():
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=[round(1.5 * v) for v in size], lighting="none")
        try:
            _light(plotter, pyvista)
            plotter.set_background("white")
            for body in bodies:
                data = pyvista.PolyData.from_regular_faces(body.vertices, body.faces)
                plotter.add_mesh(
                    data, color=body.color, smooth_shading=True, split_sharp_edges=True, ambient=0.3, diffuse=0.75,
                    specular=0.2, specular_power=28,
                )  # fmt: skip
            plotter.render_window.SetMultiSamples(0)
            plotter.camera_position = "iso"
            plotter.camera.zoom(1.25)
            return np.asarray(plotter.screenshot(None, return_img=True))[..., :3]
        finally:
            plotter.close()
