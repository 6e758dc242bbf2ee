"""Kernels of many cells: the compiled loop first, the general exact code for what it leaves undecided."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import StopFlag, solve_cells, squared_diameter
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.errors import VoxKernelError
from voxkernel.exact import KernelPolytope, kernel_of_halfspaces
from voxkernel.exact.convexity import is_behind_all_planes, is_locally_convex
from voxkernel.halfspaces import HalfSpaces
from voxkernel.polyhedral.cell_sides import exact_volume
from voxkernel.polyhedral.polyhedral_mesh import PolyhedralMesh

__all__ = ["CellKernels", "solve"]

_BELOW_ONE = float(np.nextafter(1.0, 0.0))
_CHUNK = 8192
_SMALLEST = float(np.finfo(np.float64).tiny)
_UNDERFLOW = 1e-305  # in the unit cube: sums of products below it have lost bits
_DECIDED = ("", "convex", "interior point", "witness", "witness nearby")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CellKernels(Frozen):
    """The kernels of the cells of a polyhedral mesh: arrays with one row per cell, read-only.

    Attributes
    ----------
    dimension : (n,) int8
        -1 empty, 0 point, 1 segment, 2 flat polygon, 3 solid; exact for the doubles given. -2 where the cell failed.
    volume : (n,) float64
        Volume of the cell, mesh units cubed; NaN where the cell failed.
    kernel_volume : (n,) float64
        Volume of its kernel; 0 when it is flat or empty.
    volume_share : (n,) float64
        `kernel_volume` / `volume`, in [0, 1]; exactly 1 for convex cells.
    inradius : (n,) float64
        Radius of a largest ball in the kernel, mesh units; 0 when it is flat or empty.
    diameter : (n,) float64
        Largest distance of two vertices of the cell.
    inradius_over_diameter : (n,) float64
        The quotient of the two, in [0, 0.5].
    center : (n, 3) float64
        Centre of that ball, or a point of a flat kernel; NaN when empty.
    n_faces : (n,) int64
        Polygons of the cell.
    decided_by : tuple of str
        "convex", "interior point", "witness" (four faces that exclude each other), "witness nearby" (faces that are
        nearly parallel and exclude each other farther than the kernel can reach), "exact" (rational arithmetic);
        "" where the cell failed.
    facets : tuple of tuples of int
        Faces of the cell that prove an empty or flat kernel.
    reasons : tuple of str
        Why a cell failed; "" for the others.
    """

    dimension: NDArray[np.int8]
    volume: NDArray[np.float64]
    kernel_volume: NDArray[np.float64]
    volume_share: NDArray[np.float64]
    inradius: NDArray[np.float64]
    diameter: NDArray[np.float64]
    inradius_over_diameter: NDArray[np.float64]
    center: NDArray[np.float64]
    n_faces: NDArray[np.int64]
    decided_by: tuple[str, ...]
    facets: tuple[tuple[int, ...], ...]
    reasons: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self.dimension)

    def __repr__(self) -> str:
        """Count the verdicts."""
        solid, failed = int(np.sum(self.dimension == 3)), int(np.sum(self.is_failed))
        return f"CellKernels({len(self)} cells, {solid} star-shaped, {len(self) - solid - failed} not, {failed} failed)"

    @property
    def is_failed(self) -> NDArray[np.bool_]:
        """Whether a cell could not be used, (n,)."""
        return self.dimension == -2

    @property
    def is_star_shaped(self) -> NDArray[np.bool_]:
        """Whether the kernel of a cell has a volume: the cell is star-shaped with respect to a ball, (n,)."""
        return self.dimension == 3

    def to_rows(self) -> list[dict[str, Any]]:
        """Give one row per cell, ready for a table; None where a number is not known.

        Returns
        -------
        list of dict
            `volume` is that of the kernel and `reference_volume` that of the cell.
        """
        return [self._row(i) for i in range(len(self))]

    def _row(self, i: int) -> dict[str, Any]:
        dimension = int(self.dimension[i])
        row: dict[str, Any] = {"cell": i, "n_facets": int(self.n_faces[i]), "n_faces": int(self.n_faces[i])}
        if dimension == -2:
            return {**row, "status": "failed", "reason": self.reasons[i]}
        center = [None if np.isnan(v) else float(v) for v in self.center[i]]
        share = float(self.volume_share[i])
        return {
            **row,
            "status": "ok",
            "reason": "",
            "verdict": "star-shaped" if dimension == 3 else "degenerate" if dimension >= 0 else "not star-shaped",
            "verdict_reason": _verdict_reason(dimension, self.facets[i]),
            "dimension": dimension,
            "ratio": share,
            "volume_share": share,
            "volume": float(self.kernel_volume[i]),
            "reference_volume": float(self.volume[i]),
            "reference": "enclosed volume",
            "inradius": float(self.inradius[i]),
            "clearance": None if dimension < 0 else float(self.inradius[i]),
            "inradius_over_diameter": float(self.inradius_over_diameter[i]),
            "center_x": center[0],
            "center_y": center[1],
            "center_z": center[2],
            "certificate_kind": "solid" if dimension == 3 else "flat" if dimension >= 0 else "empty",
            "certificate_facets": list(self.facets[i]),
        }


def _verdict_reason(dimension: int, facets: tuple[int, ...]) -> str:
    ids = ", ".join(map(str, facets))
    if dimension < 0:
        return f"no point is on the inner side of facets {ids} at once"
    if dimension < 3:
        return f"the kernel is only a {('point', 'segment', 'flat polygon')[dimension]}, held by facets {ids}"
    return ""


@dataclass(slots=True)
class _Answers:
    """Arrays in the making; `numbers` are volume, diameter, kernel volume and inradius."""

    outcome: NDArray[np.int64]
    numbers: NDArray[np.float64]
    center: NDArray[np.float64]
    witness: NDArray[np.int64]
    dimension: NDArray[np.int8]
    share: NDArray[np.float64]
    decided_by: list[str]
    facets: list[tuple[int, ...]]
    reasons: list[str]


def solve(mesh: PolyhedralMesh, rtol: float, threads: int) -> CellKernels:
    """Solve all cells; what the loop leaves open or finds wrong is worked on one by one."""
    n = len(mesh)
    found = _Answers(
        np.zeros(n, np.int64), np.zeros((n, 4)), np.full((n, 3), np.nan), np.full((n, 4), -1, np.int64),
        np.full(n, -2, np.int8), np.zeros(n), [""] * n, [()] * n, [""] * n,
    )  # fmt: skip
    _run_loop(mesh, rtol, threads, found)
    outcome = found.outcome
    found.dimension[(outcome == 1) | (outcome == 2)] = 3
    found.dimension[outcome >= 3] = -1
    volume, kernel = found.numbers[:, 0], found.numbers[:, 2]
    solid = outcome == 2
    found.share[solid] = np.minimum(kernel[solid] / volume[solid], _BELOW_ONE)
    found.share[outcome == 1] = 1.0
    found.decided_by = np.array(_DECIDED, dtype=object)[np.maximum(outcome, 0)].tolist()
    for i in np.flatnonzero(outcome >= 3).tolist():
        found.facets[i] = tuple(sorted(set(found.witness[i].tolist()) - {-1}))
    for i in np.flatnonzero(outcome <= 0).tolist():
        if outcome[i] < 0:
            found.reasons[i] = mesh.problems[i] or _fault(int(outcome[i]), float(volume[i]))
        else:
            found.reasons[i] = _solve_exactly(mesh, i, rtol, found)
    failed = found.dimension == -2
    found.numbers[failed] = np.nan
    found.share[failed] = np.nan
    columns = [read_only(np.ascontiguousarray(column)) for column in found.numbers.T]
    with np.errstate(invalid="ignore"):
        quality = columns[3] / columns[1]
    return CellKernels(
        dimension=read_only(found.dimension),
        volume=columns[0],
        kernel_volume=columns[2],
        volume_share=read_only(found.share),
        inradius=columns[3],
        diameter=columns[1],
        inradius_over_diameter=read_only(quality),
        center=read_only(found.center),
        n_faces=read_only(np.diff(mesh.cell_offsets)),
        decided_by=tuple(found.decided_by),
        facets=tuple(found.facets),
        reasons=tuple(found.reasons),
    )


def _run_loop(mesh: PolyhedralMesh, rtol: float, threads: int, found: _Answers) -> None:
    """Share the cells out; every cell is solved by itself, so the order does not matter."""
    arrays = (
        mesh.vertices, mesh.face_offsets, mesh.face_vertices, mesh.cell_offsets, mesh.cell_faces, mesh.cell_flips,
    )  # fmt: skip
    n = len(mesh)
    step = max(_CHUNK, -(-n // threads)) if threads == 1 else max(256, min(_CHUNK, -(-n // threads)))

    def part(first: int, stop: StopFlag) -> None:
        solve_cells(
            *arrays, first, min(n, first + step), rtol, found.outcome, found.numbers, found.center, found.witness, stop
        )

    run_parts(part, range(0, n, step), threads)


def _fault(outcome: int, number: float) -> str:
    """Say what the loop found wrong with a cell."""
    if outcome == -1:
        return f"open: {number:.0f} edges have an odd number of faces"
    if outcome == -2:
        return f"inconsistent orientation: {number:.0f} edges are traversed unequally in the two directions"
    if outcome == -3:
        return f"inside out: the faces enclose a volume of {number:.6g}"
    if outcome == -4:
        return "a vertex is not finite"
    return "a face has fewer than 3 corners, or there is no face"


def _solve_exactly(mesh: PolyhedralMesh, i: int, rtol: float, found: _Answers) -> str:
    """Decide one cell by the code behind `exact_kernel`; gives the reason where the cell cannot be used."""
    try:
        surface = mesh.cell(i, planarity_rtol=rtol)
        enclosed = exact_volume(surface.vertices, surface.faces)
        if enclosed == 0:
            return "no volume: the faces enclose exactly 0"
        if enclosed < 0:
            return "inside out: the faces enclose a negative volume"
        with np.errstate(over="ignore", invalid="ignore"):  # too large a cell is refused by its numbers
            planes = HalfSpaces._from_spans(surface, 0.0)
        kernel = kernel_of_halfspaces(planes, None)
        volume = float(enclosed)
        if volume < _SMALLEST or (kernel.dimension == 3 and not _has_numbers(kernel, planes.scale)):
            return "too thin: its volume, or that of its kernel, is too small for a double (rescale first)"
    except (VoxKernelError, ValueError, ArithmeticError) as error:
        return str(error)
    found.dimension[i] = kernel.dimension
    found.numbers[i] = volume, _diameter(surface.vertices), kernel.volume, 0.0
    found.center[i] = kernel.deepest_point
    found.decided_by[i] = "exact"
    if kernel.dimension == 3:
        found.numbers[i, 3] = kernel.clearance
        share = kernel.volume / volume
        is_convex = share > 1.0 - 1e-9 and (is_locally_convex(surface, planes) or is_behind_all_planes(surface))
        found.share[i] = 1.0 if is_convex else min(share, _BELOW_ONE)
    else:
        found.facets[i] = tuple(int(f) for f in kernel.certificate.facet_ids)
    return ""


def _has_numbers(kernel: KernelPolytope, scale: float) -> bool:
    """Whether no bit of volume and inradius was lost to underflow, in world units or in the frame of the planes."""
    numbers = ((kernel.volume, scale**3), (kernel.clearance, scale))
    return all(value >= max(_SMALLEST, _UNDERFLOW * unit) for value, unit in numbers)


def _diameter(points: NDArray[np.float64]) -> float:
    """Largest distance of two points of a few."""
    span = float(np.ptp(points, axis=0).max()) or 1.0
    return float(np.sqrt(squared_diameter((points - points[0]) / span))) * span
