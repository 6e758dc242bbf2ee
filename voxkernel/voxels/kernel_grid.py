"""`KernelGrid`: a kernel as voxels certainly inside and voxels that are undecided."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_choice, as_depth, as_points, as_real
from voxkernel._frozen import Frozen
from voxkernel._thumbnail import ORANGE, PURPLE, thumbnail
from voxkernel._version import __version__
from voxkernel._viewing import plot_kernel
from voxkernel.errors import GridReadError
from voxkernel.exact.polygon_ply import write_polygon_ply
from voxkernel.grid import SparseGrid, to_surface, write_npz
from voxkernel.grid.npz import read_npz_file
from voxkernel.halfspaces import Domain
from voxkernel.mesh import MeshLike, TriangleMesh
from voxkernel.vdb import read_vdb, write_vdb
from voxkernel.voxels.certain_voxels import classify_points
from voxkernel.voxels.vtk_cells import write_vtp, write_vtu

__all__ = ["KernelGrid"]

_MOST_DRAWN = 2_000_000  # voxels in a picture for a notebook


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

    def _more_rows(self) -> dict[str, Any]:
        return {
            "voxel size": self.voxel_size, "voxels inside": f"{self.active_voxel_count:,}",
            "voxels undecided": f"{self.boundary.active_voxel_count:,}",
        }  # fmt: skip

    def _picture(self) -> str:
        if not 0 < self.active_voxel_count <= _MOST_DRAWN:
            return ""
        return thumbnail(*to_surface(self.inside), PURPLE if self.tolerance else ORANGE)

    @property
    def is_empty(self) -> bool:
        """Whether every voxel is certainly outside; a kernel whose voxels are all undecided is not called empty."""
        return not self.inside.active_voxel_count and not self.boundary.active_voxel_count

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

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points certainly lie in the kernel: in inside voxels, whatever is rounded.

        Parameters
        ----------
        points : (n, 3) array_like
            World coordinates.

        Returns
        -------
        (n,) bool
            False does not say that a point is outside: see `classify`.

        Raises
        ------
        TypeError, ValueError
            If `points` is not finite real (n, 3).
        """
        return self.classify(points) == 1

    def classify(self, points: ArrayLike) -> NDArray[np.int8]:
        """Tell which points certainly lie in the kernel, which certainly do not, and which are undecided.

        Parameters
        ----------
        points : (n, 3) array_like
            World coordinates.

        Returns
        -------
        (n,) int8
            1 inside, -1 outside, 0 undecided, in exact arithmetic on the doubles given. A point within rounding of a
            voxel face is held against the voxels on both sides.

        Raises
        ------
        TypeError, ValueError
            If `points` is not finite real (n, 3).

        Examples
        --------
        >>> import voxkernel
        >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> grid = voxkernel.voxel_kernel(tetrahedron, depth=6)
        >>> grid.classify([[0.2, 0.2, 0.2], [0.25, 0.25, 0.5], [0.5, 0.5, 0.5]])
        array([ 1,  0, -1], dtype=int8)
        """
        return classify_points(self.inside, self.boundary, as_points("points", points))

    def to_points(
        self, *, which: Literal["inside", "boundary"] = "inside", max_voxels: int = 50_000_000
    ) -> NDArray[np.float64]:
        """Give the centres of the inside or of the undecided voxels, (n, 3), world coordinates.

        Raises
        ------
        ValueError
            If `which` is unknown, or there are more than `max_voxels`.
        """
        grid = self.inside if as_choice("which", which, ("inside", "boundary")) == "inside" else self.boundary
        return grid.index_to_world(grid.to_ijk(max_voxels=max_voxels))

    def to_mesh(self) -> TriangleMesh:
        """Give the faces between inside voxels and the rest as triangles.

        Raises
        ------
        MeshError
            If no voxel is inside.
        """
        return TriangleMesh.from_triangles(*to_surface(self.inside), source="kernel grid")

    plot = plot_kernel

    def to_grids(self) -> dict[str, SparseGrid]:
        """Give both grids by name, in the order of files: "inside", "boundary"."""
        return {"inside": self.inside, "boundary": self.boundary}

    def to_dict(self) -> dict[str, Any]:
        """Give what describes the grid without its cells, as plain numbers and lists, ready for JSON."""
        box = self.active_bbox
        return {
            "depth": self.depth,
            "tolerance": self.tolerance,
            "dimension": self.dimension,
            "volume": self.volume,
            "volume_bounds": list(self.volume_bounds),
            "active_voxel_count": self.active_voxel_count,
            "boundary_voxel_count": self.boundary.active_voxel_count,
            "active_bbox": None if box is None else box.tolist(),
            "tiles": len(self.tile_ijk),
            "leaves": len(self.leaf_ijk),
            "voxel_size": self.voxel_size,
            "origin": self.origin.tolist(),
            "axes": self.axes.tolist(),
            "domain": None if self.domain is None else self.domain.kind,
            "reason": self.reason,
        }

    def file_metadata(self) -> dict[str, Any]:
        """Give what the cells do not tell, of types that a .vdb file has; `read` needs it."""
        entries: dict[str, Any] = {
            "volume_bounds": tuple(float(v) for v in self.volume_bounds),
            "alpha": float(self.tolerance),
            "depth": int(self.depth),
            "dimension": int(self.dimension),
            "voxkernel_version": __version__,
        }
        if self.domain is not None:
            entries["domain"] = self.domain.kind
        if self.reason:
            entries["reason"] = self.reason
        return entries

    def write(
        self,
        path: str | os.PathLike[str],
        *,
        metadata: Mapping[str, Any] | None = None,
        surface: MeshLike | None = None,
    ) -> None:
        """Write the grid; the suffix picks the format.

        Parameters
        ----------
        path : str or os.PathLike
            ``.npz``: everything, small. ``.vdb``: for other programs; of the domain only its kind. ``.ply``: the faces
            of the inside voxels as triangles; a file without vertices where there is none. ``.glb``: the same.
            ``.vtu``: tiles and voxels as hexahedra, for ParaView, with the cell data ``state`` (1 inside, 0
            undecided), ``level`` (the root cube is 0, a voxel `depth`) and ``violation``. ``.vtp``: the faces of the
            inside voxels, with the same data.
        metadata : mapping of str to bool, int, float or str, optional
            Further entries for .npz and .vdb.
        surface : mesh, path or (vertices, faces), optional
            Of which this is the kernel: .vtu and .vtp then have ``violation``, at the centre of each cell or triangle;
            0 inside the exact kernel.

        Raises
        ------
        ValueError
            If the suffix is none of these, or `metadata` or `surface` is given where it has no place.
        MeshError
            For a .glb of a grid without an inside voxel.
        OSError
            If the file cannot be written.
        """
        target, more = Path(path), dict(metadata or {})
        suffix = target.suffix.lower()
        if more and suffix not in (".npz", ".vdb"):
            raise ValueError(f"`metadata` must be left out of a {suffix}; got {sorted(more)}")
        if surface is not None and suffix not in (".vtu", ".vtp"):
            raise ValueError(f"`surface` must be left out of a {suffix}; got {type(surface).__name__}")
        if suffix == ".vdb":
            write_vdb(target, self, metadata=more)
        elif suffix == ".npz":
            if self.domain is not None:
                d = self.domain
                arrays = {"normals": d.normals, "offsets": d.offsets, "vertices": d.vertices}
                more["domain_polytope"] = {**{k: v.tolist() for k, v in arrays.items()}, "volume": d.volume}
            write_npz(target, self, metadata=more)
        elif suffix == ".ply":
            if self.active_voxel_count:
                self.to_mesh().write(target)
            else:
                write_polygon_ply(target, np.zeros((0, 3)), (), np.zeros(0, np.int64))
        elif suffix == ".glb":
            self.to_mesh().write(target)
        elif suffix in (".vtu", ".vtp"):
            (write_vtu if suffix == ".vtu" else write_vtp)(target, self, surface)
        else:
            known = ".npz, .vdb, .ply, .glb, .vtu or .vtp"
            raise ValueError(f"`path` must end in {known} for a kernel grid; got {os.fspath(path)!r}")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a kernel grid that `write`, `write_vdb`, `write_npz` or the command line wrote.

        Parameters
        ----------
        path : str or os.PathLike
            ``.npz`` or ``.vdb``.

        Returns
        -------
        KernelGrid
            The same voxels. From a .vdb `domain` is None, and tiles are those of OpenVDB.

        Raises
        ------
        ValueError
            If the suffix is neither.
        GridReadError
            If the file is missing, damaged, or does not hold a kernel grid.

        Examples
        --------
        >>> import os, tempfile, voxkernel
        >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> path = os.path.join(tempfile.mkdtemp(), "kernel.npz")
        >>> voxkernel.voxel_kernel(tetrahedron, depth=6).write(path)
        >>> voxkernel.KernelGrid.read(path).depth
        6
        """
        suffix = Path(path).suffix.lower()
        if suffix == ".npz":
            listed, about = read_npz_file(path)
        elif suffix == ".vdb":
            file = read_vdb(path)
            listed, about = file.grids, file.metadata
        else:
            raise ValueError(f"`path` must end in .npz or .vdb; got {os.fspath(path)!r}")
        try:
            return cls._from_file({grid.name: grid for grid in listed}, about)
        except (KeyError, TypeError, ValueError) as error:
            reason = f"no {error}" if isinstance(error, KeyError) else str(error)
            raise GridReadError(f"{os.fspath(path)}: `path` must hold a kernel grid: {reason}") from error

    @classmethod
    def _from_file(cls, grids: Mapping[str, SparseGrid], about: Mapping[str, Any]) -> Self:
        """Put a grid together from what a file says, once that fits together."""
        inside, boundary = grids["inside"], grids["boundary"]
        inside._check_partner(boundary)
        if not (inside.is_mask and boundary.is_mask and np.array_equal(inside.leaf_ijk, boundary.leaf_ijk)):
            raise ValueError("its grids must be masks that share their leaves")
        inside.voxel_size  # noqa: B018  raises where a voxel is no cube
        low, high = (as_real("volume_bounds", v) for v in about["volume_bounds"])
        tolerance = as_real("alpha", about["alpha"])
        if not 0.0 <= low <= high or not 0.0 <= tolerance <= 1.0:
            raise ValueError(f"its volume bounds and tolerance must be in order; got {low}, {high}, {tolerance}")
        return cls(
            inside=inside,
            boundary=boundary,
            depth=as_depth("depth", about["depth"], 0, 23),
            volume_bounds=(low, high),
            dimension=as_depth("dimension", about["dimension"], -1, 3),
            domain=_domain_from(str(about.get("domain", "")), about.get("domain_polytope")),
            reason=str(about.get("reason", "")),
            tolerance=tolerance,
        )


def _domain_from(kind: str, facts: Any) -> Domain | None:
    """The domain as `KernelGrid.write` put it into an .npz file."""
    if facts is None:
        return None
    if not isinstance(facts, dict) or not {"normals", "offsets", "vertices", "volume"} <= set(facts):
        raise ValueError("its domain is damaged")
    normals, offsets = as_points("normals", facts["normals"]), np.array(facts["offsets"], dtype=np.float64)
    if offsets.shape != (len(normals),) or not np.isfinite(offsets).all():
        raise ValueError("its domain is damaged")
    return Domain(kind, normals, offsets, as_points("vertices", facts["vertices"]), as_real("volume", facts["volume"]))
