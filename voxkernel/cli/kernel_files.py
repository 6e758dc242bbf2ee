"""Kernels as files: a polytope as polygon .ply, a grid as .npz that NumPy alone can read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from voxkernel._input_file import input_file
from voxkernel._version import __version__
from voxkernel.cli.output import display
from voxkernel.errors import MeshReadError

__all__ = [
    "FORMAT", "grid_summary", "read_grid_file", "vdb_metadata", "write_grid_file", "write_grid_ply",
    "write_polygon_ply",
]  # fmt: skip

FORMAT = "voxkernel grid 1"


def grid_summary(grid: Any) -> dict[str, Any]:
    """Give what describes a KernelGrid without its cells."""
    box = grid.active_bbox
    return {
        "depth": grid.depth,
        "tolerance": grid.tolerance,
        "dimension": grid.dimension,
        "volume": grid.volume,
        "volume_bounds": list(grid.volume_bounds),
        "active_voxel_count": grid.active_voxel_count,
        "boundary_voxel_count": grid.boundary.active_voxel_count,
        "active_bbox": None if box is None else box.tolist(),
        "tiles": len(grid.tile_ijk),
        "leaves": len(grid.leaf_ijk),
        "voxel_size": grid.voxel_size,
        "origin": grid.origin.tolist(),
        "axes": grid.axes.tolist(),
        "domain": None if grid.domain is None else grid.domain.kind,
        "reason": grid.reason,
    }


def vdb_metadata(grid: Any, mesh: str) -> dict[str, Any]:
    """Give the typed metadata of a .vdb file: what its cells alone do not tell."""
    entries: dict[str, Any] = {
        "source": display(Path(mesh).name),
        "volume_bounds": tuple(float(v) for v in grid.volume_bounds),
        "alpha": float(grid.tolerance),
        "depth": int(grid.depth),
        "dimension": int(grid.dimension),
        "voxkernel_version": __version__,
    }
    if grid.domain is not None:
        entries["domain"] = grid.domain.kind
    if grid.reason:
        entries["reason"] = grid.reason
    return entries


def write_grid_file(grid: Any, path: Path) -> None:
    """Write tiles, leaf masks, transform and the summary."""
    import json

    import numpy as np

    with path.open("wb") as file:  # NumPy would append a suffix to a path
        np.savez_compressed(
            file, tile_ijk=grid.tile_ijk, tile_log2=grid.tile_log2, leaf_ijk=grid.leaf_ijk,
            leaf_inside=grid.leaf_inside, leaf_boundary=grid.leaf_boundary, origin=grid.origin,
            voxel_size=np.float64(grid.voxel_size), axes=grid.axes, format=np.array(FORMAT),
            summary=np.array(json.dumps(grid_summary(grid))),
        )  # fmt: skip


def read_grid_file(path: str) -> dict[str, Any]:
    """Read the summary of a file made by `write_grid_file`."""
    from voxkernel._npz import DAMAGE, NpzArrays, is_shallow, read_json

    input_file(path, MeshReadError)
    try:
        with NpzArrays(path) as arrays:
            if (found := arrays.text("format")) != FORMAT:
                raise ValueError(f"its format is {display(found[:40])}, not `{FORMAT}`")
            summary = read_json(arrays.text("summary"))
            if not isinstance(summary, dict) or not is_shallow(summary, 3):
                raise ValueError("its summary is not that of a grid")
            return summary
    except DAMAGE as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise MeshReadError(f"'{path}' must be an .npz grid of voxkernel; got something else ({reason})") from error


def write_polygon_ply(kernel: Any, path: Path) -> None:
    """Write the polytope with its polygons and the input facet of each (-1 - j: plane j of the domain).

    An empty kernel gives a file without vertices.
    """
    _write_ply(path, kernel.vertices, kernel.faces, kernel.face_facets)


def write_grid_ply(grid: Any, path: Path) -> None:
    """Write the faces of the inside voxels as triangles; a file without vertices where there is none."""
    if grid.active_voxel_count:
        grid.to_mesh().write(path)
    else:
        import numpy as np

        _write_ply(path, np.zeros((0, 3)), (), np.zeros(0))


def _write_ply(path: Path, vertices: Any, faces: Any, facets: Any) -> None:
    import numpy as np

    header = (
        "ply\nformat binary_little_endian 1.0\ncomment voxkernel kernel\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list int int vertex_indices\nproperty int input_facet\n"
        "end_header\n"
    )
    rows = [np.concatenate([[len(face)], face, [facet]]) for face, facet in zip(faces, facets, strict=True)]
    body = np.concatenate(rows).astype("<i4").tobytes() if rows else b""
    path.write_bytes(header.encode("ascii") + vertices.astype("<f8").tobytes() + body)
