"""`voxkernel kernel`: the kernel of one mesh as a polytope or as voxels."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from voxkernel.cli.argument_types import add_up, whole
from voxkernel.cli.output import (
    UsageError,
    check_output,
    check_picture,
    display,
    number,
    print_json,
    print_table,
    say,
    write_json,
)
from voxkernel.cli.streaming import add_stream, opened

if TYPE_CHECKING:
    from voxkernel.exact import Kernel, KernelPolytope

HELP = "the kernel of a mesh, exact or as voxels"
DESCRIPTION = (
    "Compute the kernel of a mesh: the points from which the whole surface can be seen.\n"
    "Without grid options the kernel is exact: .ply and .vtp are its polygons, .json has everything with the\n"
    "certificate. With --depth, --voxel-size, --rtol, --tolerance or --margin, or for .npz, .vdb and .vtu, it is a\n"
    "sparse voxel grid with certain volume bounds; .vtu (cells) and .vtp (faces) then tell ParaView the state of\n"
    "each cell (1 inside, 0 undecided), its level and its violation. An empty kernel is an answer, not an error."
)
EXAMPLES = (
    "voxkernel kernel bust.ply",
    "voxkernel kernel bust.ply -o kernel.ply --picture kernel.png",
    "voxkernel kernel bust.ply -o kernel.vdb --depth 9",
    "voxkernel kernel scan.ply -o kernel.vtu --tolerance 0.03",
    "voxkernel kernel face.obj --domain hull -o kernel.json --picture kernel.html",
    "voxkernel kernel scan.ply --tolerance 0.03 -o kernel.vdb --picture kernel.html",
    "voxkernel kernel bust.ply --rtol 0.01 --frame principal --json",
    "voxkernel kernel city/ --stream -o kernel.json",
)
_GRID_OPTIONS = ("depth", "voxel_size", "rtol", "tolerance", "margin", "frame")
_GRIDS = (".npz", ".vdb", ".vtu")
_SUFFIXES = (".ply", ".json", *_GRIDS, ".vtp", ".glb")
_NAMES = ("point", "segment", "flat polygon", "solid")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("mesh", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    add_stream(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="kernel.ply, .json, .npz, .vdb, .vtu, .vtp or .glb")
    parser.add_argument("--picture", metavar="FILE", help="draw surface and kernel: .png, or .html to turn by hand")
    add_up(parser)
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    parser.add_argument(
        "--domain", choices=("ball", "hull", "box"), help="where to look for the kernel (open surfaces: ball)"
    )
    parser.add_argument("--threads", type=_threads, default=1, metavar="N", help="threads; 1 by default")
    parser.add_argument(
        "--scheduler", metavar="URL", help="with --stream: a Dask scheduler to use and trust, tls://host:8786"
    )
    grid = parser.add_argument_group("voxel grid")
    step = grid.add_mutually_exclusive_group()
    step.add_argument("--depth", type=whole(3, 20), metavar="N", help="2**N voxels along the root cube, 3 to 20")
    step.add_argument("--voxel-size", type=_positive, metavar="H", help="edge of a voxel, in mesh units")
    step.add_argument("--rtol", type=_positive, metavar="R", help="refine until the volume bounds are this close")
    relaxed = grid.add_mutually_exclusive_group()
    relaxed.add_argument(
        "--tolerance", type=_share, metavar="A", help="share of the surface a kernel point may not face, 0 to 1"
    )
    relaxed.add_argument(
        "--margin", type=_share, metavar="M", help="the same, counted from the smallest share there is"
    )
    grid.add_argument(
        "--frame", choices=("world", "principal"), help="axes of the grid: the world's or the surface's own"
    )


def run(args: argparse.Namespace) -> int:
    """Compute, print, write."""
    output = None if args.output is None else check_output(args.output, _SUFFIXES)
    picture = None if args.picture is None else check_picture(args.picture)
    options = {name: getattr(args, name) for name in _GRID_OPTIONS}
    options = {name: value for name, value in options.items() if value is not None}
    as_grid = bool(options) or (output is not None and output.suffix.lower() in _GRIDS)
    if output is not None and output.exists() and Path(args.mesh).exists() and output.samefile(args.mesh):
        raise UsageError(f"output must not be the mesh itself; got '{display(output)}'")

    if args.stream and picture is not None:
        raise UsageError("--picture must not be given with --stream: a picture wants the mesh in memory")
    if args.scheduler is not None and (not args.stream or as_grid):
        raise UsageError("--scheduler must be given with --stream and without a voxel grid")

    from voxkernel.mesh import as_mesh

    with args.stage(f"reading {display(args.mesh)}"):
        mesh: Any = opened(args.mesh, quiet=args.quiet) if args.stream else as_mesh(args.mesh)
    if as_grid:
        from voxkernel.voxels import voxel_kernel

        with args.stage("computing voxels"):
            kernel: Kernel = voxel_kernel(mesh, domain=args.domain, threads=args.threads, **options)
        document = kernel.to_dict()
        rows = _grid_rows(document)
    else:
        from voxkernel.exact import exact_kernel

        with args.stage("computing the exact kernel"):
            kernel = polytope = exact_kernel(
                mesh, domain=args.domain, threads=args.threads, scheduler=args.scheduler
            )
        document = kernel.to_dict()
        rows = _exact_rows(polytope)
    document = {"file": args.mesh, **document}
    if output is not None:
        with args.stage(f"writing {display(output)}"):
            _write(mesh, kernel, document, output)
        say(f"wrote {display(output)}", quiet=args.quiet)
    if picture is not None:
        from voxkernel.pictures import surface_picture

        shown = kernel
        with args.stage(f"drawing {display(picture)}"):
            if as_grid and kernel.dimension < 3 and not document["tolerance"]:
                # Nothing to see in the grid; the polytope has the proof.
                from voxkernel.exact import exact_kernel

                shown = exact_kernel(mesh, domain=args.domain)
            surface_picture(picture, mesh, shown, title=display(Path(args.mesh).name), up=args.up)
        say(f"wrote {display(picture)}", quiet=args.quiet)
    if args.json:
        print_json(document)
    else:
        print_table({"file": display(args.mesh), **rows})
    return 0


def _kind(dimension: int) -> str:
    return "empty" if dimension < 0 else _NAMES[dimension]


def _exact_rows(kernel: Any) -> dict[str, str]:
    rows = {"kernel": _kind(kernel.dimension)}
    if kernel.dimension >= 0:
        rows |= {
            "volume": number(kernel.volume, 10),
            "area": number(kernel.area, 10),
            "corners": f"{len(kernel.vertices)}",
            "faces": f"{len(kernel.faces)}",
            "deepest point": "  ".join(number(v, 10) for v in kernel.deepest_point),
            "clearance": number(kernel.clearance, 10),
        }
    ids = kernel.certificate.facet_ids
    if ids:
        names = ", ".join(str(i) if i >= 0 else f"domain {-1 - i}" for i in ids)
        rows["proof"] = f"facets {names}"
    if kernel.domain is not None:
        rows["domain"] = kernel.domain.kind + (" (it cuts the kernel)" if kernel.cut_by_domain else "")
    if kernel.unclipped_dimension != kernel.dimension:
        rows["without domain"] = _kind(kernel.unclipped_dimension)
    return rows


def _grid_rows(document: dict[str, Any]) -> dict[str, str]:
    low, high = document["volume_bounds"]
    rows = {
        "kernel": _kind(document["dimension"]),
        "volume": f"{number(low, 10)} to {number(high, 10)}",
        "voxel size": number(document["voxel_size"], 10),
        "depth": str(document["depth"]),
        "voxels inside": f"{document['active_voxel_count']:,}",
        "voxels undecided": f"{document['boundary_voxel_count']:,}",
        "tiles, leaves": f"{document['tiles']:,}, {document['leaves']:,}",
    }
    if document["tolerance"]:
        kind = rows.pop("kernel")
        rows = {"tolerance": number(document["tolerance"], 10), **rows, "exact kernel": kind}
    if document["domain"] is not None:
        rows["domain"] = document["domain"]
    if document["reason"]:
        rows["note"] = document["reason"]
    return rows


def _write(mesh: Any, kernel: Kernel, document: dict[str, Any], path: Path) -> None:
    from voxkernel.exact import KernelPolytope
    from voxkernel.voxels import KernelGrid

    suffix = path.suffix.lower()
    if suffix == ".json":
        write_json(path, document)
    elif suffix == ".glb":
        kernel.to_mesh().write(path)
    elif isinstance(kernel, KernelGrid) and suffix in (".npz", ".vdb"):
        kernel.write(path, metadata={"source": display(Path(document["file"]).name)})
    elif isinstance(kernel, KernelGrid) and suffix in (".vtu", ".vtp"):
        kernel.write(path, surface=mesh)
    elif isinstance(kernel, KernelPolytope) and suffix == ".vtp":
        _write_polygons(path, kernel)
    else:
        kernel.write(path)


def _write_polygons(path: Path, kernel: KernelPolytope) -> None:
    """The faces of a polytope, each with the input facet it lies on."""
    import numpy as np

    from voxkernel._vtk_xml import write_polygons

    sizes = np.array([len(face) for face in kernel.faces], dtype=np.int64)
    flat = np.concatenate([np.zeros(0, np.int64), *kernel.faces])
    write_polygons(path, kernel.vertices, flat, sizes, cell_data={"input_facet": kernel.face_facets})


def _threads(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to 256; got {text}")
    return int(text)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a number above 0; got {text}")
    return value


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"must be a number from 0 to 1; got {text}")
    return value
