"""`as_mesh`: the only file that knows paths and foreign mesh types."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_nonnegative, as_points
from voxkernel._extras import optional
from voxkernel.errors import MeshError
from voxkernel.mesh.containers import from_meshlab, from_scene, from_unstructured
from voxkernel.mesh.files import Polygons, merge_equal_corners, read_polygons
from voxkernel.mesh.mesh_like import MeshLike
from voxkernel.mesh.polygons import flatten_polygons
from voxkernel.mesh.triangle_mesh import TriangleMesh

__all__ = ["as_mesh"]

_ACCEPTED = (
    "a path, a TriangleMesh, a pair (vertices, faces), a dict of both, or a mesh of Open3D (legacy or tensor), "
    "trimesh, PyVista (PolyData, UnstructuredGrid), PyMeshLab or meshio"
)


def as_mesh(mesh: MeshLike, *, facets: ArrayLike | None = None, planarity_rtol: float = 1e-9) -> TriangleMesh:
    """Make a `TriangleMesh` of a file, of arrays, or of another library's mesh.

    Parameters
    ----------
    mesh : str, os.PathLike, TriangleMesh, (vertices, faces), or a foreign mesh
        - A path ending in ``.ply``, ``.off``, ``.obj``, ``.stl``, ``.vtp``, ``.gltf``, ``.glb``,
          ``.wrl``, or another suffix PyMeshLab reads (``.3ds .3mf .ctm .dae .fbx .tri .vmi .x3d``).
        - A pair of an (n, 3) array of coordinates and an (m, k) integer array or a sequence of polygons
          of any length; counter-clockwise seen from outside. Or a dict that has them as ``vertices`` and
          ``faces``, whatever else it holds.
        - `open3d.geometry.TriangleMesh`, `open3d.t.geometry.TriangleMesh`, `trimesh.Trimesh`,
          a `trimesh.Scene` of one geometry, where the scene puts it, `pyvista.PolyData` (or vtkPolyData),
          a `pyvista.UnstructuredGrid` of polygons, `pymeshlab.Mesh`, a `pymeshlab.MeshSet` of one mesh,
          `meshio.Mesh`.
        - A `TriangleMesh`, which is returned as it is.
    facets : (k,) integer ids or (n_facets,) bool mask, optional
        Keep only these facets (polygons of the input); see `TriangleMesh.restricted`.
    planarity_rtol : float
        A polygon is planar when all its corners lie within this times its diameter of one plane.

    Returns
    -------
    TriangleMesh
        Frozen copy: float64 vertices and int64 faces in the order of the input, nothing merged, moved or
        dropped. Only `.stl`, which repeats the coordinates of every corner, has equal positions merged
        into one vertex, and `source` says so.

    Raises
    ------
    MeshReadError
        If the file is missing, empty, of an unknown suffix, or not readable.
    MeshError
        If the content is no surface: no facets, none with an area, NaN or infinity, an index out of
        range, a wrong shape.
    TypeError
        If `mesh` is of another type.

    Notes
    -----
    Polygons of ``.ply``, ``.off``, ``.obj``, arrays, PyVista and meshio stay facets with one plane each;
    Open3D, trimesh, ``.stl`` and the formats read by PyMeshLab know triangles only. ``.wrl`` coordinates
    are rounded to float32 by PyMeshLab, and ``.gltf``, ``.glb`` and binary ``.stl`` hold float32.
    Point and line cells are passed over; facet ids count the polygons only.
    Files are read in stretches and never held whole: a million triangles take about a second, from text, too.

    Examples
    --------
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> as_mesh((square, [[0, 1, 2, 3]]))
    TriangleMesh(4 vertices, 2 faces, 1 facets, source='arrays')
    >>> as_mesh((square, [[0, 1, 2], [0, 2, 3]]), facets=[0]).n_facets
    1
    """
    rtol = as_nonnegative("planarity_rtol", planarity_rtol)
    made = mesh if isinstance(mesh, TriangleMesh) else _convert(mesh, rtol)
    return made if facets is None else made.restricted(facets)


def _convert(mesh: MeshLike, rtol: float) -> TriangleMesh:
    """Recognise a type by the names in its class hierarchy: nothing is imported to find out."""
    if isinstance(mesh, str | os.PathLike):
        return _from_file(mesh, rtol)
    if isinstance(mesh, tuple | list) and len(mesh) == 2:
        return _from_pair(mesh, rtol)
    if isinstance(mesh, dict) and "vertices" in mesh and "faces" in mesh:
        return _from_pair((mesh["vertices"], mesh["faces"]), rtol)
    given: Any = mesh
    for base in type(given).__mro__:
        root, name = base.__module__.split(".")[0], base.__name__
        if (root, name) == ("open3d", "TriangleMesh"):
            tensor = ".t.geometry" in base.__module__ or hasattr(given, "vertex")
            return _from_open3d_tensor(given) if tensor else _from_open3d(given)
        if (root, name) == ("trimesh", "Trimesh"):
            return TriangleMesh.from_triangles(given.vertices, given.faces, source="trimesh.Trimesh")
        if (root, name) == ("trimesh", "Scene"):
            return from_scene(given)
        if (root, name) in (("pymeshlab", "MeshSet"), ("pymeshlab", "Mesh")):
            return from_meshlab(given)
        if name == "vtkUnstructuredGrid":
            return from_unstructured(given, rtol)
        if name == "vtkPolyData":
            return _from_polydata(given, rtol)
        if (root, name) == ("meshio", "Mesh"):
            return _from_meshio(given, rtol)
    kind = type(given)
    if isinstance(mesh, dict):
        keys = ", ".join(map(repr, list(mesh)[:6])) or "none"  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
        raise TypeError(f"`mesh` must have `vertices` and `faces` where it is a dict; got the keys {keys}")
    raise TypeError(f"`mesh` must be {_ACCEPTED}; got {kind.__module__}.{kind.__qualname__}")


def _from_file(path: str | os.PathLike[str], rtol: float) -> TriangleMesh:
    content = read_polygons(path)
    source = os.fsdecode(path)
    name = f"'{source}'"
    if len(content.vertices) == 0:
        raise MeshError(f"{name} must hold vertices; got none")
    if len(content.sizes) == 0:
        raise MeshError(f"{name} must hold facets; got {len(content.vertices)} vertices without")
    if source.lower().endswith(".stl"):
        content = merge_equal_corners(content)
        source += " (equal corners merged)"
    try:
        return _build(content, rtol, source)
    except MeshError as error:
        raise MeshError(f"{name}: {error}") from error


def _build(content: Polygons, rtol: float, source: str) -> TriangleMesh:
    points = as_points("vertices", content.vertices, error=MeshError)
    if points is content.vertices:  # the mesh freezes its arrays, and these may be the caller's
        points = points.copy()
    return TriangleMesh._from_flat(points, content.flat, content.sizes, planarity_rtol=rtol, source=source)


def _from_pair(pair: Sequence[Any], rtol: float) -> TriangleMesh:
    vertices, faces = pair
    if isinstance(faces, np.ndarray) and faces.ndim == 2 and faces.shape[1] == 3:
        return TriangleMesh.from_triangles(vertices, faces)
    if isinstance(faces, np.ndarray) and faces.dtype != object and faces.ndim != 2:
        raise MeshError(f"`faces` must have shape (m, k); got {faces.shape}")
    return TriangleMesh.from_polygons(vertices, faces, planarity_rtol=rtol)


def _from_open3d(mesh: Any) -> TriangleMesh:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    return TriangleMesh.from_triangles(vertices, faces.reshape(-1, 3), source="open3d.geometry.TriangleMesh")


def _from_open3d_tensor(mesh: Any) -> TriangleMesh:
    if "positions" not in mesh.vertex or "indices" not in mesh.triangle:
        raise MeshError("`mesh` must have vertex.positions and triangle.indices; got a tensor mesh without")
    vertices, faces = mesh.vertex["positions"].cpu().numpy(), mesh.triangle["indices"].cpu().numpy()
    return TriangleMesh.from_triangles(vertices, faces, source="open3d.t.geometry.TriangleMesh")


def _from_polydata(mesh: Any, rtol: float) -> TriangleMesh:
    """Through VTK's own calls, which PyVista objects have too."""
    vtk_to_numpy = optional("vtkmodules.util.numpy_support").vtk_to_numpy

    if mesh.GetNumberOfStrips():
        n = mesh.GetNumberOfStrips()
        raise MeshError(f"`mesh` must have no triangle strips; got {n} (triangulate first)")
    polys = mesh.GetPolys()
    if mesh.GetNumberOfPoints() == 0 or polys.GetNumberOfCells() == 0:
        raise MeshError(f"`mesh` must have polygons; got {mesh.GetNumberOfPoints()} points without")
    offsets = np.asarray(vtk_to_numpy(polys.GetOffsetsArray()), dtype=np.int64)
    flat = np.array(vtk_to_numpy(polys.GetConnectivityArray()), dtype=np.int64)
    points = np.array(vtk_to_numpy(mesh.GetPoints().GetData()), dtype=np.float64)
    source = f"{type(mesh).__module__.split('.')[0]}.{type(mesh).__name__}"
    return _build(Polygons(points, flat, np.diff(offsets)), rtol, source)


def _from_meshio(mesh: Any, rtol: float) -> TriangleMesh:
    """Blocks in their order; a cell type that is neither polygon, line nor point is refused, not dropped."""
    flats: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    for block in mesh.cells:
        if block.type in ("vertex", "line", "line3"):
            continue
        if block.type not in ("triangle", "quad") and not block.type.startswith("polygon"):
            raise MeshError(f"`mesh` must hold triangles, quads or polygons; got cells of type {block.type}")
        flat, size = flatten_polygons(block.data)
        flats.append(flat)
        sizes.append(size)
    if not flats:
        raise MeshError("`mesh` must hold triangles, quads or polygons; got none")
    content = Polygons(mesh.points, np.concatenate(flats), np.concatenate(sizes))
    return _build(content, rtol, "meshio.Mesh")
