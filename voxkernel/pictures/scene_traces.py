"""A scene -> traces of plotly: the surface, and apart from it what belongs to one kernel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._palette import INK
from voxkernel.pictures.creases import split_at_creases
from voxkernel.pictures.scene import CENTER, DOMAIN, LINE, SURFACE, WITNESS, Scene
from voxkernel.pictures.space_furniture import broken_lines, dots, lit

__all__ = ["center_dots", "kernel_traces", "surface_traces"]


def surface_traces(go: Any, scene: Scene, *, opacity: float) -> list[Any]:
    """The surface, and its sharp edges."""
    light = lit(scene.view, scene.up)
    vertices, faces = split_at_creases(scene.vertices, scene.faces)
    traces = [_mesh(go, vertices, faces, "surface", SURFACE, opacity=opacity, **light)]
    return [*traces, _lines(go, scene.surface_lines, LINE, 2)] if len(scene.surface_lines) else traces


def kernel_traces(go: Any, scene: Scene, *, name: str = "") -> list[Any]:
    """The kernel, or what proves it empty; the point that is marked in it, and the domain that cuts it."""
    name, traces = name or scene.kernel_name, []
    if len(scene.kernel_faces):
        light = lit(scene.view, scene.up)
        inner = {"flatshading": not scene.is_smooth}
        traces.append(
            _mesh(go, scene.kernel_vertices, scene.kernel_faces, name, scene.kernel_color, **inner, **light)
        )
        if 0 < len(scene.kernel_lines) <= 4000:
            traces.append(_lines(go, scene.kernel_lines, scene.kernel_line_color, 2))
    elif len(scene.kernel_lines):
        traces.append(_lines(go, scene.kernel_lines, scene.kernel_color, 8, name=name))
    extent = float(np.linalg.norm(np.ptp(scene.kernel_vertices, axis=0))) if len(scene.kernel_vertices) else np.inf
    if extent < 0.03 * scene.diagonal:
        x, y, z = scene.kernel_vertices.mean(axis=0)[:, None].tolist()
        marker = {"size": 7, "color": scene.kernel_color, "symbol": "circle-open", "line": {"width": 2}}
        here = f"{name} (here)"
        traces.append(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=here, showlegend=True))
    if len(scene.witness_faces):
        traces += _witness(go, scene)
    if len(scene.center):
        x, y, z = scene.center.T.tolist()
        marker = {"size": 6, "color": CENTER, "line": {"color": INK, "width": 1.5}}
        called = scene.center_name
        traces.append(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=called, showlegend=True))
    if len(scene.domain_lines):
        traces.append(_lines(go, scene.domain_lines, DOMAIN, 2, name=f"domain: {scene.domain_name}"))
    return traces


def center_dots(scene: Scene) -> list[dict[str, Any]]:
    """The point that is marked, in front of everything, as annotations of the space."""
    return dots(scene.center, [CENTER] * len(scene.center))


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
