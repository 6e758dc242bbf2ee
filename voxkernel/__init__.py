"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

# First of all: it says how to install where the compiled core is missing.
from voxkernel import _core_check as _core_check
from voxkernel.errors import VoxKernelError
from voxkernel.evaluate import EvaluateSettings, evaluate
from voxkernel.grid import SparseGrid
from voxkernel.measures import defect_profile, starshapeness
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh_input import as_mesh
from voxkernel.moments import kernel_moments
from voxkernel.octree import voxel_kernel
from voxkernel.points import kernel_points
from voxkernel.polyhedral import cell_kernels, read_polyhedral
from voxkernel.polytope import exact_kernel
from voxkernel.registration import register
from voxkernel.registration_batch import register_many
from voxkernel.repair import repair
from voxkernel.report import write_report
from voxkernel.spherical import spherical_map
from voxkernel.vdb import read_vdb, write_vdb
from voxkernel.violation import best_center, violation, violation_grid
from voxkernel.visibility import visible_fraction

__all__ = [
    "EvaluateSettings",
    "SparseGrid",
    "TriangleMesh",
    "VoxKernelError",
    "as_mesh",
    "best_center",
    "cell_kernels",
    "defect_profile",
    "evaluate",
    "exact_kernel",
    "kernel_moments",
    "kernel_points",
    "read_polyhedral",
    "read_vdb",
    "register",
    "register_many",
    "repair",
    "spherical_map",
    "starshapeness",
    "violation",
    "violation_grid",
    "visible_fraction",
    "voxel_kernel",
    "write_report",
    "write_vdb",
]
__version__ = "0.1.0"
