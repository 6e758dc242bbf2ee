"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

from voxkernel.errors import VoxKernelError
from voxkernel.measures import starshapeness
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh_input import as_mesh
from voxkernel.octree import voxel_kernel
from voxkernel.polytope import exact_kernel

__all__ = ["TriangleMesh", "VoxKernelError", "as_mesh", "exact_kernel", "starshapeness", "voxel_kernel"]
__version__ = "0.1.0"
