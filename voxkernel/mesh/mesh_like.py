"""`MeshLike`: all that functions take for a surface, for annotations and type checkers."""

import os
from typing import Any, Protocol, TypeAlias

from numpy.typing import ArrayLike

from voxkernel.mesh.triangle_mesh import TriangleMesh

__all__ = ["MeshLike"]


class _WithFaces(Protocol):
    """`trimesh.Trimesh`."""

    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class _WithTriangles(Protocol):
    """`open3d.geometry.TriangleMesh`."""

    @property
    def vertices(self) -> Any: ...
    @property
    def triangles(self) -> Any: ...


class _WithTensors(Protocol):
    """`open3d.t.geometry.TriangleMesh`."""

    @property
    def vertex(self) -> Any: ...
    @property
    def triangle(self) -> Any: ...


class _WithPolygons(Protocol):
    """`pyvista.PolyData`."""

    @property
    def points(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class _WithMatrices(Protocol):
    """`pymeshlab.Mesh`."""

    def vertex_matrix(self) -> Any: ...
    def face_matrix(self) -> Any: ...


class _WithCurrentMesh(Protocol):
    """`pymeshlab.MeshSet`."""

    def current_mesh(self) -> Any: ...


class _WithGeometry(Protocol):
    """`trimesh.Scene`."""

    @property
    def geometry(self) -> Any: ...
    @property
    def graph(self) -> Any: ...


class _WithCellTypes(Protocol):
    """`pyvista.UnstructuredGrid`."""

    @property
    def points(self) -> Any: ...
    @property
    def celltypes(self) -> Any: ...


class _WithCells(Protocol):
    """`meshio.Mesh`."""

    @property
    def points(self) -> Any: ...
    @property
    def cells(self) -> Any: ...


MeshLike: TypeAlias = (
    TriangleMesh
    | str
    | os.PathLike[str]
    | tuple[ArrayLike, ArrayLike]
    | list[Any]
    | dict[str, Any]
    | _WithFaces
    | _WithTriangles
    | _WithTensors
    | _WithPolygons
    | _WithMatrices
    | _WithCurrentMesh
    | _WithGeometry
    | _WithCellTypes
    | _WithCells
)
