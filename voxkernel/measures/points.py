"""Kernel -> points and Open3D clouds: `kernel_points`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, read_only
from voxkernel._frozen import Frozen
from voxkernel.exact import KernelPolytope
from voxkernel.grid import SparseGrid
from voxkernel.mesh.surface_samples import spread_samples
from voxkernel.mesh.triangles import doubled_normals
from voxkernel.voxels import KernelGrid

__all__ = ["KernelPoints", "kernel_points"]

_MOST_CUBES = 256  # cubes tried for each point that is wanted


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class KernelPoints(Frozen):
    """A kernel as points with weights.

    Attributes
    ----------
    interior : (n, 3) float64
        Points inside the kernel, world coordinates.
    interior_weights : (n,) float64
        The volume each stands for, mesh units cubed; they add up to the volume certainly inside.
    boundary : (m, 3) float64
        Points on the boundary: centres of undecided voxels, or samples of a polytope's faces.
    boundary_weights : (m,) float64
        Half the volume of the undecided voxel, or the area (length for a segment, 1 for a point) that the
        sample stands for.
    """

    interior: NDArray[np.float64]
    interior_weights: NDArray[np.float64]
    boundary: NDArray[np.float64]
    boundary_weights: NDArray[np.float64]

    def __repr__(self) -> str:
        """Name the counts."""
        return f"KernelPoints(interior={len(self.interior)}, boundary={len(self.boundary)})"

    def to_open3d(self, which: Literal["interior", "boundary", "all"] = "all") -> Any:
        """Give an `open3d.geometry.PointCloud` with a copy of the points, without the weights.

        Raises
        ------
        ValueError
            If `which` is none of the three.
        """
        from voxkernel._open3d import open3d

        parts = {"interior": (self.interior,), "boundary": (self.boundary,), "all": (self.interior, self.boundary)}
        if which not in parts:
            raise ValueError(f"`which` must be 'interior', 'boundary' or 'all'; got {which!r}")
        geometry = open3d()
        return geometry.geometry.PointCloud(geometry.utility.Vector3dVector(np.concatenate(parts[which])))


def kernel_points(kernel: KernelPolytope | KernelGrid, *, n_points: int = 4096) -> KernelPoints:
    """Turn a kernel into points.

    Parameters
    ----------
    kernel : KernelPolytope or KernelGrid
        Exact or relaxed kernel.
    n_points : int
        Of a polytope: about this many samples, spread evenly over its faces. Of a grid: voxels are joined,
        eight to one, until there are at most this many interior and this many boundary points; 8 to 10**8.

    Returns
    -------
    KernelPoints
        No points for an empty kernel. A point, a segment and a flat kernel have boundary points only.

    Raises
    ------
    TypeError
        If `kernel` is neither.
    ValueError
        If `n_points` is out of range.

    Notes
    -----
    Nothing is random: the same kernel gives the same points. The points of a polytope move with it, those
    of a grid are centres of voxels. The interior of a polytope is a grid of cubes along its principal
    axes, each weighed by its share of the volume, so that their moments are those of the solid to the
    size of a cube.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> points = kernel_points(voxkernel.exact_kernel(tetrahedron))
    >>> float(points.interior_weights.sum().round(9)), bool((points.interior.sum(axis=1) < 1).all())
    (0.166666667, True)
    """
    count = as_depth("n_points", n_points, 8, 10**8)
    if isinstance(kernel, KernelPolytope):
        parts = _of_polytope(kernel, count)
    elif isinstance(kernel, KernelGrid):  # pyright: ignore[reportUnnecessaryIsInstance]
        inside, weights = _of_grid(kernel.inside, count)
        border, border_weights = _of_grid(kernel.boundary, count)
        parts = inside, weights, border, 0.5 * border_weights
    else:
        raise TypeError(f"`kernel` must be a KernelPolytope or a KernelGrid; got {type(kernel).__name__}")
    return KernelPoints(*(read_only(np.ascontiguousarray(p)) for p in parts))


def _of_grid(grid: SparseGrid, most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the mean point and the volume of each block of voxels, in blocks just large enough."""
    voxels = grid.to_ijk().astype(np.int64)
    weight = abs(float(np.linalg.det(grid.linear)))
    step = 0
    blocks, index, counts = voxels, np.arange(len(voxels)), np.ones(len(voxels))
    while len(blocks) > most:
        step += 1
        blocks, index = np.unique(voxels >> step, axis=0, return_inverse=True)
        counts = np.bincount(index.ravel()).astype(np.float64)
    sums = [np.bincount(index.ravel(), weights=voxels[:, k], minlength=len(blocks)) for k in range(3)]
    middles = np.stack(sums, axis=1) / counts[:, None] if len(voxels) else np.empty((0, 3))
    return grid.index_to_world(middles), weight * counts


def _of_polytope(
    kernel: KernelPolytope, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    nowhere, nothing = np.empty((0, 3)), np.empty(0)
    if kernel.dimension < 0:
        return nowhere, nothing, nowhere, nothing
    if kernel.dimension < 2 or not len(kernel.face_facets):
        return nowhere, nothing, *_of_segment(kernel.vertices, count)
    triangles = np.concatenate([[(f[0], a, b) for a, b in pairwise(f[1:])] for f in kernel.faces])
    border, _, border_weights = spread_samples(kernel.vertices, triangles, count)
    if kernel.dimension < 3 or kernel.volume <= 0:
        return nowhere, nothing, border, border_weights
    return *_fill(kernel, count), border, border_weights


def _of_segment(vertices: NDArray[np.float64], count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if len(vertices) < 2:
        return vertices[:1].copy(), np.ones(len(vertices[:1]))
    at = (np.arange(count)[:, None] + 0.5) / count
    length = float(np.linalg.norm(vertices[1] - vertices[0]))
    return vertices[0] + at * (vertices[1] - vertices[0]), np.full(count, length / count)


def _fill(kernel: KernelPolytope, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Take the centres of cubes that lie in the polytope, and share its volume among them."""
    _, axes = np.linalg.eigh(kernel.inertia)
    if np.linalg.det(axes) < 0.0:  # a reflection would turn the faces inside out
        axes[:, 0] = -axes[:, 0]
    local = (kernel.vertices - kernel.centroid) @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    rows = kernel.to_mesh()
    corners = local[rows.plane_corners]
    normals = doubled_normals(corners)
    offsets = np.einsum("ij,ij->i", normals, corners[:, 0])
    step = (kernel.volume / count) ** (1.0 / 3.0)
    # Of a kernel that is thin in one direction or two, cubes of that volume would be more than there is memory for.
    step = max(step, float((high - low).max()) / (_MOST_CUBES * count))
    while np.prod(np.maximum(1.0, np.ceil((high - low) / step))) > _MOST_CUBES * count:
        step *= 1.25
    found = np.empty((0, 3))
    for _ in range(8):
        numbers = np.maximum(1, np.ceil((high - low) / step)).astype(np.int64)
        ticks = [
            0.5 * (a + b) + step * (np.arange(n) - 0.5 * (n - 1)) for a, b, n in zip(low, high, numbers, strict=True)
        ]
        boxes = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
        for normal, offset in zip(normals, offsets, strict=True):
            boxes = boxes[boxes @ normal <= offset]
        found = boxes
        if len(found) * 4 >= count:
            break
        step *= 0.6
        if np.prod(np.maximum(1.0, np.ceil((high - low) / step))) > _MOST_CUBES * count:
            break
    if not len(found):
        found = np.zeros((1, 3))
    return kernel.centroid + found @ axes.T, np.full(len(found), kernel.volume / len(found))
