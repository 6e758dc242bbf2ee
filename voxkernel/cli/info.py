"""`voxkernel info`: the facts of a mesh or of a stored grid."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from voxkernel.cli.output import display, number, print_json, print_table

HELP = "facts of a mesh or of a stored grid"
DESCRIPTION = (
    "Say what is true of a mesh: closed or open, oriented, boundary loops, degenerate facets, components,\n"
    "area, volume. Of an .npz grid that `voxkernel kernel` wrote: voxels, transform, volume bounds. Of a\n"
    "`.vdb` file: each grid it holds."
)
EXAMPLES = ("voxkernel info bust.ply", "voxkernel info bust.ply --json", "voxkernel info kernel.vdb")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="FILE", help="a mesh, or an .npz or .vdb grid")
    parser.add_argument("--json", action="store_true", help="one JSON document")


def run(args: argparse.Namespace) -> int:
    """Print the facts."""
    suffix = Path(args.path).suffix.lower()
    facts = {".npz": npz_facts, ".vdb": vdb_facts}.get(suffix, mesh_facts)(args.path)
    document = {"file": args.path, **facts}
    if args.json:
        print_json(document)
        return 0
    grids = document.pop("grids", [])
    print_table({name.replace("_", " "): _text(value) for name, value in document.items()})
    for grid in grids:
        print()
        print_table({name.replace("_", " "): _text(value) for name, value in grid.items()})
    return 0


def mesh_facts(path: str) -> dict[str, Any]:
    """Collect the facts of a mesh; arrays of ids become counts."""
    from voxkernel.mesh_input import as_mesh

    facts = as_mesh(path).facts()
    return {
        "vertices": facts.n_vertices,
        "triangles": facts.n_faces,
        "facets": facts.n_facets,
        "closed": facts.is_closed,
        "boundary_loops": len(facts.boundary_loops),
        "boundary_edges": facts.n_boundary_edges,
        "nonmanifold_edges": facts.n_nonmanifold_edges,
        "oriented": facts.is_oriented,
        "outward": facts.is_outward,
        "components": facts.n_components,
        "euler_characteristic": facts.euler_characteristic,
        "genus": facts.genus,
        "degenerate_facets": len(facts.degenerate_facets),
        "duplicate_facets": facts.n_duplicate_facets,
        "nonplanar_facets": len(facts.nonplanar_facets),
        "unreferenced_vertices": facts.n_unreferenced_vertices,
        "area": facts.area,
        "volume": facts.volume,
        "area_centroid": facts.area_centroid.tolist(),
        "lowest_corner": facts.bbox[0].tolist(),
        "highest_corner": facts.bbox[1].tolist(),
        "diagonal": facts.diagonal,
    }


def npz_facts(path: str) -> dict[str, Any]:
    """Collect the facts of a grid that `voxkernel kernel` wrote."""
    from voxkernel.cli.kernel_files import read_grid_file

    return read_grid_file(path)


def vdb_facts(path: str) -> dict[str, Any]:
    """Collect the facts of every grid of a .vdb file."""
    from voxkernel.vdb import read_vdb

    file = read_vdb(path)
    return {"skipped": list(file.skipped), "grids": [_grid_facts(grid) for grid in file.grids]}


def _grid_facts(grid: Any) -> dict[str, Any]:
    box = grid.active_bbox
    return {
        "name": grid.name,
        "type": "mask" if grid.is_mask else "float",
        "active_voxel_count": grid.active_voxel_count,
        "tiles": grid.tile_count,
        "leaves": grid.leaf_count,
        "active_bbox": None if box is None else box.tolist(),
        "origin": grid.origin.tolist(),
        "linear": grid.linear.tolist(),
        "voxel_volume": grid.voxel_volume,
    }


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number(value, 10)
    if isinstance(value, list):
        return "  ".join(_text(item) for item in value) or "-"
    return "-" if value is None or value == "" else display(str(value))
