"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

# First of all: it says how to install where the compiled core is missing.
from voxkernel import _core_check as _core_check
from voxkernel._version import __version__ as __version__
from voxkernel.errors import GridReadError, MeshError, MeshReadError, SolverError, VoxKernelError
from voxkernel.evaluation import EvaluateSettings, EvaluationResult, evaluate
from voxkernel.exact import Certificate, Kernel, KernelPolytope, exact_kernel
from voxkernel.grid import SparseGrid
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.measures import (
    DefectProfile,
    KernelMoments,
    KernelPoints,
    Starshapeness,
    VisibleFraction,
    defect_profile,
    kernel_moments,
    kernel_points,
    starshapeness,
    visible_fraction,
)
from voxkernel.mesh import MeshFacts, RepairChange, RepairResult, TriangleMesh, as_mesh, repair
from voxkernel.polyhedral import CellKernels, PolyhedralMesh, cell_kernels, read_polyhedral
from voxkernel.registration import Candidate, PairRegistration, Registration, register, register_many
from voxkernel.relaxed import StarCenter, best_center, violation
from voxkernel.report import write_report
from voxkernel.spherical import (
    CoverageCertificate,
    Harmonics,
    RadialGrid,
    ReconstructionError,
    SphereGrid,
    SphericalMap,
    spherical_map,
)
from voxkernel.vdb import VdbFile, read_vdb, write_vdb
from voxkernel.voxels import KernelGrid, violation_grid, voxel_kernel

__all__ = [
    "Candidate",
    "CellKernels",
    "Certificate",
    "CoverageCertificate",
    "DefectProfile",
    "Domain",
    "EvaluateSettings",
    "EvaluationResult",
    "GridReadError",
    "HalfSpaces",
    "Harmonics",
    "Kernel",
    "KernelGrid",
    "KernelMoments",
    "KernelPoints",
    "KernelPolytope",
    "MeshError",
    "MeshFacts",
    "MeshReadError",
    "PairRegistration",
    "PolyhedralMesh",
    "RadialGrid",
    "ReconstructionError",
    "Registration",
    "RepairChange",
    "RepairResult",
    "SolverError",
    "SparseGrid",
    "SphereGrid",
    "SphericalMap",
    "StarCenter",
    "Starshapeness",
    "TriangleMesh",
    "VdbFile",
    "VisibleFraction",
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
