"""`SparseGrid` to other forms: .npz, Open3D, PyVista, a surface mesh, a linear octree."""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from voxkernel._grid_surface import exposed_faces
from voxkernel._input_file import input_file
from voxkernel._leaf_bits import unpack
from voxkernel._npz import DAMAGE, NpzArrays, read_json
from voxkernel.errors import GridReadError
from voxkernel.grid import SparseGrid

__all__ = [
    "LinearOctree",
    "read_npz",
    "to_linear_octree",
    "to_open3d_points",
    "to_open3d_voxels",
    "to_pyvista_cells",
    "to_pyvista_image",
    "to_surface",
    "write_npz",
]

_FORMAT = "voxkernel-grid"
_VERSION = 1
_ARRAYS = ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_mask", "tile_values", "leaf_values")
_INACTIVE = ("inactive_ijk", "inactive_log2", "inactive_values")


# -- .npz --------------------------------------------------------------------------------------------


def write_npz(path: str | os.PathLike[str], grids: SparseGrid | Iterable[SparseGrid]) -> None:
    """Write grids to a compressed .npz file: a few kilobytes for what is megabytes as .vdb.

    Parameters
    ----------
    path : path
        Replaced in one step; no suffix is added.
    grids : SparseGrid or iterable of SparseGrid
        In order.

    Raises
    ------
    TypeError
        If `grids` holds anything else, or metadata that JSON has no form for.

    Notes
    -----
    Arrays are named ``0.tile_ijk``, ``0.leaf_mask``, ..., ``1.tile_ijk``; the entry ``header`` is JSON with
    the format, its version (1), and each grid's name, class, background and metadata.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "a.npz")
    >>> write_npz(path, SparseGrid.from_ijk([[0, 0, 0]], name="inside"))
    >>> read_npz(path)
    (SparseGrid('inside', 1 active voxel, 0 tiles, 1 leaf, mask),)
    """
    listed = [grids] if isinstance(grids, SparseGrid) else list(grids)
    arrays: dict[str, NDArray[Any]] = {}
    described: list[dict[str, Any]] = []
    for n, grid in enumerate(listed):
        if not isinstance(cast(object, grid), SparseGrid):
            raise TypeError(f"`grids` must hold SparseGrid only; got {type(grid).__name__}")
        described.append(
            {
                "name": grid.name,
                "grid_class": grid.grid_class,
                "background": grid.background.hex(),
                "metadata": {key: _plain(value) for key, value in grid.metadata.items()},
            }
        )
        for name in (*_ARRAYS, "origin", "linear", *(_INACTIVE if len(grid.inactive_log2) else ())):
            if (array := getattr(grid, name)) is not None:
                arrays[f"{n}.{name}"] = array
    arrays["header"] = np.array(json.dumps({"format": _FORMAT, "version": _VERSION, "grids": described}))
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with beside.open("xb") as file:
            np.savez_compressed(file, **cast(Any, arrays))
        beside.replace(target)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def _plain(value: Any) -> Any:
    """Metadata as JSON has it; tuples come back as tuples."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def read_npz(path: str | os.PathLike[str]) -> tuple[SparseGrid, ...]:
    """Read the grids that `write_npz` wrote.

    Parameters
    ----------
    path : path
        An .npz file of this library.

    Returns
    -------
    tuple of SparseGrid
        In the order of writing.

    Raises
    ------
    GridReadError
        If the file is missing, damaged, of another kind, or of a newer version.

    Notes
    -----
    Nothing is unpacked before the file's sizes and shapes fit each other; pickles are never loaded.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "a.npz")
    >>> write_npz(path, [SparseGrid.from_ijk([[0, 0, 0]], values=[0.5])])
    >>> read_npz(path)[0].values_at([[0, 0, 0]])
    array([0.5], dtype=float32)
    """
    input_file(path, GridReadError)
    try:
        with NpzArrays(path) as arrays:
            header = read_json(arrays.text("header"))
            if header["format"] != _FORMAT or header["version"] != _VERSION:
                raise GridReadError(
                    f"{path}: `path` must be a {_FORMAT} file of version {_VERSION}; "
                    f"got {str(header['format'])[:40]!r} of version {header['version']!r:.40}"
                )
            return tuple(_grid_from(arrays, n, facts) for n, facts in enumerate(header["grids"]))
    except GridReadError:
        raise
    except (*DAMAGE, TypeError, AttributeError, IndexError) as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise GridReadError(f"{path}: `path` must be an .npz file of this library: {reason}") from error


def _grid_from(arrays: NpzArrays, n: int, facts: Mapping[str, Any]) -> SparseGrid:
    """One grid; its constructor checks the arrays."""
    names = (*_ARRAYS, "origin", "linear", *_INACTIVE)
    given = {name: arrays[f"{n}.{name}"] for name in names if f"{n}.{name}" in arrays}
    metadata = {k: tuple(v) if isinstance(v, list) else v for k, v in facts["metadata"].items()}
    return SparseGrid(
        **given,
        name=facts["name"],
        grid_class=facts["grid_class"],
        background=float.fromhex(facts["background"]),
        metadata=metadata,
    )


# -- Open3D --------------------------------------------------------------------------------------------


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


# -- PyVista ---------------------------------------------------------------------------------------------


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
    import pyvista

    corner, edge, value = _cells_of(grid, max_cells)
    steps = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    if np.linalg.det(grid.linear) < 0:
        steps = steps[:, [1, 0, 2]]
    lattice = corner[:, None] + steps * edge[:, None, None]
    points = lattice.reshape(-1, 3) @ grid.linear.T + grid.origin
    n_cells = len(corner)
    connectivity = np.column_stack([np.full(n_cells, 8), np.arange(8 * n_cells).reshape(n_cells, 8)]).ravel()
    kinds = np.full(n_cells, int(pyvista.CellType.HEXAHEDRON), dtype=np.uint8)
    cells = pyvista.UnstructuredGrid(connectivity, kinds, points)
    cells.cell_data["log2"] = np.log2(edge).astype(np.int8)
    if value is not None:
        cells.cell_data["value"] = value
    return cells


def _cells_of(
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
    import pyvista

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


# -- surface and octree ------------------------------------------------------------------------------------


def to_surface(grid: SparseGrid, *, max_faces: int = 50_000_000) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangulate the faces between active and inactive voxels.

    Parameters
    ----------
    grid : SparseGrid
        Any transform.
    max_faces : int, default 50 million
        Refuse to make more triangles.

    Returns
    -------
    vertices : (n, 3) float64
        World points: corners of voxels, each once, in lexicographic order.
    faces : (m, 3) int64
        Two triangles per voxel face, counter-clockwise seen from outside; (0, 3) for an empty grid.

    Raises
    ------
    ValueError
        If there would be more than `max_faces` triangles.

    Notes
    -----
    Closed: every edge is used equally often in both directions. Where active voxels touch only along an
    edge, that edge has four triangles. Tiles are looked at only on their outer layer: the cost grows with
    the surface, not with the volume.

    Examples
    --------
    >>> vertices, faces = to_surface(SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]]))
    >>> len(vertices), len(faces)  # ten unit squares
    (12, 20)
    """
    on_tiles = int((np.int64(1) << (2 * (grid.tile_log2.astype(np.int64) - 3))).sum())  # 8^2 patches of one side
    if 8 * on_tiles > max_faces:
        raise ValueError(f"`max_faces` must be larger for tiles of {on_tiles} patches a side; got {max_faces}")
    n_faces = 0
    quads: list[NDArray[np.int32]] = [np.zeros((0, 4, 3), dtype=np.int32)]
    is_mirrored = np.linalg.det(grid.linear) < 0
    for axis in range(3):
        u, v = np.eye(3, dtype=np.int32)[[(axis + 1) % 3, (axis + 2) % 3]]
        around = np.stack([np.zeros(3, dtype=np.int32), u, u + v, v])
        for step in (1, -1):
            voxels = exposed_faces(grid, axis, step)
            n_faces += 2 * len(voxels)
            if n_faces > max_faces:
                raise ValueError(f"`max_faces` must be larger for this grid; got {max_faces}")
            if step > 0:
                voxels[:, axis] += 1
            turn = around if (step > 0) != is_mirrored else around[::-1]
            quads.append(voxels[:, None] + turn)
    corners = np.concatenate(quads)
    if not len(corners):
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    lattice, quad = _unique_rows(corners.reshape(-1, 3))
    quad = quad.reshape(-1, 4)
    faces = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    return lattice @ grid.linear.T + grid.origin, faces


def _unique_rows(rows: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Distinct rows in order and the place of each row; coordinates have at most 25 bits, two keys' worth."""
    low = rows.min(axis=0).astype(np.int64)
    extent = rows.max(axis=0) - low + 1
    if float(extent[0]) * float(extent[1]) * float(extent[2]) < 2.0**62:
        local = rows - low
        key = (local[:, 0] * extent[1] + local[:, 1]) * extent[2] + local[:, 2]
        distinct, place = np.unique(key, return_inverse=True)
        rest, z = np.divmod(distinct, extent[2])
        x, y = np.divmod(rest, extent[1])
        return np.stack([x, y, z], axis=1) + low, place.astype(np.int64)
    distinct_rows, place = np.unique(rows, axis=0, return_inverse=True)
    return distinct_rows.astype(np.int64), place.reshape(-1).astype(np.int64)


class LinearOctree(NamedTuple):
    """Cells of an octree, sorted by Morton key.

    Parameters
    ----------
    key : (n,) uint64
        Interleaved bits of ``ijk - corner`` of each cell's lower corner, x in the highest place.
    log2 : (n,) int8
        Edge of each cell is ``2**log2`` voxels; its keys are ``key ... key + 8**log2 - 1``.
    verdict : (n,) int8
        1 inside, 0 undecided; what no cell covers is outside.
    corner : (3,) int64
        Voxel of key 0.

    Examples
    --------
    >>> octree = to_linear_octree(SparseGrid.from_ijk([[0, 0, 1]]), SparseGrid.from_ijk([[0, 0, 0]]))
    >>> octree.key.tolist(), octree.verdict.tolist()
    ([0, 1], [0, 1])
    """

    key: NDArray[np.uint64]
    log2: NDArray[np.int8]
    verdict: NDArray[np.int8]
    corner: NDArray[np.int64]


def to_linear_octree(inside: SparseGrid, boundary: SparseGrid | None = None) -> LinearOctree:
    """Cells of one or two masks as a linear octree, down to single voxels.

    Parameters
    ----------
    inside : SparseGrid
        Cells of verdict 1. Values are not used.
    boundary : SparseGrid, optional
        Cells of verdict 0; must share no voxel with `inside`.

    Returns
    -------
    LinearOctree
        Tiles as they are, leaves cut into cells of 4^3, 2^3 and 1 voxel. Empty grids give no cells.

    Raises
    ------
    ValueError
        If the voxels extend over more than 2**21 along an axis.

    References
    ----------
    .. [1] I. Gargantini, An effective way to represent quadtrees, Commun. ACM 25(12), 1982,
       doi:10.1145/358728.358741.

    Examples
    --------
    >>> import numpy as np
    >>> octree = to_linear_octree(SparseGrid.from_dense(np.ones((4, 4, 6), dtype=bool)))
    >>> octree.log2.tolist()
    [2, 1, 1, 1, 1]
    """
    grids = [inside] if boundary is None else [inside, boundary]
    cells = [_octree_cells(grid) for grid in grids]
    corner = np.concatenate([c for c, _ in cells])
    log2 = np.concatenate([e for _, e in cells])
    verdict = np.repeat(np.array([1, 0], dtype=np.int8)[: len(cells)], [len(e) for _, e in cells])
    if not len(corner):
        return LinearOctree(np.zeros(0, np.uint64), log2, verdict, np.zeros(3, np.int64))
    unit = np.int64(1) << max(int(log2.max()), 3)
    low = corner.min(axis=0) // unit * unit
    local = (corner - low).astype(np.uint64)
    if local.max() >= 1 << 21:
        raise ValueError(f"`inside` must extend over at most 2**21 voxels; got {int(local.max()) + 1}")
    key = np.zeros(len(corner), dtype=np.uint64)
    for axis in range(3):
        key |= _spread(local[:, axis]) << np.uint64(2 - axis)
    order = np.argsort(key, kind="stable")
    return LinearOctree(key[order], log2[order], verdict[order], low)


def _octree_cells(grid: SparseGrid) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Tiles and the largest aligned cubes of leaves: corners and log2 of the edges."""
    corners = [grid.tile_ijk.astype(np.int64)]
    sizes = [grid.tile_log2]
    left = unpack(grid.leaf_mask)
    leaf = grid.leaf_ijk.astype(np.int64)
    for log2 in (3, 2, 1, 0):
        n, edge = 8 >> log2, 1 << log2
        blocks = left.reshape(-1, n, edge, n, edge, n, edge)
        is_full = np.asarray(blocks.all(axis=(2, 4, 6)), dtype=np.bool_)
        owner, x, y, z = np.nonzero(is_full)
        corners.append(leaf[owner] + np.stack([x, y, z], axis=1) * edge)
        sizes.append(np.full(len(owner), log2, dtype=np.int8))
        left = (blocks & ~is_full[:, :, None, :, None, :, None]).reshape(-1, 8, 8, 8)
    return np.concatenate(corners), np.concatenate(sizes)


def _spread(number: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """21 bits with two zero bits between them."""
    for shift, mask in (
        (32, 0x001F00000000FFFF),
        (16, 0x001F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        number = (number | (number << np.uint64(shift))) & np.uint64(mask)
    return number
