"""What OpenVDB's `vdb_print -l` says about a .vdb file, line for line, without OpenVDB."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from voxkernel.cli.output import display

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from voxkernel.grid import SparseGrid
    from voxkernel.vdb import VdbFile

__all__ = ["grid_statistics", "listing"]

_TREES = {"bool": "Tree_bool_5_4_3", "mask": "Tree_mask_5_4_3"}
# Bytes that OpenVDB 10 counts: the tree itself, a node of 32^3, of 16^3, a leaf. A `SparseGrid` needs less.
_TREE_BYTES, _UPPER_BYTES, _LOWER_BYTES = 1304, 270_348, 33_804
_LEAF_BYTES = {"bool": 144, "mask": 80}
_FLOAT_LEAF_BYTES, _BUFFER_BYTES = 2144, 2000
_UNITS = ((40, "TB"), (30, "GB"), (20, "MB"), (10, "KB"))


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


def listing(file: VdbFile) -> Iterator[str]:
    """Give the lines of `vdb_print -l`; grids come sorted by name, as there."""
    major, minor = file.library_version
    yield f"VDB version: {major}.{minor}/{file.version}"
    yield from _metadata(file.metadata, "")
    yield ""
    order = sorted(range(len(file)), key=lambda n: file.names[n])
    for place, n in enumerate(order):
        if place:
            yield from ("", "")
        yield f"Name: {display(file.names[n])}"
        yield from _tree(grid_statistics(file[n], file.value_types[n]))
        if file.entries[n]:
            yield "Additional metadata:"
            yield from _metadata(file.entries[n], "  ")
        yield from _transform(file[n])
        yield ""
    for reason in file.skipped:
        yield f"Skipped: {display(reason)}"


def _tree(facts: dict[str, Any]) -> Iterator[str]:
    """Topology, values and memory."""
    nodes = f"{facts['upper_nodes']:,} x 32^3), Internal({facts['lower_nodes']:,} x 16^3), Leaf({facts['leaves']:,}"
    yield "Information about Tree:"
    yield f"  Type: {facts['type']}"
    yield "  Configuration:"
    yield f"    Root(1 x {facts['root_entries']}), Internal({nodes} x 8^3)"
    yield f"  Background value: {_short(facts['background'])}"
    yield f"  Min value: {_short(facts['value_range'][0])}"
    yield f"  Max value: {_short(facts['value_range'][1])}"
    yield f"  Number of active voxels:       {facts['active_voxel_count']:,}"
    yield f"  Number of active tiles:        {facts['tiles']:,}"
    box, extent = facts["active_bbox"], facts["dimensions"]
    if box is None:
        yield "  Tree is empty!"
    else:
        share = 100.0 * facts["active_voxel_count"] / (extent[0] * extent[1] * extent[2])
        yield f"  Bounding box of active voxels: {box[0]} -> {box[1]}"
        yield f"  Dimensions of active voxels:   {extent[0]} x {extent[1]} x {extent[2]}"
        yield f"  Percentage of active voxels:   {share:.3g}%"
        if facts["leaves"]:
            yield f"  Average leaf node fill ratio:  {100.0 * facts['leaf_fill']:.3g}%"
        n_nodes = 1 + facts["upper_nodes"] + facts["lower_nodes"] + facts["leaves"]
        unfilled = facts["unallocated_leaves"]
        yield f"  Number of unallocated nodes:   {unfilled:,} ({100.0 * unfilled / n_nodes:.3g}%)"
    yield "Memory footprint:"
    yield f"  Actual:             {_bytes(facts['openvdb_bytes'])}"
    yield f"  Active leaf voxels: {_bytes(facts['leaf_voxel_bytes'])}"
    if box is not None:
        actual, dense, voxels = facts["openvdb_bytes"], facts["dense_bytes"], facts["leaf_voxel_bytes"]
        yield f"  Dense equivalent:   {_bytes(dense)}"
        yield f"  Actual footprint is {100.0 * actual / dense:.3g}% of an equivalent dense volume"
        yield f"  Leaf voxel footprint is {100.0 * voxels / actual:.3g}% of actual footprint"


def _metadata(entries: Mapping[str, Any], indent: str) -> Iterator[str]:
    """One line an entry, sorted by name."""
    for key in sorted(entries):
        text = _value(entries[key])
        yield f"{indent}{display(key)}" + (f": {text}" if text else "")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple) and len(value) == 16:
        return "[" + ", ".join(f"[{_row(value[n : n + 4], 6)}]" for n in (0, 4, 8, 12)) + "]"
    if isinstance(value, tuple):
        return f"[{_row(value, 6)}]"
    return _short(value) if isinstance(value, float) else display(str(value))


def _row(numbers: Iterable[Any], digits: int) -> str:
    return ", ".join(f"{v:.{digits}g}" if isinstance(v, float) else str(v) for v in numbers)


def _short(value: float) -> str:
    return f"{value:.6g}"


def _transform(grid: SparseGrid) -> Iterator[str]:
    """Voxel size and matrix, for row vectors as OpenVDB writes them."""
    import numpy as np

    edges = np.linalg.norm(grid.linear, axis=0).tolist()
    is_uniform = max(edges) - min(edges) <= 1e-7 * max(edges)
    yield "Transform:"
    yield f"  voxel size: {edges[0]:.3g}" if is_uniform else f"  voxel dimensions: [{_row(edges, 3)}]"
    yield "  index to world:"
    for row in grid.transform.T.tolist():
        yield f"     [{_row(row, 3)}]"


def _bytes(count: int) -> str:
    for shift, unit in _UNITS:
        if count >> shift:
            return f"{count / (1 << shift):8.3f} {unit}"
    return f"{count:8d} Bytes"
