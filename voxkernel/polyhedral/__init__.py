"""Polyhedral meshes in, the kernel of every cell out."""

from voxkernel.polyhedral.cell_kernels import cell_kernels
from voxkernel.polyhedral.cell_solver import CellKernels
from voxkernel.polyhedral.exact_kernels import PackedSurfaces, exact_kernels
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh
from voxkernel.polyhedral.read_polyhedral import is_polyhedral, read_polyhedral

__all__ = [
    "CellKernels",
    "PackedSurfaces",
    "PolyhedralMesh",
    "cell_kernels",
    "exact_kernels",
    "is_polyhedral",
    "read_polyhedral",
]
