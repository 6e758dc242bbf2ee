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
    ".vdb file: what `vdb_print -l` of OpenVDB says."
)
EXAMPLES = ("voxkernel info bust.ply", "voxkernel info bust.ply --json", "voxkernel info kernel.vdb")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="FILE", help="a mesh, or an .npz or .vdb grid")
    parser.add_argument("--json", action="store_true", help="one JSON document")


def run(args: argparse.Namespace) -> int:
    """Print the facts."""
    suffix = Path(args.path).suffix.lower()
    if suffix == ".vdb" and not args.json:
        _print_vdb(args.path)
        return 0
    facts = {".npz": npz_facts, ".vdb": vdb_facts}.get(suffix, mesh_facts)(args.path)
    document = {"file": args.path, **facts}
    if args.json:
        print_json(document)
    else:
        print_table({name.replace("_", " "): _text(value) for name, value in document.items()})
    return 0


def mesh_facts(path: str) -> dict[str, Any]:
    """Collect the facts of a mesh; arrays of ids become counts."""
    from voxkernel.mesh import as_mesh

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
    """Collect the facts of a kernel grid, or of the grids that another .npz of the library holds."""
    from voxkernel.grid.npz import read_npz_file
    from voxkernel.voxels import KernelGrid

    grids, about = read_npz_file(path)
    if "volume_bounds" in about:
        return KernelGrid.read(path).to_dict()
    return {grid.name or f"grid {n}": f"{grid.active_voxel_count:,} active voxels" for n, grid in enumerate(grids)}


def vdb_facts(path: str) -> dict[str, Any]:
    """Collect the facts of a .vdb file and of its grids, in the order of the file."""
    from voxkernel.vdb import read_vdb
    from voxkernel.vdb.statistics import grid_statistics

    file = read_vdb(path)
    grids = [
        {
            "name": grid.name,
            **grid_statistics(grid, kind),
            "class": grid.grid_class,
            "origin": grid.origin,
            "linear": grid.linear,
            "metadata": entries,
        }
        for grid, kind, entries in zip(file.grids, file.value_types, file.entries, strict=True)
    ]
    return {
        "version": file.version,
        "library_version": list(file.library_version),
        "metadata": file.metadata,
        "skipped": list(file.skipped),
        "grids": grids,
    }


def _print_vdb(path: str) -> None:
    from voxkernel.cli.vdb_listing import listing
    from voxkernel.vdb import read_vdb

    for line in listing(read_vdb(path)):
        print(line)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number(value, 10)
    if isinstance(value, list):
        return "  ".join(_text(item) for item in value) or "-"
    return "-" if value is None or value == "" else display(str(value))
