"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

# First of all: it says how to install where the compiled core is missing.
from voxkernel import _core_check as _core_check
from voxkernel._version import __version__ as __version__

TYPE_CHECKING = False  # from `typing`, which would have to be imported
if TYPE_CHECKING:
    from voxkernel.errors import GridReadError, MeshError, MeshReadError, MissingExtraError, SolverError, VoxKernelError
    from voxkernel.evaluation import EvaluateSettings, EvaluationResult, evaluate
    from voxkernel.exact import Certificate, Kernel, KernelPolytope, exact_kernel
    from voxkernel.grid import SparseGrid
    from voxkernel.guarding import (
        CertifiedParts,
        GuardBound,
        Guards,
        GuardsProgress,
        StarCover,
        StarPiece,
        guards,
        star_cover,
    )
    from voxkernel.halfspaces import Domain, HalfSpaces
    from voxkernel.labels import (
        LabelImage,
        LabelObjects,
        LabelStars,
        StarKernels,
        find_objects,
        label_stars,
        paint_labels,
        read_labels,
        star_polyhedra_kernels,
        write_labels,
    )
    from voxkernel.large import StreamedSurface, StreamProgress, stream_mesh
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
    from voxkernel.polyhedral import (
        CellKernels,
        PackedSurfaces,
        PolyhedralMesh,
        cell_kernels,
        exact_kernels,
        read_polyhedral,
    )
    from voxkernel.registration import (
        Candidate,
        JointRegistration,
        JudgedPair,
        PairRegistration,
        Registration,
        register,
        register_many,
        register_together,
    )
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
    from voxkernel.voxels import KernelGrid, violation_grid, voxel_kernel, voxel_kernels

__all__ = [
    "Candidate",
    "CellKernels",
    "Certificate",
    "CertifiedParts",
    "CoverageCertificate",
    "DefectProfile",
    "Domain",
    "EvaluateSettings",
    "EvaluationResult",
    "GridReadError",
    "GuardBound",
    "Guards",
    "GuardsProgress",
    "HalfSpaces",
    "Harmonics",
    "JointRegistration",
    "JudgedPair",
    "Kernel",
    "KernelGrid",
    "KernelMoments",
    "KernelPoints",
    "KernelPolytope",
    "LabelImage",
    "LabelObjects",
    "LabelStars",
    "MeshError",
    "MeshFacts",
    "MeshReadError",
    "MissingExtraError",
    "PackedSurfaces",
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
    "StarCover",
    "StarKernels",
    "StarPiece",
    "Starshapeness",
    "StreamProgress",
    "StreamedSurface",
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
    "exact_kernels",
    "find_objects",
    "guards",
    "kernel_moments",
    "kernel_points",
    "label_stars",
    "paint_labels",
    "read_labels",
    "read_polyhedral",
    "read_vdb",
    "register",
    "register_many",
    "register_together",
    "repair",
    "spherical_map",
    "star_cover",
    "star_polyhedra_kernels",
    "starshapeness",
    "stream_mesh",
    "violation",
    "violation_grid",
    "visible_fraction",
    "voxel_kernel",
    "voxel_kernels",
    "write_labels",
    "write_report",
    "write_vdb",
]

# Where each name comes from: that is imported when the name is first used.
_HOMES = {
    "Candidate": "registration",
    "CellKernels": "polyhedral",
    "Certificate": "exact",
    "CertifiedParts": "guarding",
    "CoverageCertificate": "spherical",
    "DefectProfile": "measures",
    "Domain": "halfspaces",
    "EvaluateSettings": "evaluation",
    "EvaluationResult": "evaluation",
    "GridReadError": "errors",
    "GuardBound": "guarding",
    "Guards": "guarding",
    "GuardsProgress": "guarding",
    "HalfSpaces": "halfspaces",
    "Harmonics": "spherical",
    "JointRegistration": "registration",
    "JudgedPair": "registration",
    "Kernel": "exact",
    "KernelGrid": "voxels",
    "KernelMoments": "measures",
    "KernelPoints": "measures",
    "KernelPolytope": "exact",
    "LabelImage": "labels",
    "LabelObjects": "labels",
    "LabelStars": "labels",
    "MeshError": "errors",
    "MeshFacts": "mesh",
    "MeshReadError": "errors",
    "MissingExtraError": "errors",
    "PackedSurfaces": "polyhedral",
    "PairRegistration": "registration",
    "PolyhedralMesh": "polyhedral",
    "RadialGrid": "spherical",
    "ReconstructionError": "spherical",
    "Registration": "registration",
    "RepairChange": "mesh",
    "RepairResult": "mesh",
    "SolverError": "errors",
    "SparseGrid": "grid",
    "SphereGrid": "spherical",
    "SphericalMap": "spherical",
    "StarCenter": "relaxed",
    "StarCover": "guarding",
    "StarKernels": "labels",
    "StarPiece": "guarding",
    "Starshapeness": "measures",
    "StreamProgress": "large",
    "StreamedSurface": "large",
    "TriangleMesh": "mesh",
    "VdbFile": "vdb",
    "VisibleFraction": "measures",
    "VoxKernelError": "errors",
    "as_mesh": "mesh",
    "best_center": "relaxed",
    "cell_kernels": "polyhedral",
    "defect_profile": "measures",
    "evaluate": "evaluation",
    "exact_kernel": "exact",
    "exact_kernels": "polyhedral",
    "find_objects": "labels",
    "guards": "guarding",
    "kernel_moments": "measures",
    "kernel_points": "measures",
    "label_stars": "labels",
    "paint_labels": "labels",
    "read_labels": "labels",
    "read_polyhedral": "polyhedral",
    "read_vdb": "vdb",
    "register": "registration",
    "register_many": "registration",
    "register_together": "registration",
    "repair": "mesh",
    "spherical_map": "spherical",
    "star_cover": "guarding",
    "star_polyhedra_kernels": "labels",
    "starshapeness": "measures",
    "stream_mesh": "large",
    "violation": "relaxed",
    "violation_grid": "voxels",
    "visible_fraction": "measures",
    "voxel_kernel": "voxels",
    "voxel_kernels": "voxels",
    "write_labels": "labels",
    "write_report": "report",
    "write_vdb": "vdb",
}
_FOLDERS = (
    "errors", "evaluation", "exact", "grid", "guarding", "halfspaces", "labels", "large", "measures", "mesh",
    "pictures", "polyhedral", "registration", "relaxed", "report", "spherical", "vdb", "view", "voxels",
)  # fmt: skip


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name in _HOMES:
        value = getattr(import_module(f"voxkernel.{_HOMES[name]}"), name)
    elif name in _FOLDERS:
        value = import_module(f"voxkernel.{name}")
    else:
        raise AttributeError(f"module 'voxkernel' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_FOLDERS})
