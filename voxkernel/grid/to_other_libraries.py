"""`SparseGrid` -> Open3D and PyVista."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.grid.leaf_bits import unpack
from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["to_open3d_points", "to_open3d_voxels", "to_pyvista_cells", "to_pyvista_image"]


def to_open3d_points(grid: SparseGrid, *, max_voxels: int = 50_000_000) -> Any:
    """Centres of the active voxels as a point cloud.

    Parameters
    ----------
    grid : SparseGrid
        Any transform.
    max_voxels : int, default 50 million
        Refuse to expand more.

    Returns
    -------
    open3d.geometry.PointCloud
        In the order of `SparseGrid.to_ijk`; empty for an empty grid.

    Raises
    ------
    ValueError
        If there are more than `max_voxels` active voxels.

    Examples
    --------
    >>> import numpy as np
    >>> np.asarray(to_open3d_points(SparseGrid.from_ijk([[0, 0, 0]], voxel_size=2)).points)
    array([[1., 1., 1.]])
    """
    from voxkernel._open3d import open3d

    o3d = open3d()
    centres = grid.index_to_world(grid.to_ijk(max_voxels=max_voxels))
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(centres))


def to_open3d_voxels(grid: SparseGrid, *, max_voxels: int = 10_000_000) -> Any:
    """Active voxels as an Open3D voxel grid.

    Parameters
    ----------
    grid : SparseGrid
        With cubic voxels, turned or not.
    max_voxels : int, default 10 million
        Refuse to expand more.

    Returns
    -------
    open3d.geometry.VoxelGrid
        Its voxel (0, 0, 0) is the lowest corner of `active_bbox`; values are not kept.

    Raises
    ------
    ValueError
        If voxels are not cubes, the axes are left-handed, or there are more than `max_voxels`.

    Examples
    --------
    >>> voxels = to_open3d_voxels(SparseGrid.from_ijk([[3, 0, 0], [4, 0, 0]], voxel_size=0.5))
    >>> len(voxels.get_voxels()), voxels.origin.tolist()
    (2, [1.5, 0.0, 0.0])
    """
    from voxkernel._open3d import open3d

    size, rotation = _size_and_rotation(grid)
    ijk = grid.to_ijk(max_voxels=max_voxels)
    o3d = open3d()
    if not len(ijk):
        return o3d.geometry.VoxelGrid()
    low = ijk.min(axis=0)
    local = (ijk - low + 0.5) * size
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(local))
    top = (ijk.max(axis=0) - low + 1.0) * size
    voxels = o3d.geometry.VoxelGrid.create_from_point_cloud_within_bounds(cloud, size, np.zeros(3), top)
    voxels.origin = grid.origin + grid.linear @ low
    if (rotation != np.eye(3)).any():
        voxels.rotation = rotation
    return voxels


def _size_and_rotation(grid: SparseGrid) -> tuple[float, NDArray[np.float64]]:
    """Edge and axes of cubic voxels."""
    size = grid.voxel_size
    rotation = grid.linear / size
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
        raise ValueError("`grid` must have cubic voxels and right-handed axes; see `linear`")
    return size, rotation


def to_pyvista_cells(grid: SparseGrid, *, max_cells: int = 20_000_000) -> Any:
    """Tiles and active leaf voxels as hexahedra: one cell per tile, however large.

    Parameters
    ----------
    grid : SparseGrid
        Any transform.
    max_cells : int, default 20 million
        Refuse to make more.

    Returns
    -------
    pyvista.UnstructuredGrid
        Cell data ``log2`` (edge in voxels) and, of a float grid, ``value``. Corners are not shared between
        cells.

    Raises
    ------
    ValueError
        If there are more than `max_cells` tiles and active leaf voxels.

    Examples
    --------
    >>> import numpy as np
    >>> cells = to_pyvista_cells(SparseGrid.from_dense(np.ones((16, 16, 17), dtype=bool)))
    >>> cells.n_cells, round(cells.volume)  # a tile of 16^3 and a sheet of 16 x 16 voxels
    (257, 4352)
    """
    pyvista = optional("pyvista")

    corner, edge, value = cells_of(grid, max_cells)
    points = hexahedron_corners(grid, corner, edge).reshape(-1, 3)
    n_cells = len(corner)
    connectivity = np.column_stack([np.full(n_cells, 8), np.arange(8 * n_cells).reshape(n_cells, 8)]).ravel()
    kinds = np.full(n_cells, int(pyvista.CellType.HEXAHEDRON), dtype=np.uint8)
    cells = pyvista.UnstructuredGrid(connectivity, kinds, points)
    cells.cell_data["log2"] = np.log2(edge).astype(np.int8)
    if value is not None:
        cells.cell_data["value"] = value
    return cells


def hexahedron_corners(
    grid: SparseGrid, corner: NDArray[np.int64], edge: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Eight world points a cell, (n, 8, 3), in the order of VTK's hexahedron."""
    steps = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    if np.linalg.det(grid.linear) < 0:
        steps = steps[:, [1, 0, 2]]
    return (corner[:, None] + steps * edge[:, None, None]) @ grid.linear.T + grid.origin


def cells_of(
    grid: SparseGrid, max_cells: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32] | None]:
    """Lower corner, edge and value of every tile and of every active voxel of a leaf."""
    n_voxels = grid.active_voxel_count - sum(8**e * int((grid.tile_log2 == e).sum()) for e in range(3, 24))
    if grid.tile_count + n_voxels > max_cells:
        raise ValueError(f"`max_cells` must be at least {grid.tile_count + n_voxels}; got {max_cells}")
    owner, bit = np.nonzero(unpack(grid.leaf_mask).reshape(-1, 512))
    local = np.stack([bit >> 6, (bit >> 3) & 7, bit & 7], axis=1)
    corner = np.concatenate([grid.tile_ijk.astype(np.int64), grid.leaf_ijk[owner] + local])
    tile_edge = np.int64(1) << grid.tile_log2.astype(np.int64)
    edge = np.concatenate([tile_edge, np.ones(len(owner), dtype=np.int64)])
    if grid.tile_values is None or grid.leaf_values is None:
        return corner, edge, None
    return corner, edge, np.concatenate([grid.tile_values, grid.leaf_values[owner, bit]])


def to_pyvista_image(grid: SparseGrid, *, max_voxels: int = 1 << 28) -> Any:
    """Bounding box of the active voxels as a dense image, for volume rendering.

    Parameters
    ----------
    grid : SparseGrid
        With rectangular voxels, turned or not.
    max_voxels : int, default 2**28
        Refuse to make a larger image.

    Returns
    -------
    pyvista.ImageData
        Cell data ``active`` (uint8), or ``value`` (float32) of a float grid. No cells for an empty grid.

    Raises
    ------
    ValueError
        If voxels are sheared, the axes are left-handed, or the box has more than `max_voxels`.

    Examples
    --------
    >>> image = to_pyvista_image(SparseGrid.from_ijk([[0, 0, 0], [0, 0, 2]], voxel_size=0.5))
    >>> image.n_cells, image["active"].tolist()
    (3, [1, 0, 1])
    """
    pyvista = optional("pyvista")

    edges = np.linalg.norm(grid.linear, axis=0)
    rotation = grid.linear / edges
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
        raise ValueError("`grid` must have rectangular voxels and right-handed axes; use to_pyvista_cells")
    dense = grid.to_dense(max_voxels=max_voxels)
    bbox = grid.active_bbox
    if bbox is None:
        return pyvista.ImageData()
    image = pyvista.ImageData(
        dimensions=tuple(n + 1 for n in dense.shape),
        spacing=tuple(edges.tolist()),
        origin=tuple((grid.origin + grid.linear @ bbox[0]).tolist()),
    )
    image.SetDirectionMatrix(*rotation.ravel().tolist())
    name = "active" if grid.is_mask else "value"
    image.cell_data[name] = (dense.astype(np.uint8) if grid.is_mask else dense).ravel(order="F")
    return image
