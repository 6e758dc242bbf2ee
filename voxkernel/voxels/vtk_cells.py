"""A kernel grid as VTK's files: cells, or the faces of the inside ones, with what is known of each."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._vtk_xml import write_hexahedra, write_polygons
from voxkernel.grid import SparseGrid, to_surface
from voxkernel.grid.to_other_libraries import cells_of, hexahedron_corners
from voxkernel.mesh import MeshLike

if TYPE_CHECKING:
    from voxkernel.voxels.kernel_grid import KernelGrid

__all__ = ["write_vtp", "write_vtu"]

_MOST_CELLS = 20_000_000


def write_vtu(path: str | os.PathLike[str], kernel: KernelGrid, surface: MeshLike | None) -> None:
    """One hexahedron per tile and voxel: `state` (1 inside, 0 undecided), `level`, and `violation` at its centre."""
    parts = [cells_of(grid, _MOST_CELLS)[:2] for grid in (kernel.inside, kernel.boundary)]
    corner, edge = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    state = np.repeat(np.array([1, 0], np.uint8), [len(part[0]) for part in parts])
    centres = (corner + 0.5 * edge[:, None]) @ kernel.inside.linear.T + kernel.origin
    data = _of_cells(kernel, surface, centres, state, kernel.depth - np.log2(edge).astype(np.int8))
    write_hexahedra(path, hexahedron_corners(kernel.inside, corner, edge), cell_data=data)


def write_vtp(path: str | os.PathLike[str], kernel: KernelGrid, surface: MeshLike | None) -> None:
    """The faces of the inside voxels as triangles: `state` 1, `level` of the cell, `violation` in the triangle."""
    vertices, faces = to_surface(kernel.inside)
    corners = vertices[faces]
    centres = corners.mean(axis=1)
    inward = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])  # as long as a voxel face is large
    behind = centres + 0.5 * inward / kernel.voxel_size
    voxels = np.rint(kernel.world_to_index(behind)).astype(np.int64)
    levels = _levels(kernel).values_at(voxels).astype(np.int8) if len(faces) else np.zeros(0, np.int8)
    data = _of_cells(kernel, surface, centres, np.ones(len(faces), np.uint8), levels)
    write_polygons(path, vertices, faces.reshape(-1), np.full(len(faces), 3), cell_data=data)


def _of_cells(
    kernel: KernelGrid,
    surface: MeshLike | None,
    points: NDArray[np.float64],
    state: NDArray[np.uint8],
    level: NDArray[np.int8],
) -> dict[str, NDArray[Any]]:
    data: dict[str, NDArray[Any]] = {"state": state, "level": level.astype(np.int8)}
    if surface is not None:
        from voxkernel.relaxed import violation

        asked = (state == 0) | (kernel.tolerance > 0.0)  # nothing is turned away from a point of the exact kernel
        values = np.zeros(len(points))
        values[asked] = violation(surface, points[asked])
        data["violation"] = values
    return data


def _levels(kernel: KernelGrid) -> SparseGrid:
    """The level of every inside voxel: that of its tile, or the depth of the grid."""
    inside = kernel.inside
    return SparseGrid(
        tile_ijk=inside.tile_ijk, tile_log2=inside.tile_log2, leaf_ijk=inside.leaf_ijk, leaf_mask=inside.leaf_mask,
        tile_values=(kernel.depth - inside.tile_log2).astype(np.float32),
        leaf_values=np.full((len(inside.leaf_ijk), 512), kernel.depth, np.float32),
    )  # fmt: skip
