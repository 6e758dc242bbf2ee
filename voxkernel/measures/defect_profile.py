"""How the relaxed kernel grows with the tolerance: `defect_profile`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_each, as_share, read_only
from voxkernel._frozen import Frozen
from voxkernel._plain import plain
from voxkernel._thumbnail import curve_svg
from voxkernel.halfspaces import Domain
from voxkernel.halfspaces.surface_arguments import SurfaceArgument, SurfaceLike, surface_argument
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.facet_weights import WeighedPlanes, weigh
from voxkernel.relaxed.root_cube import MIN_DEPTH, RootCube, root_cube
from voxkernel.relaxed.streamed_violation import StreamedWeights
from voxkernel.voxels.relaxed_octree import RelaxedCells, relaxed_cells_of
from voxkernel.voxels.streamed_relaxed import streamed_cells

__all__ = ["PROFILE_DEPTH", "DefectProfile", "defect_profile", "profile_of_planes", "profile_of_stream"]

_PROFILE = np.linspace(0.0, 0.5, 26)
PROFILE_DEPTH = 6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DefectProfile(Frozen):
    """The share of the domain that the relaxed kernels of a surface fill: a signature of its shape.

    It does not change when the surface is moved, turned or scaled, but for the width of its bounds.

    Attributes
    ----------
    tolerances : (k,) float64
        Shares of the surface that a point may not face.
    volume_share_bounds : (k, 2) float64
        Certain bounds on the volume of each relaxed kernel over the volume of the domain.
    domain : Domain
        Where the kernels were looked for.
    depth : int
        Of the grid the volumes were counted on.
    """

    tolerances: NDArray[np.float64]
    volume_share_bounds: NDArray[np.float64]
    domain: Domain
    depth: int

    def __repr__(self) -> str:
        """Name range and depth."""
        return f"DefectProfile({len(self.tolerances)} tolerances up to {self.tolerances.max():.6g}, depth={self.depth})"

    def _more_rows(self) -> dict[str, Any]:
        low, high = (float(v[-1]) for v in self.volume_share_bounds.T)
        return {"volume share at the end": f"{low:.6g} to {high:.6g}, at {self.tolerances[-1]:.6g}"}

    def _picture(self) -> str:
        return curve_svg(self.tolerances, self.volume_share, "#a34a9c") if len(self.tolerances) > 1 else ""

    @property
    def volume_share(self) -> NDArray[np.float64]:
        """Middle of the bounds, (k,)."""
        return self.volume_share_bounds.mean(axis=1)

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers, ready for JSON."""
        return plain({
            "tolerances": self.tolerances,
            "volume_share_bounds": self.volume_share_bounds,
            "domain": self.domain.kind,
            "depth": self.depth,
        })


def defect_profile(
    surface: SurfaceLike,
    *,
    tolerances: ArrayLike | None = None,
    depth: int = PROFILE_DEPTH,
    domain: Any = None,
    facets: Any = None,
    threads: int = 1,
) -> DefectProfile:
    """Compute how the volume of the relaxed kernel grows with the tolerance, in one traversal.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    tolerances : (k,) array_like, optional
        Shares of the surface by area, in [0, 1]; 0, 0.02, ... 0.5 by default.
    depth : int
        2**depth voxels along the bounding cube of the domain, 3 to 20; the bounds halve with each level.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        As for `best_center`: the convex hull of closed surfaces, the ball polytope about open ones. A "box"
        does not move with the surface.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    threads : int
        Threads; the result does not depend on it.

    Returns
    -------
    DefectProfile
        In the order of `tolerances`.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the surface, the domain or a number cannot be used.

    Notes
    -----
    The grid lies in the principal frame of the surface. The domain's volume is taken to be right to 1e-9.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> profile = voxkernel.defect_profile(tetrahedron, tolerances=[0.0, 0.5])
    >>> low, high = profile.volume_share_bounds[0].tolist()
    >>> low > 0.8, high
    (True, 1.0)
    """
    found = surface_argument(surface, facets)
    values = np.array(as_each("tolerances", _PROFILE if tolerances is None else tolerances, as_share))
    levels = as_depth("depth", depth, MIN_DEPTH, 20)
    n_threads = as_depth("threads", threads, 1, 256)
    return profile_of_planes(weigh(found.halfspaces), found, found.bounded_domain(domain), values, levels, n_threads)


def profile_of_planes(
    planes: WeighedPlanes,
    surface: SurfaceArgument,
    region: Domain,
    values: NDArray[np.float64],
    depth: int,
    threads: int,
) -> DefectProfile:
    """Count the voxels of all relaxed kernels."""
    cube, _ = root_cube(region.vertices, surface.own_axes())
    cells = relaxed_cells_of(planes, region, cube, depth, [float(v) for v in values], threads=threads, count_only=True)
    return _profile(cells, cube, region, values, depth)


def profile_of_stream(reader: SurfaceReader, region: Domain, values: NDArray[np.float64], depth: int) -> DefectProfile:
    """Count them for a stream, in the frame of the surface."""
    moments = reader.moments()
    cube, _ = root_cube(region.vertices, moments.axes(moments.spread))
    weights = StreamedWeights(reader, "area")
    cells = [streamed_cells(weights, region, cube, depth, float(v)) for v in values]
    return _profile(cells, cube, region, values, depth)


def _profile(
    cells: list[RelaxedCells], cube: RootCube, region: Domain, values: NDArray[np.float64], depth: int
) -> DefectProfile:
    voxel = (cube.edge / 2**depth) ** 3 / region.volume
    shares = np.array(
        [(c.n_inside * voxel * (1 - 1e-9), (c.n_inside + c.n_boundary) * voxel * (1 + 1e-9)) for c in cells]
    )
    return DefectProfile(read_only(values), read_only(np.minimum(shares, 1.0)), region, depth)
