"""`SparseGrid` -> the closed surface of its active voxels."""

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid.exposed_faces import exposed_faces
from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["to_surface"]


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
