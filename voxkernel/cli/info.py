"""`voxkernel info`: the facts of a mesh or of a stored grid."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from voxkernel._sizes import size_notes
from voxkernel.cli.messages import option_names, spoken
from voxkernel.cli.output import display, number, print_json, print_table, report_error, say
from voxkernel.errors import VoxKernelError

if TYPE_CHECKING:
    from voxkernel.labels import LabelImage

HELP = "facts of a mesh, of a polyhedral mesh, of a label image or of a stored grid"
DESCRIPTION = (
    "Say what is true of a mesh: closed or open, oriented, boundary loops, degenerate facets, components,\n"
    "area, volume. Of a polyhedral mesh (.hedra, .mesh, .vtu, a folder of cells): its cells and faces. Of a label\n"
    "image (.tif, .nii, .nrrd, .h5, ...): its axes, spacing and objects. Of an .npz grid that `voxkernel kernel`\n"
    "wrote: voxels, transform, volume bounds. Of a .vdb file: what `vdb_print -l` of OpenVDB says."
)
EXAMPLES = (
    "voxkernel info bust.ply",
    "voxkernel info 'scans/*.ply' --json",
    "voxkernel info cells.hedra",
    "voxkernel info nuclei.tif",
    "voxkernel info kernel.vdb",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("paths", nargs="+", metavar="FILE", help="meshes, label images, .npz or .vdb grids")
    parser.add_argument("--json", action="store_true", help="one JSON document; of several files a list")


def run(args: argparse.Namespace) -> int:
    """Print the facts of each file; of several, one that fails does not stop the others, and other scales are noted."""
    documents: list[dict[str, Any]] = []
    n_failed = 0
    for k, path in enumerate(args.paths):
        if k and not args.json:
            print()
        try:
            if Path(path).suffix.lower() == ".vdb" and not args.json:
                _print_vdb(path)
                continue
            with args.stage(f"reading {display(path)}"):
                facts = facts_of(path)
        except (VoxKernelError, OSError, ValueError, MemoryError) as error:
            if len(args.paths) == 1:
                raise
            n_failed += 1
            reason = " ".join(spoken(str(error), option_names(args.parser)).split()) or type(error).__name__
            documents.append({"file": path, "error": reason})
            report_error(reason)
            continue
        documents.append({"file": path, **facts})
        if not args.json:
            print_table({name.replace("_", " "): _text(value) for name, value in documents[-1].items()})
    for k, note in size_notes([document.get("diagonal") for document in documents]).items():
        documents[k]["notes"] = [*documents[k]["notes"], note]
        if not args.json:
            say(f"{display(documents[k]['file'])}: {note}", quiet=args.quiet)
    if args.json:
        print_json(documents[0] if len(documents) == 1 else documents)
    if n_failed:
        say(f"{n_failed} of {len(args.paths)} files failed", quiet=args.quiet)
    return 1 if n_failed else 0


def facts_of(path: str) -> dict[str, Any]:
    """Collect what is true of a file, or of a folder of cells, of whatever kind."""
    from voxkernel.labels import is_label_file
    from voxkernel.polyhedral import is_polyhedral

    suffix = Path(path).suffix.lower()
    if suffix == ".vdb":
        return vdb_facts(path)
    if suffix == ".npz" and not _is_label_archive(path):
        return npz_facts(path)
    if is_label_file(path):
        return label_facts(path)
    if is_polyhedral(path):
        return polyhedral_facts(path)
    return mesh_facts(path)


def _is_label_archive(path: str) -> bool:
    """Whether an .npz holds one image of whole numbers, as against a grid of this library."""
    import zipfile

    import numpy as np

    from voxkernel.errors import GridReadError
    from voxkernel.grid.npz import read_npz_file

    try:
        read_npz_file(path)
    except GridReadError:
        try:
            return bool(np.issubdtype(_label_image(path)[0].source.dtype, np.integer))
        except (OSError, ValueError, TypeError, zipfile.BadZipFile):
            return False
    return False


def polyhedral_facts(path: str) -> dict[str, Any]:
    """Collect the facts of a polyhedral mesh."""
    from voxkernel.polyhedral import read_polyhedral

    mesh = read_polyhedral(path)
    broken = [text for text in mesh.problems if text]
    return {
        "kind": "polyhedral mesh",
        "cells": len(mesh),
        "faces": len(mesh.face_offsets) - 1,
        "vertices": len(mesh.vertices),
        "turned_cells": mesh.n_turned,
        "oriented_by": mesh.oriented_by,
        "broken_cells": len(broken),
        "first_problem": broken[0] if broken else "",
        "lowest_corner": mesh.vertices.min(axis=0).tolist(),
        "highest_corner": mesh.vertices.max(axis=0).tolist(),
    }


def label_facts(path: str) -> dict[str, Any]:
    """Collect the facts of a label image and count its objects."""
    from voxkernel.labels import find_objects

    image, has_spacing = _label_image(path)
    found = find_objects(image)
    return {
        "kind": "label image",
        "axes": list(image.shape),
        "values": str(image.source.dtype),
        "spacing": list(image.spacing) if has_spacing else None,
        "objects": len(found),
        "labelled_voxels": int(found.voxels.sum()),
    }


def _label_image(path: str) -> tuple[LabelImage, bool]:
    """Open a label image, and say whether the file stores its spacing; for what is counted here any will do."""
    from voxkernel.labels import read_labels

    for spacing in (None, (1.0, 1.0, 1.0)):
        try:
            return read_labels(path, spacing=spacing), spacing is None
        except ValueError as error:
            if "`spacing`" not in str(error):
                raise
    return read_labels(path, spacing=(1.0, 1.0)), False


def mesh_facts(source: Any) -> dict[str, Any]:
    """Collect the facts of a mesh; arrays of ids become counts."""
    from voxkernel.mesh import as_mesh
    from voxkernel.mesh.surface_notes import surface_notes

    mesh = as_mesh(source)
    facts = mesh.facts()
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
        "notes": list(surface_notes(mesh)),
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
    return "-" if value is None or value == "" else display(spoken(str(value), {}))
