"""Polyhedral meshes in, the kernel of every cell out."""

from voxkernel.polyhedral.cell_kernels import cell_kernels, is_polyhedral, read_polyhedral
from voxkernel.polyhedral.cell_solver import CellKernels
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh

__all__ = [
    "CellKernels",
    "PolyhedralMesh",
    "cell_kernels",
    "is_polyhedral",
    "read_polyhedral",
]
