"""Polyhedral meshes -> the kernel of every cell: `cell_kernels`."""

from __future__ import annotations

import os
from typing import Any

from voxkernel._checks import as_depth, as_nonnegative
from voxkernel.polyhedral.cell_solver import CellKernels, solve
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh
from voxkernel.polyhedral.read_polyhedral import read_polyhedral

__all__ = ["cell_kernels"]


def cell_kernels(mesh: Any, *, planarity_rtol: float = 1e-9, threads: int = 1) -> CellKernels:
    """Compute the kernel of every cell of a polyhedral mesh.

    Parameters
    ----------
    mesh : PolyhedralMesh, or a path
        Anything `read_polyhedral` takes, or its result.
    planarity_rtol : float
        Faces less planar than this, for their size, count as their triangles; as `TriangleMesh.from_polygons`.
    threads : int
        Threads, at least 1; the result does not depend on it.

    Returns
    -------
    CellKernels
        One row per cell. A cell that is open, inconsistently oriented, inside out or without volume is a
        row with its reason, never an error.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the mesh or a number cannot be used.

    Notes
    -----
    A compiled loop makes the planes, finds the largest ball between them by a dual simplex and decides by signs
    with error bounds: solid where a point is certainly inside, empty where a few planes certainly exclude each
    other, the cell itself where no vertex is in front of a plane (exactly). What stays undecided, and every
    kernel that is flat or too thin for floating point, goes to the code of `exact_kernel`, so the answers agree.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = PolyhedralMesh.from_cells([(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])])
    >>> kernels = cell_kernels(mesh)
    >>> kernels.dimension.tolist(), kernels.volume_share.tolist(), round(float(kernels.inradius[0]), 6)
    ([3], [1.0], 0.211325)
    """
    if isinstance(mesh, str | os.PathLike):
        mesh = read_polyhedral(mesh)
    if not isinstance(mesh, PolyhedralMesh):
        raise TypeError(f"`mesh` must be a PolyhedralMesh or a path; got {type(mesh).__name__}")
    rtol = as_nonnegative("planarity_rtol", planarity_rtol)
    return solve(mesh, rtol, as_depth("threads", threads, 1, 256))
