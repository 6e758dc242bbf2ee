"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

# First of all: it says how to install where the compiled core is missing.
from voxkernel import _core_check as _core_check
from voxkernel._version import __version__ as __version__
from voxkernel.errors import VoxKernelError
from voxkernel.evaluation import EvaluateSettings, evaluate
from voxkernel.exact import exact_kernel
from voxkernel.grid import SparseGrid
from voxkernel.measures import defect_profile, kernel_moments, kernel_points, starshapeness, visible_fraction
from voxkernel.mesh import TriangleMesh, as_mesh, repair
from voxkernel.polyhedral import cell_kernels, read_polyhedral
from voxkernel.registration import register, register_many
from voxkernel.relaxed import best_center, violation
from voxkernel.report import write_report
from voxkernel.spherical import spherical_map
from voxkernel.vdb import read_vdb, write_vdb
from voxkernel.voxels import violation_grid, voxel_kernel, voxel_kernels

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
    "voxel_kernels",
    "write_report",
    "write_vdb",
]
