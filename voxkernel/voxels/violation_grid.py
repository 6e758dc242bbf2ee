"""The violation near its minimum as a sparse field of floats: `violation_grid`."""

from __future__ import annotations

from typing import Any

from voxkernel._checks import as_depth, as_nonnegative, as_share
from voxkernel._core import violation_cells
from voxkernel.grid import SparseGrid
from voxkernel.halfspaces.surface_arguments import Frame, SurfaceLike, surface_argument
from voxkernel.relaxed.best_center import GAP, center_of_planes
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.root_cube import MIN_DEPTH, cube_arrays, root_cube

__all__ = ["violation_grid"]

_MARGIN = 0.1


def violation_grid(
    surface: SurfaceLike,
    *,
    depth: int = 6,
    tolerance: float | None = None,
    margin: float | None = None,
    domain: Any = None,
    frame: Frame = "world",
    facets: Any = None,
) -> SparseGrid:
    """Sample the violation near its minimum as a sparse field of floats.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    depth : int
        2**depth voxels along the bounding cube of the domain, 3 to 9.
    tolerance : float, optional
        Largest value that is kept, a share of the surface by area, in [0, 1].
    margin : float, optional
        Instead: how far that is above the smallest violation there is; 0.1 where neither is given.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        As for `best_center`.
    frame : {"world", "principal"}
        Grid axes: the world's, or the principal axes of the surface.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.

    Returns
    -------
    SparseGrid
        Float values: the violation at voxel centres in leaves, tiles where no facet plane crosses. Active
        where the centre is in the domain and the value is small enough; the background is 1.

    Raises
    ------
    ValueError
        If a number is out of range, or `tolerance` and `margin` are both given.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.

    Notes
    -----
    A picture of the field, not a bound: values are float32, and a plane within rounding of a voxel centre may
    count or not. 2 kB a leaf; the number of leaves grows 8x per level.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> field = voxkernel.violation_grid(tetrahedron, depth=4, tolerance=0.5, domain="box")
    >>> float(field.values_at([[1, 1, 1]])[0])
    0.0
    """
    if tolerance is not None and margin is not None:
        raise ValueError("`margin` must not be given together with `tolerance`; got both")
    levels = as_depth("depth", depth, MIN_DEPTH, 9)
    found = surface_argument(surface, facets)
    axes = found.axes(frame)
    planes = weigh(found.halfspaces)
    region = found.bounded_domain(domain)
    if tolerance is None:
        least = center_of_planes(planes, found, region, GAP).violation_bounds[1]
        share = least + (_MARGIN if margin is None else as_nonnegative("margin", margin))
    else:
        share = as_share("tolerance", tolerance)
    cube, _ = root_cube(region.vertices, axes)
    normals, offsets, reach, pads, weights, n_domain = cube_arrays(planes, region, cube, levels)
    most = int(min(share, 1.0) * UNITS) + planes.slack
    arrays = violation_cells(
        normals, offsets, reach + pads * 2.0 ** (levels + 1), weights, n_domain, most, float(UNITS), levels
    )
    tile_ijk, tile_log2, tile_values, leaf_ijk, leaf_mask, leaf_values = arrays
    return SparseGrid.from_tiles_and_leaves(
        tile_ijk, tile_log2, leaf_ijk, leaf_mask, tile_values=tile_values, leaf_values=leaf_values, background=1.0,
        origin=cube.corner, linear=cube.axes.T * (cube.edge / 2**levels), name="violation",
    )  # fmt: skip
