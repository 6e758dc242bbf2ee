#!/usr/bin/env python3
"""Compute what a manifest lists about meshes, and print where it differs.

MANIFEST is a CSV with a column `file` (relative to the manifest's folder, or to the folder above) and any of
  counts      vertices, faces, facets, degenerate_faces, boundary_loops, nonmanifold_edges, bodies, euler
  facts       topology, watertight, orientation, diag, mesh_volume, volume
  kernels     kernel_nonempty, kernel_volume, kernel_unbounded, t, t_bbox, is_star_shaped, dimension, truth
  violation   min_violated_area_frac (an upper bound of the smallest), defect (the smallest)
Other columns and empty cells are not compared. Numbers agree within --rtol.
Conventions: kernel_volume, t_bbox and kernel_unbounded of open surfaces are taken inside the bounding box. t is
compared where it is the radius of the largest ball in a bounded kernel: where it is positive and the surface is
closed; t and t_bbox agree to 2e-7 of the diagonal, the tolerance of the linear program they are from.
min_violated_area_frac was searched for within 1.5 edges of the bounding box from its middle, and may not be below the
certain lower bound there. Two ways of counting are accepted: boundary loops that touch as one or as several, and
edges of triangles that name a vertex twice or not; --notes names the rows where it matters.
Differences go to stdout, one a line: file, column, listed, found. Exit code 1 when there are any.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import tool

EXAMPLES = (
    "check_manifest.py data/manifest.csv",
    "check_manifest.py data/polyhedral/cells.csv --json",
    "check_manifest.py shapes/manifest.csv --columns dimension,defect",
)


class Difference(NamedTuple):
    """One value of a manifest that is not what was computed."""

    file: str
    column: str
    listed: str
    found: str


@dataclass(slots=True)
class Checked:
    """What came of a manifest."""

    differences: list[Difference]
    notes: list[str]
    n_rows: int = 0
    n_values: int = 0


class Measured:
    """Facts of one mesh, computed when first asked for."""

    def __init__(self, path: Path) -> None:
        from voxkernel import as_mesh

        self.mesh = as_mesh(path)
        self.facts = self.mesh.facts()

    @cached_property
    def kernel(self) -> Any:
        """The kernel; of open surfaces inside the bounding box."""
        from voxkernel import exact_kernel

        return exact_kernel(self.mesh, domain=None if self.facts.is_closed else "box")

    @cached_property
    def dimension(self) -> int:
        """Of the kernel without a domain."""
        return self.kernel.unclipped_dimension

    def violation_bounds(self, *, wide: bool) -> tuple[float, float]:
        """Bounds on the smallest violation in the usual domain, or within 1.5 box edges of the box's middle."""
        import numpy as np

        from voxkernel import best_center

        domain = None
        if wide:
            low, high = self.facts.bbox
            middle, reach = (low + high) / 2.0, 1.5 * (high - low) + 1e-12 * self.facts.diagonal
            sides = np.concatenate([np.eye(3), -np.eye(3)])
            domain = sides, sides @ middle + np.concatenate([reach, reach])
        return best_center(self.mesh, domain=domain, gap=1e-3 if wide else 1e-12, relative_gap=1e-3).violation_bounds

    @cached_property
    def joined_loops(self) -> int:
        """Boundary loops, those that share a vertex as one."""
        parts: list[set[int]] = []
        for loop in self.facts.boundary_loops:
            touched = set(loop.tolist())
            rest = [part for part in parts if not part & touched]
            parts = [*rest, touched.union(*(part for part in parts if part & touched))]
        return len(parts)

    @cached_property
    def edges_of_all(self) -> tuple[int, int]:
        """Edges of three or more triangles and Euler characteristic, if triangles that name a vertex twice count."""
        import numpy as np

        faces = self.mesh.faces
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        unique, times = np.unique(edges, axis=0, return_counts=True)
        return int((times > 2).sum()), len(np.unique(faces)) - len(unique) + len(faces)


Row = dict[str, str]
_LP = 2e-7  # a linear program in unit coordinates satisfies its constraints to 1e-7
# Says what was found: None where the listed value agrees, "" where there is nothing to compare.
Check = Callable[[Measured, str, Row, float], str | None]


def _counted(get: Callable[[Measured], int], other: Callable[[Measured], int] | None = None) -> Check:
    def check(found: Measured, listed: str, row: Row, rtol: float) -> str | None:
        count = get(found)
        if count == int(listed):
            return None
        if other is not None and other(found) == int(listed):
            return f"~{count}"
        return str(count)

    return check


def _number(
    get: Callable[[Measured], float],
    when: Callable[[Measured, Row, float], bool] | None = None,
    least: float = 1e-12,
) -> Check:
    def check(found: Measured, listed: str, row: Row, rtol: float) -> str | None:
        value = float(listed)
        if when is not None and not when(found, row, value):
            return ""
        number = get(found)
        close = math.isclose(number, value, rel_tol=rtol, abs_tol=least * found.facts.diagonal)
        return None if close else repr(number)

    return check


def _word(get: Callable[[Measured, Row], str]) -> Check:
    def check(found: Measured, listed: str, row: Row, rtol: float) -> str | None:
        word = get(found, row)
        return None if word == listed else word

    return check


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _orientation(found: Measured, row: Row) -> str:
    if row["orientation"] not in ("inward", "outward"):
        return "ok" if found.facts.is_oriented else "not oriented"
    return {True: "outward", False: "inward", None: "none"}[found.facts.is_outward]


def _at_most(found: Measured, listed: str, row: Row, rtol: float) -> str | None:
    """A listed share somewhere near cannot be below the certain lower bound; it is written with six digits."""
    low = found.violation_bounds(wide=True)[0]
    return None if low <= float(listed) * (1 + 1e-3) + 1e-6 else f"at least {low!r}"


def _defect(found: Measured, listed: str, row: Row, rtol: float) -> str | None:
    """The certain bounds have to hold the listed share; how far apart they are is not compared."""
    value = float(listed)
    if found.dimension >= 0:  # some point faces everything, if perhaps far outside the usual domain
        return None if value == 0 else "0.0"
    low, high = found.violation_bounds(wide=False)
    return None if low * (1 - rtol) <= value <= high * (1 + rtol) else f"{low!r} to {high!r}"


def _truth(found: Measured, row: Row) -> str:
    d = found.dimension
    return "star-shaped" if d == 3 else "degenerate" if d >= 0 else "not star-shaped"


CHECKS: dict[str, Check] = {
    "vertices": _counted(lambda m: m.facts.n_vertices),
    "faces": _counted(lambda m: m.facts.n_facets),
    "facets": _counted(lambda m: m.facts.n_facets),
    "degenerate_faces": _counted(lambda m: len(m.facts.degenerate_facets)),
    "boundary_loops": _counted(lambda m: len(m.facts.boundary_loops), lambda m: m.joined_loops),
    "nonmanifold_edges": _counted(lambda m: m.facts.n_nonmanifold_edges, lambda m: m.edges_of_all[0]),
    "bodies": _counted(lambda m: m.facts.n_components),
    "euler": _counted(lambda m: m.facts.euler_characteristic, lambda m: m.edges_of_all[1]),
    "topology": _word(lambda m, row: "closed" if m.facts.is_closed else "open"),
    "watertight": _word(lambda m, row: str(m.facts.is_closed)),
    "orientation": _word(_orientation),
    "diag": lambda m, listed, row, rtol: _number(lambda m: m.facts.diagonal)(m, listed, row, max(rtol, 1e-5)),
    "mesh_volume": _number(lambda m: m.facts.volume),
    "volume": _number(lambda m: m.facts.volume),
    "kernel_nonempty": _word(lambda m, row: _yes(m.dimension >= 0)),
    "is_star_shaped": _word(lambda m, row: _yes(m.dimension >= 0)),
    "dimension": _counted(lambda m: m.dimension),
    "truth": _word(_truth),
    "kernel_volume": _number(lambda m: m.kernel.volume),
    "kernel_unbounded": _word(lambda m, row: _yes(not m.kernel.is_bounded)),
    "t": _number(lambda m: m.kernel.clearance, lambda m, row, t: m.facts.is_closed and t > 0, _LP),
    "t_bbox": _number(
        lambda m: m.kernel.clearance, lambda m, row, t: row.get("kernel_nonempty") == "yes" and t > 0, _LP
    ),
    "min_violated_area_frac": _at_most,
    "min_violated_area_frac_upper_bound": _at_most,
    "defect": _defect,
}


def check_manifest(
    manifest: Path, *, columns: list[str] | None = None, rtol: float = 1e-6, quiet: bool = True
) -> Checked:
    """Compare the columns of a manifest with what the library computes.

    Raises
    ------
    ValueError
        If the manifest has no column `file`, or none that can be compared.
    """
    rows = tool.read_csv(manifest)
    named = list(rows[0]) if rows else []
    chosen = [name for name in (columns or CHECKS) if name in named]
    if "file" not in named or not chosen:
        raise ValueError(f"`manifest` must have rows with `file` and columns to compare; got {', '.join(named)}")
    result = Checked([], [])
    for row in rows:
        _check_row(result, manifest.absolute().parent, row, chosen, rtol)
        result.n_rows += 1
        tool.progress(result.n_rows, len(rows), "meshes", quiet=quiet)
    return result


def _check_row(result: Checked, folder: Path, row: Row, columns: list[str], rtol: float) -> None:
    from voxkernel import VoxKernelError

    file = row["file"]
    path = folder / file if (folder / file).exists() else folder.parent / file
    is_broken = row.get("truth") == "broken"
    try:
        found = Measured(path)
    except VoxKernelError as error:
        if not is_broken:
            result.differences.append(Difference(file, "file", "a mesh", str(error)))
        return
    if is_broken:
        result.differences.append(Difference(file, "truth", "broken", "a mesh"))
        return
    for column in columns:
        listed = row[column]
        if not listed:
            continue
        try:
            answer = CHECKS[column](found, listed, row, rtol)
        except ValueError as error:  # a cell that is no number
            answer = str(error)
        if answer == "":
            continue
        result.n_values += 1
        if answer is not None and answer.startswith("~"):
            result.notes.append(f"{file}: {column} is {listed}, here {answer[1:]}: the other way of counting")
        elif answer is not None:
            result.differences.append(Difference(file, column, listed, answer))


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and print the differences."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("manifest", metavar="MANIFEST", help="a CSV with a column `file`")
    parser.add_argument("--columns", metavar="A,B,...", help="compare only these columns")
    parser.add_argument("--rtol", type=float, default=1e-6, help="relative tolerance of numbers (default 1e-6)")
    parser.add_argument("--notes", action="store_true", help="name the rows that are counted in another way, on stderr")
    parser.add_argument("--json", action="store_true", help="one JSON document")
    return tool.run(_run, parser.parse_args(argv))


def _run(args: argparse.Namespace) -> int:
    columns = args.columns.split(",") if args.columns else None
    unknown = sorted(set(columns or ()) - set(CHECKS))
    if unknown:
        raise tool.UsageError(f"--columns must be some of {', '.join(CHECKS)}; got '{unknown[0]}'")
    if not args.rtol > 0:
        raise tool.UsageError(f"--rtol must be > 0; got {args.rtol:g}")
    result = check_manifest(Path(args.manifest), columns=columns, rtol=args.rtol, quiet=args.quiet)
    if args.json:
        differences = [difference._asdict() for difference in result.differences]
        print(tool.to_json({"rows": result.n_rows, "values": result.n_values, "differences": differences}))
    elif result.differences:
        print(tool.table([Difference._fields, *(tuple(map(_one_line, d)) for d in result.differences)]))
    if args.notes:
        for note in result.notes:
            tool.say(note, quiet=args.quiet)
    counts = f"{result.n_rows} meshes, {result.n_values} values compared, {len(result.differences)} differences"
    tool.say(f"{counts}, {len(result.notes)} counted in another way", quiet=args.quiet)
    return tool.FAILED if result.differences else tool.OK


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


if __name__ == "__main__":
    sys.exit(main())
