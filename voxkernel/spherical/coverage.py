"""The kernel points that cover or distort the sphere most or least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import density_moments, edges_meet
from voxkernel._frozen import Frozen
from voxkernel.mesh import TriangleMesh
from voxkernel.spherical.boundary_angle import FULL_ANGLE, Boundary, solid_angles
from voxkernel.spherical.search_region import N_SPREAD, Field, Region, climb

__all__ = ["CoverageCertificate", "coverage_optimum", "distortion_optimum"]

_N_BEST = 16
_BLOCK = 1 << 13  # planes whose products with all rays are held at a time
# Where a kernel touches the boundary curve the solid angle jumps: stay this share of the way inside.
_PULLED_IN = 1e-6
_OFF_RIM = 1e-3  # of the kernel's size


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CoverageCertificate(Frozen):
    """What shows that no neighbouring kernel point sees the surface under a larger solid angle.

    At a maximum over a convex polytope the gradient is a non-negative combination of the outward normals of
    the planes that hold the point (Karush, Kuhn and Tucker).

    Attributes
    ----------
    gradient : (3,) float64
        Gradient of the solid angle at the optimum, steradian per mesh unit.
    active_facets : (k,) int64
        Facets whose planes hold it there; -1 - j for plane j of the domain.
    multipliers : (k,) float64
        Their non-negative weights.
    residual : float
        Length of what the weighed normals leave of the gradient, over the length of the gradient; 0 where the
        gradient is 0.
    curvature : float
        Largest second derivative along the directions in which the solid angle stays the same to first order
        and no plane is crossed, steradian per squared mesh unit; -inf where there are none. Not positive at a
        maximum.
    n_starts, n_optima : int
        Ascents made, and how many different local maxima they ended in.
    runner_up : float
        The second largest of these, steradian; NaN where there is one only.
    touches_boundary : bool
        The kernel meets the boundary curve of the surface, where the solid angle jumps: the search kept a
        millionth of the way towards the deepest point, or ended at a point off the curve.
    """

    gradient: NDArray[np.float64]
    active_facets: NDArray[np.int64]
    multipliers: NDArray[np.float64]
    residual: float
    curvature: float
    n_starts: int
    n_optima: int
    runner_up: float
    touches_boundary: bool

    def __repr__(self) -> str:
        """Name the planes and the residual."""
        return (
            f"CoverageCertificate(active_facets={self.active_facets.tolist()}, residual={self.residual:.1e}, "
            f"n_optima={self.n_optima})"
        )


def coverage_optimum(mesh: TriangleMesh, region: Region) -> tuple[NDArray[np.float64], CoverageCertificate] | None:
    """Find the point of a kernel that sees the surface under the largest solid angle; None without a boundary."""
    boundary = Boundary.of(mesh)
    if not len(boundary):
        return None
    # The region's own units: the solid angle does not change.
    own = Boundary(
        (boundary.starts - region.origin) / region.size, (boundary.ends - region.origin) / region.size,
        (boundary.apex - region.origin) / region.size,
    )  # fmt: skip
    inside = np.ones(len(mesh.faces), np.int8)

    def times_full(y: NDArray[np.float64]) -> float:
        """How often 4 pi fits in what the boundary does not tell, told by the triangles a little inside."""
        near = y + 1e-3 * (region.inner - y)
        whole_angle = solid_angles(mesh, region.to_world(near), inside)[1]
        return FULL_ANGLE * round((whole_angle - own.angle(near)) / FULL_ANGLE)

    def counted(y: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, slope = own.field(y)
        return value + times_full(y), slope

    def search(field: Field, heights: NDArray[np.float64]) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        order = np.argsort(-heights, kind="stable")
        apart = max(1, len(order) // N_SPREAD)
        starts = [*inner.candidates[order[:_N_BEST]], *inner.candidates[order[::apart]], inner.inner]
        ends = [_polished(own, field, inner, climb(field, inner, y)) for y in starts]
        return ends, np.array([field(y)[0] for y in ends])

    touches = _touches(own, region)
    inner = region.shrunken(_PULLED_IN) if touches else region
    # Where the surface covers a direction twice, the boundary alone does not tell how often 4 pi fits in.
    field = own.field
    ends, values = search(field, own.angles(inner.candidates))
    best = ends[int(np.argmax(values))]
    if times_full(inner.inner) != 0.0 or times_full(best) != 0.0:
        field = counted
        ends, values = search(field, np.array([counted(y)[0] for y in inner.candidates]))
        best = ends[int(np.argmax(values))]
    if touches:  # off the boundary curve the last step to the faces of the kernel is safe
        last = _polished(own, field, region, climb(field, region, best))
        value = field(last)[0]
        if own.distance(last) > _OFF_RIM and value >= values.max():
            ends[int(np.argmax(values))], values[int(np.argmax(values))] = last, value
            best, inner = last, region
    return region.to_world(best), _certificate(own, inner, best, ends, values, touches)


def _touches(own: Boundary, region: Region) -> bool:
    """Whether an edge of the boundary curve meets a region, or nearly so."""
    return edges_meet(own.starts, own.ends, region.normals, region.offsets + 1e-9)


def _polished(own: Boundary, field: Field, region: Region, y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Finish with Newton's steps along the planes that hold the point."""
    free = _free_axes(region, y, own.derivatives(y)[0])[0]
    if not len(free):
        return y
    value = field(y)[0]
    for _ in range(6):
        slope, bend = own.derivatives(y)
        inner_bend = free @ bend @ free.T
        if float(np.linalg.eigvalsh(inner_bend)[-1]) >= 0.0:
            return y
        new = region.nearest(y - np.linalg.solve(inner_bend, free @ slope) @ free)
        if new is None:
            return y
        new_value = field(new)[0]
        if new_value < value - 1e-13:
            return y
        small = float(np.abs(new - y).max()) < 1e-15
        y, value = new, max(value, new_value)
        if small:
            return y
    return y


def _free_axes(
    region: Region, y: NDArray[np.float64], slope: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], float]:
    """Split the gradient on the planes that hold y: directions left free, planes, weights, what remains."""
    from scipy.optimize import nnls

    slope = region.plane @ slope
    held = region.holding(y)
    weights, rest = np.zeros(0), float(np.linalg.norm(slope))
    if len(held):
        weights, rest = nnls(region.normals[held].T, slope)
        used = weights > 1e-9 * max(1e-300, float(np.linalg.norm(slope)))
        held, weights = held[used], weights[used]
    blocked = np.concatenate([np.eye(3) - region.plane, region.normals[held]])
    _, sizes, axes = np.linalg.svd(blocked)
    rank = int((sizes > 1e-9).sum())
    return axes[rank:], held, weights, float(rest)


def _certificate(
    own: Boundary, region: Region, best: NDArray[np.float64], ends: list[NDArray[np.float64]],
    values: NDArray[np.float64],
    touches: bool,
) -> CoverageCertificate:  # fmt: skip
    slope, bend = own.derivatives(best)
    free, held, weights, rest = _free_axes(region, best, slope)
    length = float(np.linalg.norm(region.plane @ slope))
    loose = np.setdiff1d(region.holding(best), held)
    curvature = _largest_curvature(free @ bend @ free.T, region.normals[loose] @ free.T)
    distinct: list[int] = []
    for i in np.argsort(-values, kind="stable"):
        if all(float(np.linalg.norm(ends[i] - ends[j])) > 1e-5 for j in distinct):
            distinct.append(int(i))
    return CoverageCertificate(
        gradient=read_only(slope / region.size),
        active_facets=read_only(region.facet_ids[held]),
        multipliers=read_only(weights / region.size),
        residual=rest / length if length > 0.0 else 0.0,
        curvature=curvature / region.size**2,
        n_starts=len(ends),
        n_optima=len(distinct),
        runner_up=float(values[distinct[1]]) if len(distinct) > 1 else float("nan"),
        touches_boundary=touches,
    )


def _largest_curvature(bend: NDArray[np.float64], loose: NDArray[np.float64]) -> float:
    """Largest second derivative along free directions that planes of weight 0 do not bar, from their normals."""
    n = len(bend)
    if n == 0:
        return -np.inf
    if not len(loose) or n == 3:
        return float(np.linalg.eigvalsh(bend)[-1])
    turn = np.pi * np.arange(720) / 360.0
    rays = np.array([[1.0], [-1.0]]) if n == 1 else np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for first in range(0, len(loose), _BLOCK):
        rays = rays[(rays @ loose[first : first + _BLOCK].T <= 1e-12).all(axis=1)]
    return float(np.einsum("ij,jk,ik->i", rays, bend, rays).max(initial=-np.inf))


def distortion_optimum(
    mesh: TriangleMesh, areas: NDArray[np.float64], region: Region, starts: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Find a kernel point with the least area distortion, from world points to start at; a local search."""
    total_area = float(areas.sum())

    def field(y: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        first, second = np.empty(3), np.empty(3)
        angle, square = density_moments(mesh.vertices, mesh.faces, areas, region.to_world(y), first, second)
        ratio = square * total_area / angle**2
        slope = total_area * (second / angle**2 - 2.0 * square * first / angle**3)
        return -ratio, -region.size * slope

    best, best_value = region.inner, -np.inf
    for start in starts:
        begin = region.nearest((start - region.origin) / region.size)
        end = climb(field, region, region.inner if begin is None else begin)
        value = field(end)[0]
        if value > best_value:
            best, best_value = end, value
    return region.to_world(best)
