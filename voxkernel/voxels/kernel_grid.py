"""`KernelGrid`: a kernel as voxels certainly inside and voxels that are undecided."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points
from voxkernel._frozen import Frozen
from voxkernel.grid import SparseGrid
from voxkernel.halfspaces import Domain
from voxkernel.mesh import TriangleMesh

__all__ = ["KernelGrid"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class KernelGrid(Frozen):
    """A kernel as a sparse voxel grid: voxels certainly inside, and voxels that are undecided.

    Everything else is certainly outside. Inside voxels lie wholly in the kernel; the kernel lies wholly in
    inside and boundary voxels together; both hold in exact arithmetic on the input doubles.

    Attributes
    ----------
    inside, boundary : SparseGrid
        The two sets of voxels; they share their leaves and their transform.
    depth : int
        The root cube has 2**depth voxels an edge.
    volume_bounds : (float, float)
        The kernel's volume lies between them, mesh units cubed.
    dimension : int
        Dimension of the exact kernel inside the domain, -1 to 3.
    domain : Domain or None
        Where the kernel was looked for.
    reason : str
        Why the grid is empty or coarser than asked; "" otherwise.
    tolerance : float
        The share of the surface that a point of the kernel may not face; 0 for the exact kernel.

    Notes
    -----
    `origin` is the lower corner of voxel (0, 0, 0); a voxel centre is
    `origin + (ijk + 0.5) * voxel_size` along the grid axes.
    """

    inside: SparseGrid
    boundary: SparseGrid
    depth: int
    volume_bounds: tuple[float, float]
    dimension: int
    domain: Domain | None
    reason: str
    tolerance: float = 0.0

    def __repr__(self) -> str:
        """Name depth, voxel counts and volume bounds."""
        low, high = self.volume_bounds
        relaxed = f"tolerance={self.tolerance:.6g}, " if self.tolerance else ""
        return (
            f"KernelGrid({relaxed}depth={self.depth}, voxel_size={self.voxel_size:.6g}, "
            f"active_voxel_count={self.active_voxel_count}, volume_bounds=({low:.6g}, {high:.6g}))"
        )

    @property
    def tile_ijk(self) -> NDArray[np.int32]:
        """Lower corners of the tiles inside the kernel, (T, 3), in voxels."""
        return self.inside.tile_ijk

    @property
    def tile_log2(self) -> NDArray[np.int8]:
        """Edge of each tile is 2**tile_log2 voxels, (T,)."""
        return self.inside.tile_log2

    @property
    def leaf_ijk(self) -> NDArray[np.int32]:
        """Lower corners of the 8^3 leaves, (L, 3), multiples of 8."""
        return self.inside.leaf_ijk

    @property
    def leaf_inside(self) -> NDArray[np.uint64]:
        """Voxels inside the kernel, (L, 8): word = x, bit = y*8 + z."""
        return self.inside.leaf_mask

    @property
    def leaf_boundary(self) -> NDArray[np.uint64]:
        """Undecided voxels, (L, 8), same layout."""
        return self.boundary.leaf_mask

    @property
    def origin(self) -> NDArray[np.float64]:
        """World position of the lower corner of voxel (0, 0, 0), (3,)."""
        return self.inside.origin

    @property
    def voxel_size(self) -> float:
        """Edge of a voxel, mesh units."""
        return self.inside.voxel_size

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit directions of the grid axes as rows, (3, 3)."""
        return self.inside.linear.T / self.voxel_size

    @property
    def volume(self) -> float:
        """Estimate of the kernel's volume: the middle of `volume_bounds`."""
        return 0.5 * (self.volume_bounds[0] + self.volume_bounds[1])

    @property
    def active_voxel_count(self) -> int:
        """Number of voxels inside the kernel."""
        return self.inside.active_voxel_count

    @property
    def active_bbox(self) -> NDArray[np.int64] | None:
        """Smallest and largest ijk of the voxels inside the kernel, (2, 3); None when there is none."""
        return self.inside.active_bbox

    @property
    def nbytes(self) -> int:
        """Memory of tiles and masks in bytes; the leaf corners are shared and count once."""
        arrays = (self.tile_ijk, self.tile_log2, self.leaf_ijk, self.leaf_inside, self.leaf_boundary)
        return sum(a.nbytes for a in arrays)

    def index_to_world(self, ijk: ArrayLike) -> NDArray[np.float64]:
        """Map voxel indices (n, 3) to the world positions of their centres."""
        return self.inside.index_to_world(ijk)

    def world_to_index(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """Map world positions (n, 3) to continuous voxel indices; a voxel centre has integer ones."""
        return self.inside.world_to_index(xyz)

    def contains(self, points: ArrayLike) -> NDArray[np.int8]:
        """Classify points.

        Parameters
        ----------
        points : (n, 3) array_like
            World coordinates.

        Returns
        -------
        (n,) int8
            1 inside, -1 outside, 0 undecided. A point within rounding of a voxel face may be given
            the answer of either voxel.
        """
        xyz = as_points("points", points)
        answer = np.full(len(xyz), -1, np.int8)
        answer[self.boundary.points_in_grid(xyz)] = 0
        answer[self.inside.points_in_grid(xyz)] = 1
        return answer

    def to_points(
        self, *, which: Literal["inside", "boundary"] = "inside", max_voxels: int = 50_000_000
    ) -> NDArray[np.float64]:
        """Give the centres of the inside or of the undecided voxels, (n, 3), world coordinates."""
        grid = self.inside if which == "inside" else self.boundary
        return grid.index_to_world(grid.to_ijk(max_voxels=max_voxels))

    def to_mesh(self) -> TriangleMesh:
        """Give the faces between inside voxels and the rest as triangles.

        Raises
        ------
        MeshError
            If no voxel is inside.
        """
        from voxkernel.grid import to_surface

        return TriangleMesh.from_triangles(*to_surface(self.inside), source="kernel grid")
