"""What holds meshes in other libraries: a scene, a set, a grid of cells of any kind. Each must hold one surface."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_points
from voxkernel._extras import optional
from voxkernel.errors import MeshError
from voxkernel.mesh.triangle_mesh import TriangleMesh

__all__ = ["from_meshlab", "from_scene", "from_unstructured"]

_POLYGONS = (5, 7, 9)  # VTK's numbers of triangle, polygon and quad
_PASSED_OVER = (1, 2, 3, 4)  # points and lines
_CELL_NAMES = {6: "triangle strip", 8: "pixel", 10: "tetrahedron", 11: "voxel", 12: "hexahedron", 13: "wedge",
               14: "pyramid", 42: "polyhedron"}  # fmt: skip


def from_scene(scene: Any) -> TriangleMesh:
    """A trimesh scene: its one mesh, where the scene puts it."""
    meshes = [g for g in scene.geometry.values() if any(base.__name__ == "Trimesh" for base in type(g).__mro__)]
    nodes = list(scene.graph.nodes_geometry)
    if len(meshes) != 1 or len(scene.geometry) != 1 or len(nodes) != 1:
        raise MeshError(
            f"`mesh` must be a scene of one mesh, placed once; got {len(meshes)} meshes, {len(scene.geometry)} "
            f"geometries and {len(nodes)} places (scene.to_mesh() joins them)"
        )
    motion, _ = scene.graph[nodes[0]]
    return _moved(np.array(meshes[0].vertices), meshes[0].faces, motion, "trimesh.Scene")


def from_meshlab(given: Any) -> TriangleMesh:
    """A mesh of PyMeshLab, or a set of one mesh, where its matrix puts it; PyMeshLab knows triangles."""
    source = f"pymeshlab.{type(given).__name__}"
    if type(given).__name__ == "MeshSet":
        n = given.mesh_number()
        if n != 1:
            raise MeshError(f"`mesh` must be a MeshSet of one mesh; got {n} (mesh_set.current_mesh() is one of them)")
        given = given.current_mesh()
    faces = np.array(given.face_matrix(), dtype=np.int64).reshape(-1, 3)
    if not len(faces):
        raise MeshError(f"`mesh` must have triangles; got {given.vertex_number()} vertices without")
    return _moved(np.array(given.vertex_matrix()), faces, given.transform_matrix(), source)


def from_unstructured(grid: Any, rtol: float) -> TriangleMesh:
    """A grid of VTK whose cells are polygons; points and lines are passed over, solids refused, not dropped."""
    vtk_to_numpy = optional("vtkmodules.util.numpy_support").vtk_to_numpy

    kinds = np.array([grid.GetCellType(i) for i in range(grid.GetNumberOfCells())], dtype=np.int64)
    is_polygon = np.isin(kinds, _POLYGONS)
    others = kinds[~is_polygon & ~np.isin(kinds, _PASSED_OVER)]
    if len(others):
        name = _CELL_NAMES.get(int(others[0]), f"type {others[0]}")
        raise MeshError(
            f"`mesh` must hold triangles, quads or polygons; got {len(others)} other cells, the first a {name} "
            f"(grid.extract_surface() is their surface)"
        )
    if not is_polygon.any():
        raise MeshError(f"`mesh` must have polygons; got {grid.GetNumberOfPoints()} points without")
    cells = grid.GetCells()
    offsets = np.asarray(vtk_to_numpy(cells.GetOffsetsArray()), dtype=np.int64)
    flat = np.array(vtk_to_numpy(cells.GetConnectivityArray()), dtype=np.int64)
    sizes = np.diff(offsets)
    points = as_points("vertices", np.array(vtk_to_numpy(grid.GetPoints().GetData()), np.float64), error=MeshError)
    source = f"{type(grid).__module__.split('.')[0]}.{type(grid).__name__}"
    kept = np.repeat(is_polygon, sizes)
    return TriangleMesh._from_flat(points, flat[kept], sizes[is_polygon], planarity_rtol=rtol, source=source)


def _moved(vertices: NDArray[np.float64], faces: Any, motion: Any, source: str) -> TriangleMesh:
    """The mesh under an affine map; under none its coordinates are as they were."""
    mesh = TriangleMesh.from_triangles(vertices, faces, source=source)
    matrix = np.array(motion, dtype=np.float64)
    return mesh if np.array_equal(matrix, np.eye(4)) else mesh.transformed(matrix)
