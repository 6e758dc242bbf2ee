"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

from voxkernel.errors import VoxKernelError
from voxkernel.grid import SparseGrid
from voxkernel.measures import defect_profile, starshapeness
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh_input import as_mesh
from voxkernel.octree import voxel_kernel
from voxkernel.polytope import exact_kernel
from voxkernel.repair import repair
from voxkernel.spherical import spherical_map
from voxkernel.vdb import read_vdb, write_vdb
from voxkernel.violation import best_center, violation, violation_grid
from voxkernel.visibility import visible_fraction

__all__ = [
    "SparseGrid",
    "TriangleMesh",
    "VoxKernelError",
    "as_mesh",
    "best_center",
    "defect_profile",
    "exact_kernel",
    "read_vdb",
    "repair",
    "spherical_map",
    "starshapeness",
    "violation",
    "violation_grid",
    "visible_fraction",
    "voxel_kernel",
    "write_vdb",
]
__version__ = "0.1.0"
