"""Arrays of voxels in, `SparseGrid` out, and from there to files and other libraries. Knows no geometry."""

from voxkernel.grid.linear_octree import LinearOctree, to_linear_octree
from voxkernel.grid.named_grids import NamedGrids
from voxkernel.grid.npz import read_npz, write_npz
from voxkernel.grid.sparse_grid import SparseGrid
from voxkernel.grid.surface_mesh import to_surface
from voxkernel.grid.to_other_libraries import to_open3d_points, to_open3d_voxels, to_pyvista_cells, to_pyvista_image

__all__ = [
    "LinearOctree",
    "NamedGrids",
    "SparseGrid",
    "read_npz",
    "to_linear_octree",
    "to_open3d_points",
    "to_open3d_voxels",
    "to_pyvista_cells",
    "to_pyvista_image",
    "to_surface",
    "write_npz",
]
