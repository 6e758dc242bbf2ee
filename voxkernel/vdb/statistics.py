"""Nodes, voxels and bytes of a grid as OpenVDB counts them, without OpenVDB."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from voxkernel.grid import SparseGrid

__all__ = ["grid_statistics"]

_TREES = {"bool": "Tree_bool_5_4_3", "mask": "Tree_mask_5_4_3"}
# Bytes that OpenVDB 10 counts: the tree itself, a node of 32^3, of 16^3, a leaf. A `SparseGrid` needs less.
_TREE_BYTES, _UPPER_BYTES, _LOWER_BYTES = 1304, 270_348, 33_804
_LEAF_BYTES = {"bool": 144, "mask": 80}
_FLOAT_LEAF_BYTES, _BUFFER_BYTES = 2144, 2000


def grid_statistics(grid: SparseGrid, kind: str) -> dict[str, Any]:
    """Count nodes, tiles, voxels and bytes as OpenVDB counts them in a grid that was read from a file."""
    import numpy as np

    from voxkernel.grid.leaf_bits import popcount, unpack

    corners = np.concatenate([grid.tile_ijk, grid.inactive_ijk])
    log2 = np.concatenate([grid.tile_log2, grid.inactive_log2])
    lower = np.unique(np.concatenate([grid.leaf_ijk, corners[log2 == 3]]) >> 7, axis=0)
    upper = np.unique(np.concatenate([lower << 7, corners[log2 == 7]]) >> 12, axis=0)
    in_leaves = int(popcount(grid.leaf_mask).sum())
    box = grid.active_bbox
    extent = [0, 0, 0] if box is None else (box[1] - box[0] + 1).tolist()
    low = high = 0.0
    if box is not None and (grid.tile_values is None or grid.leaf_values is None):
        low = high = 1.0
    elif box is not None and grid.tile_values is not None and grid.leaf_values is not None:
        values = np.concatenate([grid.tile_values, grid.leaf_values[unpack(grid.leaf_mask).reshape(-1, 512)]])
        low, high = float(values.min()), float(values.max())
    n_bytes = 1 if kind in _TREES else 4
    in_nodes = len(upper) * _UPPER_BYTES + len(lower) * _LOWER_BYTES
    n_unfilled = 0 if kind in _TREES else int((~grid.leaf_mask.any(axis=1)).sum())
    in_memory = _TREE_BYTES + in_nodes + grid.leaf_count * _LEAF_BYTES.get(kind, _FLOAT_LEAF_BYTES)
    in_memory -= n_unfilled * _BUFFER_BYTES  # OpenVDB allocates no values for a leaf without active voxels
    return {
        "type": _TREES.get(kind, "Tree_float_5_4_3"),
        "root_entries": len(upper) + int((log2 == 12).sum()),
        "upper_nodes": len(upper),
        "lower_nodes": len(lower),
        "leaves": grid.leaf_count,
        "unallocated_leaves": n_unfilled,
        "background": grid.background,
        "value_range": [low, high],
        "active_voxel_count": grid.active_voxel_count,
        "tiles": grid.tile_count,
        "active_bbox": None if box is None else box.tolist(),
        "dimensions": extent,
        "leaf_fill": in_leaves / max(1, 512 * grid.leaf_count),
        "bytes": grid.nbytes,
        "openvdb_bytes": in_memory,
        "leaf_voxel_bytes": n_bytes * in_leaves,
        "dense_bytes": n_bytes * extent[0] * extent[1] * extent[2],
    }
