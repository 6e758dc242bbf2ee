"""Pictures of a spherical map: surface and centre, radius on the sphere and as a world map, reconstruction."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._extras import optional
from voxkernel._frozen import Frozen
from voxkernel._palette import INK
from voxkernel.mesh.triangles import without_strays
from voxkernel.pictures.camera import as_up, camera_frame, look_at
from voxkernel.pictures.parts import check_picture, heading, save_page, write_parts
from voxkernel.pictures.png import segments
from voxkernel.pictures.scene import KERNEL, SURFACE, make_scene
from voxkernel.pictures.space_furniture import broken_lines, furniture_traces, lit, space
from voxkernel.spherical import RadialGrid
from voxkernel.spherical.radial_grid import grid_triangles

if TYPE_CHECKING:
    from voxkernel.spherical import SphericalMap

__all__ = ["sphere_picture"]

_UNSEEN, _LINE = "#e3e6ea", "#ffffff"
_SIZE = (1400, 1200)
_LEGEND = [(SURFACE, "surface, reconstruction"), (KERNEL, "centre and lines of sight"), (_UNSEEN, "not covered")]
_MAP_RINGS = 180
_NAMES = ("surface and centre", "radius on the sphere", "world map", "reconstruction")
_CONVENTION = "longitude from +x to +y, latitude towards +z"
_STEP = 30  # degrees between lines of longitude and of latitude


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Panels(Frozen):
    """What the four parts show, world coordinates turned so that the middle of the seen part is at longitude 0."""

    surface: tuple[NDArray[np.float64], NDArray[np.int64]]
    center: NDArray[np.float64]
    rays: NDArray[np.float64]
    ball: tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]
    world_map: NDArray[np.float64]
    rebuilt: tuple[NDArray[np.float64], NDArray[np.int64]]
    view: NDArray[np.float64]
    up: NDArray[np.float64]


def sphere_picture(
    path: str | os.PathLike[str],
    sphere: SphericalMap,
    *,
    samples: RadialGrid | None = None,
    title: str = "",
    up: ArrayLike | None = None,
) -> None:
    """Draw a spherical map in four parts.

    Parameters
    ----------
    path : str or os.PathLike
        ``.png``, or ``.html`` for one page that needs no network (5 to 15 MB).
    sphere : SphericalMap
        What `spherical_map` gave.
    samples : RadialGrid, optional
        The grid that is reconstructed; `sphere.sample()` by default.
    title : str
        Words above the picture.
    up : (3,) array_like, optional
        The direction that points up, as in `surface_picture`.

    Raises
    ------
    ValueError
        If the suffix is neither, or `up` is no direction.
    OSError
        If the file cannot be written.
    """
    target, kind = check_picture(path)
    panels = _panels(sphere, sphere.sample() if samples is None else samples, as_up(up))
    words = _caption(sphere)
    if kind == ".html":
        _write_html(target, panels, title, words)
    else:
        _write_png(target, panels, title, words)


def _caption(sphere: SphericalMap) -> str:
    text = (
        f"{sphere.center_kind} centre, covers {100 * sphere.coverage:.4g} % of the sphere, "
        f"clearance {sphere.clearance:.4g}, distortion {sphere.distortion:.3g}"
    )
    if len(sphere.folded_facets):
        text += f"; {100 * sphere.hidden_fraction:.3g} % of the area turned away"
    return text


def _panels(sphere: SphericalMap, samples: RadialGrid, up: NDArray[np.float64] | None) -> _Panels:
    scene = make_scene(sphere.mesh, None, up=up)
    fine = sphere.sample(grid="equiangular", n=_MAP_RINGS)
    radii = np.append(fine.radii.reshape(-1), fine.pole_radii)
    unit = np.concatenate([fine.grid.directions(), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    rebuilt = samples.reconstruct()
    used = sphere.mesh.used_vertices
    chosen = used[np.linspace(0, len(used) - 1, 40).astype(int)]
    rays = np.stack([np.broadcast_to(sphere.center, chosen.shape), chosen], axis=1)
    return _Panels(
        without_strays(sphere.mesh.vertices, sphere.mesh.faces), sphere.center, rays,
        (unit, grid_triangles(fine.grid), radii), fine.radii, (rebuilt.vertices, rebuilt.faces), scene.view, scene.up,
    )  # fmt: skip


def _write_html(path: Path, panels: _Panels, title: str, words: str) -> None:
    go = optional("plotly.graph_objects")
    make_subplots = optional("plotly.subplots").make_subplots
    figure = make_subplots(
        rows=2, cols=2, subplot_titles=_titles(), horizontal_spacing=0.05, vertical_spacing=0.07,
        specs=[[{"type": "scene"}, {"type": "scene"}], [{"type": "heatmap"}, {"type": "scene"}]],
    )  # fmt: skip
    light = lit(panels.view, panels.up)

    def solid(vertices: NDArray[np.float64], faces: NDArray[np.int64], **style: Any) -> Any:
        x, y, z = vertices.T.astype(np.float32)
        i, j, k = faces.T.astype(np.int32)
        return go.Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, hoverinfo="skip", **light, **style)

    figure.add_trace(solid(*panels.surface, color=SURFACE, opacity=0.55), row=1, col=1)
    x, y, z = broken_lines(panels.rays).T
    thin = {"color": KERNEL, "width": 1.5}
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line=thin, hoverinfo="skip"), row=1, col=1)
    x, y, z = panels.center[:, None].tolist()
    dot = {"size": 6, "color": KERNEL, "line": {"color": INK, "width": 1}}
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=dot, name="centre"), row=1, col=1)
    unit, triangles, radii = panels.ball
    seen = np.isfinite(radii)[triangles].all(axis=1)
    bar = {"title": "radius", "x": 0.478, "y": 0.22, "len": 0.42, "thickness": 12}
    shades: dict[str, Any] = {"colorscale": "Viridis", "showscale": False, "flatshading": False}
    figure.add_trace(solid(unit, triangles[~seen], color=_UNSEEN), row=1, col=2)
    filled = np.nan_to_num(radii, nan=float(np.nanmin(radii))).astype(np.float32)
    figure.add_trace(
        solid(unit, triangles[seen], intensity=filled, **shades,
              cmin=float(np.nanmin(radii)), cmax=float(np.nanmax(radii))), row=1, col=2,
    )  # fmt: skip
    longitude, latitude, flat = _rolled(panels.world_map)
    figure.add_trace(
        go.Heatmap(
            x=longitude, y=latitude, z=flat.astype(np.float32), colorscale="Viridis", colorbar=bar, hoverongaps=False,
            hovertemplate="longitude %{x:.1f}<br>latitude %{y:.1f}<br>radius %{z:.5g}<extra></extra>",
        ), row=2, col=1,
    )  # fmt: skip
    figure.add_trace(solid(*panels.rebuilt, color=SURFACE), row=2, col=2)
    figure.add_trace(
        go.Scatter(**_lines_of_map(), mode="lines", line={"color": _LINE, "width": 0.8}, hoverinfo="skip"), row=2, col=1
    )
    shown = np.concatenate([panels.surface[0], panels.center[None]])
    for trace in furniture_traces(go, shown, panels.view, panels.up):
        figure.add_trace(trace, row=1, col=1)
    x, y, z = broken_lines(_lines_of_ball()).T
    thin = {"color": _LINE, "width": 1.5}
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line=thin, hoverinfo="skip"), row=1, col=2)
    axis = {"constrain": "domain", "showgrid": False, "zeroline": False, "ticksuffix": "°"}
    figure.update_xaxes(title="longitude", range=[-180, 180], dtick=60, **axis)
    figure.update_yaxes(title="latitude", range=[-90, 90], dtick=30, scaleanchor="x", **axis)
    ball = panels.ball[0]
    for name, points in (("scene", shown), ("scene2", ball), ("scene3", panels.surface[0])):
        figure.layout[name].update(space(points, panels.view, panels.up))
    figure.update_layout(
        title=heading(title, words),
        margin={"l": 60, "r": 20, "t": 110, "b": 40}, paper_bgcolor="white", plot_bgcolor=_UNSEEN, showlegend=False,
        font={"family": "system-ui, 'DejaVu Sans', sans-serif"},
    )  # fmt: skip
    save_page(path, figure, title or "spherical map")


def _titles() -> tuple[str, ...]:
    """Names of the parts; that of the map says what its axes are."""
    return tuple(f"{name}: {_CONVENTION}" if name == _NAMES[2] else name for name in _NAMES)


def _lines_of_map() -> dict[str, NDArray[np.float64]]:
    """Meridians and parallels of the map, with gaps between."""
    east, north = np.arange(-180.0, 181.0, _STEP), np.arange(-90.0, 91.0, _STEP)
    x = np.concatenate([np.column_stack([east, east, east * np.nan]).ravel(), np.tile([-180.0, 180.0, np.nan], 7)])
    return {"x": x, "y": np.concatenate([np.tile([-90.0, 90.0, np.nan], 13), np.repeat(north, 3)])}


def _lines_of_ball() -> NDArray[np.float64]:
    """The same lines on the ball, a little above it, as segments."""
    turn, up = np.radians(np.arange(0.0, 361.0, 5.0)), np.radians(np.arange(-90.0, 91.0, 5.0))
    curves = [_on_ball(turn, np.full_like(turn, b)) for b in np.radians(np.arange(-90.0 + _STEP, 90.0, _STEP))]
    curves += [_on_ball(np.full_like(up, a), up) for a in np.radians(np.arange(0.0, 360.0, _STEP))]
    return np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in curves])


def _on_ball(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> NDArray[np.float64]:
    flat = np.cos(latitude)
    return 1.006 * np.stack([flat * np.cos(longitude), flat * np.sin(longitude), np.sin(latitude)], axis=-1)


def _rolled(radii: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Longitudes from -180, latitudes from -90, and the radii in that order."""
    rows, columns = radii.shape
    longitude = (np.arange(columns) + 0.5) * 360.0 / columns - 180.0
    latitude = (np.arange(rows) + 0.5) * 180.0 / rows - 90.0
    return longitude, latitude, np.roll(radii[::-1], columns // 2, axis=1)


def _write_png(path: Path, panels: _Panels, title: str, words: str) -> None:
    draws = (_draw_surface, _draw_ball, _draw_map, _draw_rebuilt)
    parts = [(name, partial(draw, panels=panels)) for name, draw in zip(_titles(), draws, strict=True)]
    write_parts(path, title, words, parts, _SIZE, legend=_LEGEND, frame=camera_frame(panels.view, panels.up))


_COLORS: dict[str, Any] = {"cmap": "viridis", "show_scalar_bar": False, "nan_color": _UNSEEN}
_MATERIAL: dict[str, Any] = {"ambient": 0.3, "diffuse": 0.75, "specular": 0.25, "specular_power": 28}


def _draw_surface(plotter: Any, pyvista: Any, panels: _Panels) -> None:
    vertices, faces = panels.surface
    data = pyvista.PolyData.from_regular_faces(vertices, faces)
    plotter.add_mesh(data, color=SURFACE, opacity=0.5, smooth_shading=True, split_sharp_edges=True, **_MATERIAL)
    plotter.add_mesh(segments(pyvista, panels.rays), color=KERNEL, line_width=2.0, opacity=0.8, lighting=False)
    reach = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    plotter.add_mesh(pyvista.Sphere(radius=0.016 * reach, center=panels.center), color=KERNEL, **_MATERIAL)
    look_at(plotter, panels.surface[0], panels.view, panels.up)  # what is rebuilt is seen from the same place


def _draw_ball(plotter: Any, pyvista: Any, panels: _Panels) -> None:
    unit, triangles, radii = panels.ball
    seen = np.isfinite(radii)[triangles].all(axis=1)
    if not seen.all():
        plotter.add_mesh(pyvista.PolyData.from_regular_faces(unit, triangles[~seen]), color=_UNSEEN, **_MATERIAL)
    ball = pyvista.PolyData.from_regular_faces(unit, triangles[seen])
    ball.point_data["radius"] = radii
    plotter.add_mesh(ball, scalars="radius", ambient=0.4, diffuse=0.55, **_COLORS)
    plotter.add_mesh(segments(pyvista, _lines_of_ball()), color=_LINE, line_width=1.2, opacity=0.6, lighting=False)
    look_at(plotter, unit, panels.view, panels.up)


def _draw_map(plotter: Any, pyvista: Any, panels: _Panels) -> None:
    longitude, latitude, flat = _rolled(panels.world_map)
    columns, rows = len(longitude), len(latitude)
    chart: Any = pyvista.ImageData(
        dimensions=(columns + 1, rows + 1, 1), spacing=(360.0 / columns, 180.0 / rows, 1.0), origin=(-180.0, -90.0, 0.0)
    )
    chart.cell_data["radius"] = flat.reshape(-1)
    shades = plotter.add_mesh(chart, scalars="radius", lighting=False, **_COLORS)
    ends = [((a, -90.0, 1.0), (a, 90.0, 1.0)) for a in range(-180, 181, _STEP)]
    ends += [((-180.0, b, 1.0), (180.0, b, 1.0)) for b in range(-90, 91, _STEP)]
    lines = segments(pyvista, np.array(ends, dtype=np.float64))
    plotter.add_mesh(lines, color=_LINE, line_width=1.2, opacity=0.6, lighting=False)
    labels = [((a, -98.0, 0.0), f"{a}°") for a in range(-180, 181, 2 * _STEP)]
    labels += [((-197.0, b, 0.0), f"{b}°") for b in range(-60, 61, _STEP)]
    plotter.add_point_labels(
        np.array([place for place, _ in labels], dtype=np.float64), [words for _, words in labels], shape=None,
        show_points=False, always_visible=True, font_size=20, text_color=INK, justification_horizontal="center",
        justification_vertical="center",
    )  # fmt: skip
    plotter.add_scalar_bar(
        "radius", mapper=shades.mapper, n_labels=4, height=0.08, width=0.6, position_x=0.2, position_y=0.02, color=INK,
        fmt="%.4g",
    )  # fmt: skip
    plotter.view_xy()
    plotter.camera.zoom(1.2)


def _draw_rebuilt(plotter: Any, pyvista: Any, panels: _Panels) -> None:
    rebuilt = pyvista.PolyData.from_regular_faces(*panels.rebuilt)
    plotter.add_mesh(rebuilt, color=SURFACE, smooth_shading=True, split_sharp_edges=True, **_MATERIAL)
    look_at(plotter, panels.surface[0], panels.view, panels.up)  # what is rebuilt is seen from the same place
