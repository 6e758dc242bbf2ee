"""A surface coloured by the guard that sees it, with the guards as balls and what is unseen in red."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._extras import optional
from voxkernel._palette import INK, UNSEEN, distinct_color, hex_of
from voxkernel.guarding import Guards
from voxkernel.mesh.triangles import without_strays
from voxkernel.pictures.camera import as_up, camera_frame, look_at
from voxkernel.pictures.parts import check_picture, check_size, heading, save_page, write_parts
from voxkernel.pictures.scene import Scene, make_scene
from voxkernel.pictures.space_furniture import dots, furniture_traces, lit, space

__all__ = ["guards_picture"]

_BALL = 0.018  # radius in diagonals of the surface
_MOST_NAMED = 8


def guards_picture(
    path: str | os.PathLike[str],
    found: Guards,
    *,
    title: str = "",
    size: tuple[int, int] = (1400, 1300),
    up: ArrayLike | None = None,
) -> None:
    """Draw each triangle in the colour of the first guard that sees its middle, guards as balls, the unseen in red.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.png`` (no display needed; solid and translucent, from two sides) or ``.html`` (one offline page
        that can be turned).
    found : Guards
        What `guards` found.
    title : str
        Heading.
    size : (int, int)
        Pixels of a ``.png``.
    up : (3,) array_like, optional
        The direction that points up, as in `surface_picture`.

    Raises
    ------
    ValueError
        If the suffix is another, `size` is too small or too large, or `up` is no direction.
    OSError
        If the file cannot be written.
    """
    place, kind = check_picture(path)
    pixels = check_size(size, (400, 360))
    scene = make_scene(found.mesh, None, up=as_up(up))
    words = (
        f"{len(found)} {'guard sees' if len(found) == 1 else 'guards see'} {100 * found.seen:.2f} % of the area, "
        f"{100 * found.certified:.2f} % by certificate; red: unseen"
    )
    if kind == ".html":
        _write_html(place, found, scene, title, words)
        return
    views = (("from one side", 1.0, 1.0), ("from the other side", -1.0, 1.0))
    parts = [(name, partial(_draw, found=found, view=s * scene.view, up=scene.up, opacity=a)) for name, s, a in views]
    parts += [
        (f"the same, translucent: guards {'inside' if found.side == 'inside' else 'outside'}",
         partial(_draw, found=found, view=s * scene.view, up=scene.up, opacity=0.3))
        for _, s, _ in views
    ]  # fmt: skip
    frame = camera_frame(scene.view, scene.up)
    write_parts(place, title, words, parts, pixels, legend=_legend(found), frame=frame)


def _legend(found: Guards) -> list[tuple[str, str]]:
    """Colours and names of the unseen and of as many guards as find room."""
    shown = min(len(found), _MOST_NAMED)
    entries = [(hex_of(distinct_color(i)), f"guard {i}") for i in range(shown)]
    if len(found) > shown:
        entries.append(("#ffffff", f"and {len(found) - shown} more"))
    return [*entries, (hex_of(UNSEEN), "unseen")]


def _colors(found: Guards) -> NDArray[np.uint8]:
    """Red, green and blue of each triangle."""
    table = np.array([UNSEEN, *(distinct_color(i) for i in range(len(found)))], np.uint8)
    return table[found.first_seen + 1]


def _draw(
    plotter: Any, pyvista: Any, *, found: Guards, view: NDArray[np.float64], up: NDArray[np.float64], opacity: float
) -> None:
    vertices, faces = without_strays(found.mesh.vertices, found.mesh.faces)
    data = pyvista.PolyData.from_regular_faces(vertices, faces)
    data.cell_data["color"] = _colors(found)
    plotter.add_mesh(data, scalars="color", rgb=True, opacity=opacity, ambient=0.4, diffuse=0.7)
    size = float(np.linalg.norm(np.diff(found.mesh.bounds, axis=0)))
    for i, point in enumerate(found.points):
        ball = pyvista.Sphere(radius=_BALL * size, center=point)
        plotter.add_mesh(ball, color=hex_of(distinct_color(i)), ambient=0.4, specular=0.4)
    if opacity < 1.0 and len(found):
        plotter.add_point_labels(
            found.points, [str(i) for i in range(len(found))], shape="rounded_rect", shape_color="white",
            shape_opacity=0.7, show_points=False, always_visible=True, font_size=20, text_color=INK,
        )  # fmt: skip
    around = [found.points + _BALL * size * step for step in (*np.eye(3), *-np.eye(3))]
    look_at(plotter, np.concatenate([vertices, *around]), view, up)


def _write_html(path: Path, found: Guards, scene: Scene, title: str, words: str) -> None:
    go = optional("plotly.graph_objects")
    vertices, faces = without_strays(found.mesh.vertices, found.mesh.faces)
    x, y, z = vertices.T
    i, j, k = faces.T.astype(np.int32)
    shades = [f"rgb({r},{g},{b})" for r, g, b in _colors(found).tolist()]
    traces = [
        go.Mesh3d(
            x=x, y=y, z=z, i=i, j=j, k=k, facecolor=shades, opacity=1.0, name="surface", hoverinfo="skip",
            flatshading=True, showlegend=False, **lit(scene.view, scene.up),
        )
    ]  # fmt: skip
    for n, point in enumerate(found.points):
        (px,), (py,), (pz,) = point[:, None]
        marker = {"size": 9, "color": hex_of(distinct_color(n)), "line": {"width": 2, "color": INK}}
        traces.append(
            go.Scatter3d(
                x=[px], y=[py], z=[pz], mode="markers", marker=marker, name=f"guard {n}", hoverinfo="name",
                showlegend=n < _MOST_NAMED,
            )
        )  # fmt: skip
    marker = {"size": 9, "color": hex_of(UNSEEN), "symbol": "square"}
    nowhere: dict[str, Any] = {"x": [None], "y": [None], "z": [None]}
    traces.append(go.Scatter3d(**nowhere, mode="markers", marker=marker, name="unseen", showlegend=True))
    points = np.concatenate([scene.points, found.points])
    figure = go.Figure([*traces, *furniture_traces(go, points, scene.view, scene.up)])
    marks = [hex_of(distinct_color(n)) for n in range(len(found))]
    annotations = dots(found.points, marks, [str(n) for n in range(len(found))])
    figure.update_layout(
        scene=space(points, scene.view, scene.up, annotations),
        title=heading(title, words), margin={"l": 0, "r": 0, "t": 100, "b": 0}, paper_bgcolor="white",
        font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
    )  # fmt: skip
    save_page(path, figure, title or "guards")
