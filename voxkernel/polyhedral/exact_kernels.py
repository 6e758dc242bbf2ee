"""Many small closed surfaces -> the exact verdict on each kernel in one compiled pass: `exact_kernels`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_integers, as_points, check_index_range, read_only
from voxkernel._notebook import html_of
from voxkernel.errors import MeshError
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.polyhedral.cell_solver import CellKernels, solve
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh

__all__ = ["PackedSurfaces", "exact_kernels"]


class PackedSurfaces(NamedTuple):
    """Surfaces of triangles one behind the other, for `exact_kernels`.

    Attributes
    ----------
    vertices : (n, 3) float64
        World coordinates.
    faces : (m, 3) int64
        Ids of vertices, counter-clockwise seen from outside; surfaces may have vertices in common.
    face_starts : (k + 1,) int64
        Surface i has the triangles ``faces[face_starts[i]:face_starts[i + 1]]``.
    """

    vertices: ArrayLike
    faces: ArrayLike
    face_starts: ArrayLike

    _repr_html_ = html_of


def exact_kernels(surfaces: PackedSurfaces | Iterable[MeshLike], *, threads: int = 1) -> CellKernels:
    """Decide the kernels of many small closed surfaces, a row each.

    Parameters
    ----------
    surfaces : sequence of meshes, or PackedSurfaces
        Anything `as_mesh` takes, with triangles counter-clockwise seen from outside; or all of them in three arrays,
        which saves packing them.
    threads : int
        Threads, at least 1; the result does not depend on it.

    Returns
    -------
    CellKernels
        One row per surface: dimension and proof, volumes, a largest ball. `exact_kernel` gives the polytope of one. A
        surface that is open, inconsistently oriented, inside out or without volume is a row with its reason.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If a surface cannot be read, one has polygons, a shape or an index is wrong, or there is none.

    Notes
    -----
    The loop of `cell_kernels`: every sign is taken with a bound on its error, and what stays undecided, kernels that
    are flat or thin among it, is decided by the code of `exact_kernel`. So `dimension` is exact for the doubles given.
    Volumes and radii are right to 1e-9 of themselves.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> tetrahedron = (corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> found = exact_kernels([tetrahedron, tetrahedron])
    >>> found.dimension.tolist(), found.decided_by
    ([3, 3], ('convex', 'convex'))
    """
    n_threads = as_depth("threads", threads, 1, 256)
    packed = surfaces if isinstance(surfaces, PackedSurfaces) else _packed(surfaces)
    vertices = as_points("surfaces.vertices", packed.vertices, error=MeshError)
    faces = as_integers("surfaces.faces", packed.faces, shape="(m, 3)", ndim=2, columns=3, error=MeshError)
    starts = as_integers("surfaces.face_starts", packed.face_starts, shape="(n,)", ndim=1, error=MeshError)
    if len(starts) < 2:
        raise MeshError("`surfaces` must hold at least one surface; got 0")
    if starts[0] != 0 or starts[-1] != len(faces) or (np.diff(starts) < 0).any():
        raise MeshError(f"`surfaces.face_starts` must rise from 0 to {len(faces)}; got {_ends(starts)}")
    check_index_range("surfaces.faces", faces, len(vertices), error=MeshError)
    m = len(faces)
    mesh = PolyhedralMesh(
        vertices=vertices,  # the mesh is left behind: views of what was given will do
        face_offsets=read_only(np.arange(0, 3 * m + 1, 3)),
        face_vertices=faces.reshape(-1),
        cell_offsets=starts,
        cell_faces=read_only(np.arange(m)),
        cell_flips=read_only(np.zeros(m, np.bool_)),
        problems=("",) * (len(starts) - 1),
        n_turned=0,
        oriented_by="file",
        source="surfaces",
    )
    return solve(mesh, 1e-9, n_threads)


def _ends(starts: NDArray[np.int64]) -> str:
    falls = " with a fall between" if (np.diff(starts) < 0).any() else ""
    return f"{starts[0]} to {starts[-1]}{falls}"


def _packed(surfaces: object) -> PackedSurfaces:
    """Put meshes one behind the other."""
    if isinstance(surfaces, TriangleMesh | str | bytes | np.ndarray) or not isinstance(surfaces, Iterable):
        raise TypeError(f"`surfaces` must be a sequence of meshes or PackedSurfaces; got {type(surfaces).__name__}")
    meshes: list[TriangleMesh] = []
    for i, surface in enumerate(surfaces):
        mesh = as_mesh(surface)
        if mesh.plane_corners is not mesh.faces:
            raise MeshError(f"`surfaces` must be of triangles; got polygons in surface {i} (`cell_kernels` takes them)")
        meshes.append(mesh)
    if not meshes:
        raise MeshError("`surfaces` must hold at least one surface; got 0")
    shifts = np.concatenate([[0], np.cumsum([len(mesh.vertices) for mesh in meshes])])
    counts = [len(mesh.faces) for mesh in meshes]
    faces: Any = np.concatenate([mesh.faces for mesh in meshes])
    return PackedSurfaces(
        np.concatenate([mesh.vertices for mesh in meshes]),
        faces + np.repeat(shifts[:-1], counts)[:, None],
        np.concatenate([[0], np.cumsum(counts)]),
    )
