"""A surface and its facts: files and foreign meshes in, a frozen `TriangleMesh` out.

Nothing is changed silently; `repair` changes what it is asked to and says what it did.
"""

from voxkernel.mesh.as_mesh import as_mesh
from voxkernel.mesh.facts import MeshFacts
from voxkernel.mesh.mesh_like import MeshLike
from voxkernel.mesh.repair import RepairChange, RepairResult, repair
from voxkernel.mesh.triangle_mesh import TriangleMesh

__all__ = [
    "MeshFacts",
    "MeshLike",
    "RepairChange",
    "RepairResult",
    "TriangleMesh",
    "as_mesh",
    "repair",
]
