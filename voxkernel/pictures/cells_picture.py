"""A polyhedral mesh, cut open, with a colour for each cell."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_path
from voxkernel._extras import optional
from voxkernel._palette import INK
from voxkernel.pictures.parts import check_size
from voxkernel.pictures.silent_vtk import silent_vtk

if TYPE_CHECKING:
    from voxkernel.polyhedral import PolyhedralMesh

__all__ = ["cells_picture"]


def cells_picture(
    path: str | os.PathLike[str],
    mesh: PolyhedralMesh,
    values: ArrayLike,
    *,
    label: str = "",
    limits: tuple[float, float] | None = None,
    size: tuple[int, int] = (1400, 1000),
) -> None:
    """Draw the cells whose middle lies in the lower half along x, coloured by a value of each; NaN is grey.

    `values` has one number per cell, `limits` are the ends of the colour bar (those of the values by default),
    `label` is its title; `path` ends in .png. Needs PyVista and no display.
    """
    pyvista = optional("pyvista")

    target = as_path("path", path)
    if target.suffix.lower() != ".png":
        raise ValueError(f"`path` must end in .png; got '{target.name}'")
    pixels = check_size(size, (200, 200))
    shades = np.asarray(values, dtype=np.float64)
    if shades.shape != (len(mesh),):
        raise ValueError(f"`values` must have shape ({len(mesh)},); got {shades.shape}")
    middles = _middles(mesh)
    chosen = np.flatnonzero(middles[:, 0] <= np.nanmedian(middles[:, 0]))
    polygons, owner = _polygons(mesh, chosen)
    finite = shades[np.isfinite(shades)]
    low, high = limits or ((float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0))
    data: Any = pyvista.PolyData(mesh.vertices.copy(), polygons)
    data.cell_data["value"] = shades[owner]
    with silent_vtk():
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(pixels))
        try:
            plotter.set_background("white")
            plotter.add_mesh(
                data, scalars="value", clim=(low, high), cmap="viridis", nan_color="#b0b0b0", show_edges=True,
                edge_color=INK, line_width=0.6, ambient=0.35, diffuse=0.75, interpolate_before_map=False,
                scalar_bar_args={
                    "title": " ", "color": INK, "n_labels": 5, "fmt": "%.2g", "width": 0.5,
                    "height": 0.08, "position_x": 0.45, "position_y": 0.03,
                },
            )  # fmt: skip
            plotter.view_vector((1.0, -0.55, 0.35), viewup=(0.0, 0.0, 1.0))
            plotter.add_text(label, position=(0.05, 0.04), viewport=True, font_size=pixels[1] // 65, color=INK)
            plotter.camera.zoom(1.25)
            plotter.camera.SetWindowCenter(0.0, -0.1)
            plotter.enable_anti_aliasing("ssaa")
            plotter.screenshot(os.fspath(target))
        finally:
            plotter.close()


def _middles(mesh: PolyhedralMesh) -> NDArray[np.float64]:
    """Mean of the corners of the faces of each cell; NaN for a cell without faces."""
    sizes = np.diff(mesh.face_offsets)
    sums = np.add.reduceat(mesh.vertices[mesh.face_vertices], mesh.face_offsets[:-1], axis=0)
    owner = np.repeat(np.arange(len(mesh)), np.diff(mesh.cell_offsets))
    total = np.column_stack(
        [np.bincount(owner, weights=sums[mesh.cell_faces, k], minlength=len(mesh)) for k in range(3)]
    )
    count = np.bincount(owner, weights=sizes[mesh.cell_faces], minlength=len(mesh)).astype(np.float64)
    count[count == 0] = np.nan
    return total / count[:, None]


def _polygons(mesh: PolyhedralMesh, cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces of some cells as VTK wants them, and the cell of each; of a face that two of them share, none."""
    owner = np.repeat(np.arange(len(mesh)), np.diff(mesh.cell_offsets))
    uses = np.flatnonzero(np.isin(owner, cells))
    faces = mesh.cell_faces[uses]
    once = np.bincount(faces, minlength=len(mesh.face_offsets) - 1)[faces] == 1
    parts: list[NDArray[np.int64]] = []
    for face in faces[once]:
        loop = mesh.face_vertices[mesh.face_offsets[face] : mesh.face_offsets[face + 1]]
        parts += [np.array([len(loop)]), loop]
    return np.concatenate(parts), owner[uses[once]]
