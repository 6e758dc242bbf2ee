"""What OpenVDB's `vdb_print -l` says about a .vdb file, line for line, without OpenVDB."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from voxkernel.cli.output import display
from voxkernel.vdb.statistics import grid_statistics

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from voxkernel.grid import SparseGrid
    from voxkernel.vdb import VdbFile

__all__ = ["listing"]

_UNITS = ((40, "TB"), (30, "GB"), (20, "MB"), (10, "KB"))


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
