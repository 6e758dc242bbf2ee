"""`voxkernel sphere`: a mesh as a radius on the sphere around its best centre."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from voxkernel.cli.argument_types import add_up, three_numbers, whole
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

HELP = "a mesh as a radius on the sphere, from its best centre"
DESCRIPTION = (
    "Project a mesh on the sphere around a point that sees all of it, and measure the radius on a grid.\n"
    "The centre is the kernel point of largest coverage by default. Where the kernel is empty, `--center relaxed`\n"
    "takes the point that turns away the least area. .npz has centre, directions, radii, the grid and the\n"
    "energies of spherical harmonics; .json what is measured at the centre; .ply the reconstruction."
)
EXAMPLES = (
    "voxkernel sphere face.ply",
    "voxkernel sphere face.ply -o map.npz --picture map.html",
    "voxkernel sphere face.ply --center deepest --grid healpix -n 64 -o map.npz",
    "voxkernel sphere scan.ply --center relaxed --picture map.png",
    "voxkernel sphere bust.ply --center 0.1,0,0.2 --json",
)
_CENTERS = ("coverage", "deepest", "centroid", "distortion", "relaxed")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("mesh", metavar="MESH", help=".ply .obj .off .stl .gltf .glb .wrl ...")
    parser.add_argument("-o", "--output", metavar="FILE", help="map.npz, .json or .ply (the reconstruction)")
    parser.add_argument("--picture", metavar="FILE", help="surface, radius and reconstruction: .png or .html")
    add_up(parser)
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    parser.add_argument(
        "--center", type=_center, default="coverage", metavar="C", help=f"{', '.join(_CENTERS)}, or X,Y,Z"
    )
    parser.add_argument(
        "--clearance", type=_nonnegative, default=0.0, metavar="D", help="keep this far from all facet planes"
    )
    parser.add_argument("--domain", choices=("ball", "hull", "box"), help="where to look for the centre")
    grid = parser.add_argument_group("grid")
    grid.add_argument("--grid", choices=("equiangular", "gauss-legendre", "healpix"), default="equiangular")
    grid.add_argument("-n", type=whole(2, 4096), default=128, metavar="N", help="rings, or n_side of healpix")
    grid.add_argument(
        "--degree", type=whole(0, 256), default=32, metavar="L", help="of the spherical harmonics in .npz"
    )


def run(args: argparse.Namespace) -> int:
    """Project, print, write."""
    output = None if args.output is None else check_output(args.output, (".npz", ".json", ".ply"))
    picture = None if args.picture is None else check_picture(args.picture)
    if output is not None and output.exists() and Path(args.mesh).exists() and output.samefile(args.mesh):
        raise UsageError(f"output must not be the mesh itself; got '{display(output)}'")

    with args.stage(f"projecting {display(args.mesh)}"):
        sphere = _project(args)
    document: dict[str, Any] = {"file": args.mesh, **sphere.to_dict()}
    samples = None
    if picture is not None or (output is not None and output.suffix.lower() != ".json"):
        with args.stage("measuring radii"):
            samples = sphere.sample(grid=args.grid, n=args.n)
        with args.stage("measuring the reconstruction"):
            error = sphere.error(samples.reconstruct())
        document["reconstruction"] = {
            "grid": args.grid, "n": args.n, "covered": samples.covered, "hausdorff": error.hausdorff, "rms": error.rms
        }  # fmt: skip
    if output is not None:
        with args.stage(f"writing {display(output)}"):
            _write(sphere, samples, document, output, args.degree)
        say(f"wrote {display(output)}", quiet=args.quiet)
    if picture is not None:
        from voxkernel.pictures import sphere_picture

        with args.stage(f"drawing {display(picture)}"):
            sphere_picture(picture, sphere, samples=samples, title=display(Path(args.mesh).name), up=args.up)
        say(f"wrote {display(picture)}", quiet=args.quiet)
    if args.json:
        print_json(document)
    else:
        print_table({"file": display(args.mesh), **_rows(sphere, document)})
    return 0


def _project(args: argparse.Namespace) -> Any:
    """Project; where the kernel is empty, say what the relaxed centre would lose."""
    from voxkernel.exact import exact_kernel
    from voxkernel.mesh import as_mesh
    from voxkernel.spherical import spherical_map

    mesh = as_mesh(args.mesh)
    try:
        return spherical_map(mesh, center=args.center, clearance=args.clearance, domain=args.domain)
    except ValueError as error:
        chosen = isinstance(args.center, str) and args.center != "relaxed"
        if not chosen or not exact_kernel(mesh, domain=args.domain).is_empty:
            raise
        from voxkernel.relaxed import best_center

        best = best_center(mesh, domain=args.domain)
        place = ", ".join(number(v) for v in best.point)
        raise ValueError(
            f"{display(args.mesh)} has an empty kernel: no point sees all of it. `--center relaxed` takes ({place}), "
            f"which turns away {100 * best.violation_bounds[1]:.3g} % of the area"
        ) from error


def _rows(sphere: Any, document: dict[str, Any]) -> dict[str, str]:
    rows = {
        "centre": f"{sphere.center_kind}: " + "  ".join(number(v, 10) for v in sphere.center),
        "solid angle": f"{number(sphere.solid_angle, 10)} sr, {number(100 * sphere.coverage, 6)} % of the sphere",
        "clearance": number(sphere.clearance, 6),
        "distortion": number(sphere.distortion, 6),
        "hidden": f"{number(100 * sphere.hidden_fraction, 4)} % of the area, {len(sphere.folded_facets)} facets",
    }
    if sphere.certificate is not None:
        ids = ", ".join(str(i) if i >= 0 else f"domain {-1 - i}" for i in sphere.certificate.active_facets.tolist())
        rows["held by"] = f"facets {ids}" if ids else "no facet"
        rows["residual"] = f"{sphere.certificate.residual:.1e}"
    if "reconstruction" in document:
        error = document["reconstruction"]
        rows["reconstruction"] = f"Hausdorff {number(error['hausdorff'], 4)}, rms {number(error['rms'], 4)}"
    if sphere.notes:
        rows["note"] = "; ".join(sphere.notes)
    return rows


def _write(sphere: Any, samples: Any, document: dict[str, Any], path: Path, degree: int) -> None:
    suffix = path.suffix.lower()
    if suffix == ".json":
        write_json(path, document)
    elif suffix == ".ply":
        samples.reconstruct().write(path)
    else:
        import numpy as np

        waves = sphere.harmonics(degree)
        theta, phi = samples.grid.angles()
        np.savez_compressed(
            path, center=sphere.center, solid_angle=sphere.solid_angle, directions=sphere.directions,
            vertex_radii=sphere.radii, triangles=sphere.triangles, triangle_angles=sphere.triangle_angles,
            folded_facets=sphere.folded_facets, hidden_fraction=sphere.hidden_fraction,
            grid=samples.grid.kind, radii=samples.radii, mask=samples.mask, pole_radii=samples.pole_radii,
            colatitude=theta.reshape(samples.radii.shape), longitude=phi.reshape(samples.radii.shape),
            weights=samples.grid.weights.reshape(samples.radii.shape),
            harmonics=waves.coefficients, energies=waves.energies,
        )  # fmt: skip


def _center(text: str) -> Any:
    if text in _CENTERS:
        return text
    point = three_numbers(text)
    if point is None:
        raise argparse.ArgumentTypeError(f"must be {', '.join(_CENTERS)} or three numbers X,Y,Z; got {text}")
    return point


def _nonnegative(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a number not below 0; got {text}")
    return value
