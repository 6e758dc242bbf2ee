"""Half-spaces in, voxels out: the kernel with certain bounds, or the field of the violation."""

from voxkernel.voxels.voxel_kernel import KernelGrid, voxel_kernel

__all__ = [
    "KernelGrid",
    "voxel_kernel",
]
