"""Kernel -> volume, centroid, covariance and principal frame, as exact sums: `kernel_moments`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._frozen import Frozen
from voxkernel.exact import KernelPolytope
from voxkernel.grid import SparseGrid
from voxkernel.grid.leaf_bits import unpack
from voxkernel.mesh.triangles import doubled_normals
from voxkernel.voxels import KernelGrid

__all__ = ["KernelMoments", "kernel_moments", "moments_of"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class KernelMoments(Frozen):
    """Mass, centroid and covariance of a kernel, with its principal frame.

    Attributes
    ----------
    dimension : int
        Of the set that was measured: 3 volume, 2 area, 1 length, 0 a point, -1 nothing.
    mass : float
        Volume, area or length, mesh units to the power `dimension`; 1 for a point, 0 for nothing.
    centroid : (3,) float64
        World coordinates; NaN when empty.
    covariance : (3, 3) float64
        The mean of (x - c)(x - c)^T, mesh units squared; zero for a point, NaN when empty.
    axes : (3, 3) float64
        Rows are unit principal axes, longest first, right-handed. Their signs are arbitrary, and so are
        the axes themselves where spreads are equal.
    spread : (3,) float64
        Standard deviation along each axis, mesh units, in descending order.
    """

    dimension: int
    mass: float
    centroid: NDArray[np.float64]
    covariance: NDArray[np.float64]
    axes: NDArray[np.float64]
    spread: NDArray[np.float64]

    def __repr__(self) -> str:
        """Name dimension, mass and spread."""
        spread = ", ".join(f"{v:.6g}" for v in self.spread)
        return f"KernelMoments(dimension={self.dimension}, mass={self.mass:.6g}, spread=({spread}))"

    @property
    def is_empty(self) -> bool:
        """Whether there was nothing to measure."""
        return self.dimension < 0

    @property
    def axis_gaps(self) -> NDArray[np.float64]:
        """How much shorter each axis is than the one before, (2,): 0 equal, 1 flat; 0 where both are 0."""
        longer = self.spread[:-1]
        return np.where(longer > 0, 1.0 - self.spread[1:] / np.where(longer > 0, longer, 1.0), 0.0)


def kernel_moments(kernel: KernelPolytope | KernelGrid) -> KernelMoments:
    """Compute centroid, covariance and principal frame of a kernel without sampling it.

    Parameters
    ----------
    kernel : KernelPolytope or KernelGrid
        Of a grid the inside voxels count whole and the undecided ones half.

    Returns
    -------
    KernelMoments
        Of the polytope's own dimension: a flat kernel has the moments of its polygon, a segment those of
        the segment. Dimension -1 and NaN for an empty kernel.

    Raises
    ------
    TypeError
        If `kernel` is neither.

    Notes
    -----
    Exact sums over faces, tiles and voxels, up to float64 rounding; a voxel is a cube, not its centre.
    O(faces) or O(tiles + leaves).

    Examples
    --------
    >>> import voxkernel
    >>> box = voxkernel.exact_kernel(([[x, y, z] for x in (0, 6) for y in (0, 2) for z in (0, 1)],
    ...     [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    ...      [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]))
    >>> moments = kernel_moments(box)
    >>> moments.centroid.round(9).tolist(), (12 * moments.spread**2).round(9).tolist()
    ([3.0, 1.0, 0.5], [36.0, 4.0, 1.0])
    """
    if isinstance(kernel, KernelPolytope):
        return _of_polytope(kernel)
    if isinstance(kernel, KernelGrid):  # pyright: ignore[reportUnnecessaryIsInstance]
        return moments_of(((kernel.inside, 1.0), (kernel.boundary, 0.5)))
    raise TypeError(f"`kernel` must be a KernelPolytope or a KernelGrid; got {type(kernel).__name__}")


def moments_of(parts: tuple[tuple[SparseGrid, float], ...]) -> KernelMoments:
    """Add up the moments of grids on the same voxels, each with its own density."""
    grid = parts[0][0]
    pivot = _pivot(parts)
    sums = np.zeros(10)
    for part, density in parts:
        sums += density * (_tile_sums(part, pivot) + _leaf_sums(part, pivot))
    if sums[0] == 0.0:
        return _made(-1, 0.0, np.full(3, np.nan), np.full((3, 3), np.nan))
    mean = sums[1:4] / sums[0]
    second = np.empty((3, 3))
    second[np.triu_indices(3)] = sums[4:] / sums[0]
    second = np.triu(second) + np.triu(second, 1).T
    covariance = second - np.outer(mean, mean) + np.eye(3) / 12.0  # a voxel is a unit cube
    linear = grid.linear
    volume = sums[0] * abs(float(np.linalg.det(linear)))
    centroid = grid.origin + linear @ (mean + pivot)
    return _made(3, volume, centroid, linear @ covariance @ linear.T)


def _pivot(parts: tuple[tuple[SparseGrid, float], ...]) -> NDArray[np.float64]:
    """Give a point near the voxels, so that sums of squares do not cancel."""
    boxes = [box for grid, _ in parts if (box := grid.active_bbox) is not None]
    if not boxes:
        return np.zeros(3)
    return 0.5 * (np.min([b[0] for b in boxes], axis=0) + np.max([b[1] for b in boxes], axis=0) + 1.0)


def _tile_sums(grid: SparseGrid, pivot: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum 1, x, y, z and xx, xy, xz, yy, yz, zz over the voxel centres of all tiles."""
    edge = np.ldexp(1.0, grid.tile_log2.astype(np.int64))
    mass = edge**3
    middle = grid.tile_ijk + 0.5 * edge[:, None] - pivot
    own = mass * (edge**2 - 1.0) / 12.0  # of voxel centres about the tile's centre
    second = (middle * mass[:, None]).T @ middle + np.eye(3) * own.sum()
    return np.concatenate([[mass.sum()], mass @ middle, second[np.triu_indices(3)]])


def _leaf_sums(grid: SparseGrid, pivot: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum the same over the set bits of all leaves."""
    local = np.indices((8, 8, 8)).reshape(3, 512).T + 0.5
    rows, columns = np.triu_indices(3)
    basis = np.column_stack([np.ones(512), local, local[:, rows] * local[:, columns]])
    sums = np.zeros(10)
    for start in range(0, len(grid.leaf_ijk), 4096):
        bits = unpack(grid.leaf_mask[start : start + 4096]).reshape(-1, 512)
        part = bits.astype(np.float32) @ basis.astype(np.float32)  # sums of halves and quarters below 2**24: exact
        part = part.astype(np.float64)
        corner = grid.leaf_ijk[start : start + 4096] - pivot
        mass, first = part[:, 0], part[:, 1:4]
        sums[0] += mass.sum()
        sums[1:4] += (first + corner * mass[:, None]).sum(axis=0)
        mixed = first[:, rows] * corner[:, columns] + first[:, columns] * corner[:, rows]
        square = corner[:, rows] * corner[:, columns] * mass[:, None]
        sums[4:] += (part[:, 4:] + mixed + square).sum(axis=0)
    return sums


def _of_polytope(kernel: KernelPolytope) -> KernelMoments:
    """Read the moments of a solid; integrate a polygon by its triangles and a segment directly."""
    if kernel.dimension < 0:
        return _made(-1, 0.0, np.full(3, np.nan), np.full((3, 3), np.nan))
    if kernel.dimension == 3 and kernel.volume > 0:
        return _made(3, kernel.volume, kernel.centroid, kernel.inertia / kernel.volume)
    if kernel.dimension >= 2 and len(kernel.face_facets):
        corners = [
            np.stack([np.broadcast_to(ring[0], ring[1:-1].shape), ring[1:-1], ring[2:]], axis=1)
            for ring in (kernel.vertices[face] for face in kernel.faces)
        ]
        return _of_simplices(np.concatenate(corners), kernel.dimension)
    if kernel.dimension == 1 and len(kernel.vertices) > 1:
        return _of_simplices(kernel.vertices[None, :2], 1)
    return _made(0, 1.0, kernel.vertices.mean(axis=0), np.zeros((3, 3)))


def _of_simplices(corners: NDArray[np.float64], dimension: int) -> KernelMoments:
    """Moments of segments (n, 2, 3) or triangles (n, 3, 3)."""
    sides = corners[:, 1] - corners[:, 0] if corners.shape[1] == 2 else 0.5 * doubled_normals(corners)
    size = np.linalg.norm(sides, axis=1)
    total = float(size.sum())
    if total == 0.0:
        return _made(0, 1.0, corners.reshape(-1, 3).mean(axis=0), np.zeros((3, 3)))
    middles = corners.mean(axis=1)
    centroid = size @ middles / total
    count = corners.shape[1]
    offset, spot = corners - centroid, middles - centroid
    second = count**2 * (spot * size[:, None]).T @ spot
    for k in range(count):
        second += (offset[:, k] * size[:, None]).T @ offset[:, k]
    return _made(dimension, total, centroid, second / (count * (count + 1) * total))


def _made(
    dimension: int, mass: float, centroid: NDArray[np.float64], covariance: NDArray[np.float64]
) -> KernelMoments:
    axes, spread = np.eye(3), np.zeros(3)
    if dimension >= 0:
        values, vectors = np.linalg.eigh(covariance)
        axes = np.ascontiguousarray(vectors[:, ::-1].T)
        axes[2] = np.cross(axes[0], axes[1])
        spread = np.sqrt(np.maximum(values[::-1], 0.0))
    arrays: tuple[Any, ...] = (np.array(centroid), np.array(covariance), axes, spread)
    return KernelMoments(dimension, mass, *(read_only(a) for a in arrays))
