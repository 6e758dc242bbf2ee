#!/usr/bin/env python3
"""Compute the kernels of meshes with several methods, side by side.

One row per mesh and method: file, facets, method, verdict, volume, seconds, agrees. Methods, those that are
installed:
  voxkernel  voxkernel.exact_kernel
  scipy      what one does with SciPy: HiGHS over all facet planes for the deepest point, then Qhull
             (HalfspaceIntersection); it has no answer for flat kernels
  pyvista    the bounding box cut by one facet plane after the other with VTK's clip of a volume: no solver and no
             hull, so an independent check; slow, hence only up to --clip-facets facets; no flat kernels either
trimesh, PyVista, Open3D and PyMeshLab have no function for kernels, and the C++ programs that compute them have no
package for Python. `METHODS` of this script takes further methods.
Open surfaces are cut by their bounding box for all methods. Seconds are for facet planes to volume, without reading,
the least of --repeat rounds. `agrees` compares with the first method: the verdict, and the volume to 1e-6.
Exit code 1 when a mesh cannot be read or a method fails; a disagreement is a result.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import tool

EXAMPLES = (
    "compare_methods.py scans/*.ply",
    "compare_methods.py --shapes 2 --facets 300",
    "compare_methods.py bust.ply --methods voxkernel,scipy --repeat 5 --json",
)
COLUMNS = ("file", "facets", "method", "verdict", "volume", "seconds", "agrees", "reason")
Answer = tuple[str, float]


@dataclass(frozen=True, slots=True)
class Comparison:
    """What one method says about one mesh."""

    file: str
    facets: int
    method: str
    verdict: str
    volume: float | None
    seconds: float | None
    agrees: bool | None
    reason: str = ""


class Skipped(Exception):
    """The method is not meant for this mesh."""


def _verdict(dimension: int) -> str:
    return "star-shaped" if dimension == 3 else "degenerate" if dimension >= 0 else "not star-shaped"


def with_voxkernel(mesh: Any, most: int) -> Answer:
    """Exact kernel of this library."""
    from voxkernel import exact_kernel

    kernel = exact_kernel(mesh, domain=None if mesh.facts().is_closed else "box")
    return _verdict(kernel.dimension), kernel.volume


def with_scipy(mesh: Any, most: int) -> Answer:
    """HiGHS over all rows for a deep point, Qhull for corners and volume."""
    import numpy as np
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    n, d = _float_planes(mesh)
    scale = mesh.facts().diagonal
    middle = mesh.facts().bbox.mean(axis=0)
    d = (d - n @ middle) / scale  # unit coordinates, in which the tolerances of the solvers are meant
    rows = np.column_stack([n, np.ones(len(n))])
    found = linprog([0, 0, 0, -1], A_ub=rows, b_ub=d, bounds=[(None, None)] * 4)
    if found.x is None or found.x[3] <= 0:
        return "not star-shaped", 0.0
    corners = HalfspaceIntersection(np.column_stack([n, -d]), found.x[:3]).intersections
    return "star-shaped", float(ConvexHull(corners[np.isfinite(corners).all(axis=1)]).volume * scale**3)


def with_pyvista(mesh: Any, most: int) -> Answer:
    """Cut a box by every plane with VTK, as one would without a solver."""
    import numpy as np
    import pyvista

    if mesh.n_facets > most:
        raise Skipped(f"more than {most} facets")
    n, d = _float_planes(mesh)
    low, high = mesh.facts().bbox
    scale, middle = mesh.facts().diagonal, (low + high) / 2.0
    half = (high - low) / 2.0 / scale
    body = pyvista.ImageData(dimensions=(2, 2, 2), spacing=2.0 * half, origin=-half).cast_to_unstructured_grid()
    body.points = body.points.astype(np.float64)
    for normal, offset in zip(n, (d - n @ middle) / scale, strict=True):
        if (body.points @ normal > offset + 1e-12).any():  # else it cuts off nothing but rounding
            body = body.clip(normal=normal, origin=normal * offset, invert=True)
        if not body.n_cells:
            return "not star-shaped", 0.0
    volume = float(body.compute_cell_sizes(length=False, area=False)["Volume"].sum()) * scale**3
    return ("star-shaped", volume) if volume > 0 else ("not star-shaped", 0.0)


METHODS: dict[str, tuple[str, Callable[[Any, int], Answer]]] = {
    "voxkernel": ("voxkernel", with_voxkernel),
    "scipy": ("scipy", with_scipy),
    "pyvista": ("pyvista", with_pyvista),
}


def installed() -> list[str]:
    """Name the methods whose packages are installed."""
    return [name for name, (package, _) in METHODS.items() if importlib.util.find_spec(package) is not None]


def _float_planes(mesh: Any) -> tuple[Any, Any]:
    import numpy as np

    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    length = np.linalg.norm(n, axis=1)
    n, a = n[length > 0] / length[length > 0, None], a[length > 0]
    d = np.einsum("ij,ij->i", n, a)
    if not mesh.facts().is_closed:
        low, high = mesh.facts().bbox
        n, d = np.concatenate([n, np.eye(3), -np.eye(3)]), np.concatenate([d, high, -low])
    return n, d


def compare(mesh: Any, file: str, methods: list[str], *, repeat: int = 3, most: int = 150) -> list[Comparison]:
    """Run the methods on a mesh, in turns; `agrees` is about the first one that has an answer."""
    answers: dict[str, Answer] = {}
    seconds: dict[str, float] = {}
    reasons: dict[str, str] = {}
    mesh.facts()  # kept by the mesh: not a part of anyone's time
    for _ in range(repeat):
        for name in methods:
            if name in reasons:
                continue
            start = time.perf_counter()
            try:
                answers[name] = METHODS[name][1](mesh, most)
            except Skipped as reason:
                reasons[name] = f"skipped: {reason}"
            except Exception as error:  # whatever a rival raises is its answer
                reasons[name] = f"failed: {' '.join(str(error).split())[:100] or type(error).__name__}"
            seconds[name] = min(seconds.get(name, float("inf")), time.perf_counter() - start)
    first = next((answers[name] for name in methods if name in answers), None)
    return [
        Comparison(
            file, mesh.n_facets, name, answers[name][0], answers[name][1], seconds[name],
            None if first is None else _agree(first, answers[name]),
        ) if name in answers
        else Comparison(file, mesh.n_facets, name, "-", None, None, None, reasons[name])
        for name in methods
    ]  # fmt: skip


def _agree(one: Answer, other: Answer) -> bool:
    return one[0] == other[0] and abs(one[1] - other[1]) <= 1e-6 * max(one[1], other[1])


def summary(rows: list[Comparison]) -> list[tuple[str, ...]]:
    """Count answers and agreements per method, and add up seconds over the meshes all of them answered."""
    methods = list(dict.fromkeys(row.method for row in rows))
    answered = [{row.file for row in rows if row.method == name and row.seconds is not None} for name in methods]
    common = set.intersection(*answered) if answered else set()
    table: list[tuple[str, ...]] = [("method", "answers", "agree", f"seconds for the {len(common)} all answered")]
    for name, files in zip(methods, answered, strict=True):
        own = [row for row in rows if row.method == name]
        spent = sum(row.seconds or 0.0 for row in own if row.file in common)
        table.append((name, f"{len(files)} of {len(own)}", str(sum(row.agrees is True for row in own)), f"{spent:.4g}"))
    return table


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and print the comparison."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("meshes", nargs="*", metavar="MESH", help=".ply .obj .off .stl ...")
    parser.add_argument("--shapes", type=tool.positive, metavar="N", help="also N of each family of make_shapes")
    parser.add_argument("--facets", type=tool.positive, default=300, help="of these shapes (default 300)")
    parser.add_argument("--seed", type=int, default=0, help="of these shapes (default 0)")
    parser.add_argument("--methods", metavar="A,B,...", help="some of the methods; all that are installed by default")
    parser.add_argument("--repeat", type=tool.positive, default=3, help="rounds (default 3)")
    parser.add_argument("--clip-facets", type=tool.positive, default=150, help="most for pyvista (default 150)")
    parser.add_argument("--csv", action="store_true", help="CSV on stdout")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    return tool.run(_run, parser.parse_args(argv))


def _surfaces(args: argparse.Namespace) -> Iterable[tuple[str, Any]]:
    """Names and what makes the mesh of each."""
    yield from ((path, path) for path in args.meshes)
    if args.shapes:
        from shape_families import FAMILIES, make_shape

        for family in FAMILIES:
            for index in range(args.shapes):
                kind, shape = make_shape(family, index, seed=args.seed, facets=args.facets)
                yield f"{family}/{kind}-{index}", shape.surface


def _run(args: argparse.Namespace) -> int:
    from voxkernel import VoxKernelError, as_mesh

    methods = args.methods.split(",") if args.methods else installed()
    for name in methods:
        if name not in METHODS or name not in installed():
            raise tool.UsageError(f"--methods must be some of {', '.join(installed())}; got '{name}'")
    if not args.meshes and not args.shapes:
        raise tool.UsageError("give meshes or --shapes")
    if args.seed < 0:
        raise tool.UsageError(f"--seed must be at least 0; got {args.seed}")
    rows: list[Comparison] = []
    failed = 0
    tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    compare(as_mesh(tetrahedron), "", methods, repeat=1)  # imports and compiles before the clock runs
    for name, source in _surfaces(args):
        try:
            rows += compare(as_mesh(source), name, methods, repeat=args.repeat, most=args.clip_facets)
        except (VoxKernelError, OSError) as error:
            tool.report_error(f"{name}: {error}")
            failed += 1
    _print(rows, args)
    return tool.FAILED if failed or any(row.reason.startswith("failed") for row in rows) else tool.OK


def _print(rows: list[Comparison], args: argparse.Namespace) -> None:
    if args.json:
        head, *body = summary(rows)
        counts = [dict(zip(head, line, strict=True)) for line in body]
        print(tool.to_json({"rows": [asdict(row) for row in rows], "summary": counts}))
    elif args.csv:
        tool.print_csv(sys.stdout, COLUMNS, [asdict(row) for row in rows])
    else:
        cells = [tuple(_text(getattr(row, name)) for name in COLUMNS) for row in rows]
        print(tool.table([COLUMNS, *cells]))
        print("\n" + tool.table(summary(rows)))


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "NO"
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return "".join(c if c.isprintable() else " " for c in text)


if __name__ == "__main__":
    sys.exit(main())
