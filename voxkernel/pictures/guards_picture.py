"""A surface coloured by the guard that sees it, with the guards as balls and what is unseen in red."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.guarding import Guards
from voxkernel.guarding.colored_ply import UNSEEN, piece_color
from voxkernel.mesh.triangles import without_strays
from voxkernel.pictures.parts import check_picture, heading, save_page, write_parts
from voxkernel.pictures.scene import make_scene

__all__ = ["guards_picture"]

_BALL = 0.018  # radius in diagonals of the surface
_MOST_NAMED = 12


def guards_picture(
    path: str | os.PathLike[str], found: Guards, *, title: str = "", size: tuple[int, int] = (1400, 1200)
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

    Raises
    ------
    ValueError
        If the suffix is another.
    OSError
        If the file cannot be written.
    """
    place, kind = check_picture(path)
    words = (
        f"{len(found)} guards see {100 * found.seen:.2f} % of the area, {100 * found.certified:.2f} % by certificate; "
        f"red: unseen"
    )
    if kind == ".html":
        _write_html(place, found, title, words)
        return
    scene = make_scene(found.mesh, None)
    views = (("from one side", 1.0, 1.0), ("from the other side", -1.0, 1.0))
    parts = [(name, partial(_draw, found=found, view=s * scene.view, up=scene.up, opacity=a)) for name, s, a in views]
    parts += [
        (f"the same, translucent: guards {'inside' if found.side == 'inside' else 'outside'}",
         partial(_draw, found=found, view=s * scene.view, up=scene.up, opacity=0.3))
        for _, s, _ in views
    ]  # fmt: skip
    write_parts(place, title, words, parts, size)


def _colors(found: Guards) -> NDArray[np.uint8]:
    """Red, green and blue of each triangle."""
    table = np.array([UNSEEN, *(piece_color(i) for i in range(len(found)))], np.uint8)
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
        color = [v / 255.0 for v in piece_color(i)]
        plotter.add_mesh(pyvista.Sphere(radius=_BALL * size, center=point), color=color, ambient=0.4, specular=0.4)
    plotter.view_vector(view, viewup=up)
    plotter.camera.zoom(1.25)


def _write_html(path: Path, found: Guards, title: str, words: str) -> None:
    go = optional("plotly.graph_objects")
    vertices, faces = without_strays(found.mesh.vertices, found.mesh.faces)
    x, y, z = vertices.T
    i, j, k = faces.T.astype(np.int32)
    shades = [f"rgb({r},{g},{b})" for r, g, b in _colors(found).tolist()]
    traces = [
        go.Mesh3d(
            x=x, y=y, z=z, i=i, j=j, k=k, facecolor=shades, opacity=0.75, name="surface", hoverinfo="skip",
            flatshading=True, showlegend=False,
        )
    ]  # fmt: skip
    for n, point in enumerate(found.points):
        (px,), (py,), (pz,) = point[:, None]
        red, green, blue = piece_color(n)
        marker = {"size": 9, "color": f"rgb({red},{green},{blue})", "line": {"width": 2, "color": "#1d2733"}}
        traces.append(
            go.Scatter3d(
                x=[px], y=[py], z=[pz], mode="markers", marker=marker, name=f"guard {n}", hoverinfo="name",
                showlegend=n < _MOST_NAMED,
            )
        )  # fmt: skip
    figure = go.Figure(traces)
    hidden = {"visible": False}
    figure.update_layout(
        scene={"xaxis": hidden, "yaxis": hidden, "zaxis": hidden, "aspectmode": "data"}, title=heading(title, words),
        margin={"l": 0, "r": 0, "t": 100, "b": 0}, paper_bgcolor="white",
        font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
    )  # fmt: skip
    save_page(path, figure, title or "guards")
