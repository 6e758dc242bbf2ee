"""Half-spaces in, voxels out: the kernel with certain bounds, or the field of the violation."""

from voxkernel.voxels.kernel_grid import KernelGrid
from voxkernel.voxels.violation_grid import violation_grid
from voxkernel.voxels.voxel_kernel import voxel_kernel
from voxkernel.voxels.voxel_kernels import voxel_kernels

__all__ = [
    "KernelGrid",
    "violation_grid",
    "voxel_kernel",
    "voxel_kernels",
]
