"""Solid angle of a surface, and the kernel points that cover or distort the sphere most or least."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import (
    boundary_field,
    cone_angle,
    cone_angles,
    density_moments,
    edges_meet,
    nearest_point,
    triangle_angles,
)
from voxkernel.exact import KernelPolytope
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.facts import half_edges

__all__ = [
    "Boundary", "CoverageCertificate", "Region", "agrees_with_boundary", "coverage_optimum", "distortion_optimum",
    "facet_sides", "kernel_region", "solid_angles",
]  # fmt: skip

_FULL = 4.0 * np.pi
_TOLERANCE = 1e-13  # of the kernel's size: rounding of a projection onto its planes
_ACTIVE = 1e-9  # of the kernel's size: planes this near hold a local optimum
_N_BEST, _N_SPREAD, _N_CORNERS = 16, 32, 2000
# Where a kernel touches the boundary curve the solid angle jumps: stay this share of the way inside.
_PULLED_IN = 1e-6
_OFF_RIM = 1e-3  # of the kernel's size

Field = Callable[[NDArray[np.float64]], tuple[float, NDArray[np.float64]]]


@dataclass(frozen=True, slots=True, repr=False)
class CoverageCertificate:
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


@dataclass(frozen=True, slots=True)
class Boundary:
    """The boundary of a surface as directed edges, an edge for each time it is traversed one way too often."""

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    apex: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Boundary:
        """Collect the edges whose two directions do not balance; inner edges cancel."""
        edges = half_edges(mesh.faces, len(mesh.vertices))
        tail, head = mesh.faces.reshape(-1), mesh.faces[:, [1, 2, 0]].reshape(-1)
        first = edges.order[edges.first]
        low, high = np.minimum(tail[first], head[first]), np.maximum(tail[first], head[first])
        excess = np.add.reduceat(np.where(edges.forward, 1, -1), edges.first)
        excess[low == high] = 0
        times = np.abs(excess)
        forward = np.repeat(excess > 0, times)
        low, high = np.repeat(low, times), np.repeat(high, times)
        starts = mesh.vertices[np.where(forward, low, high)]
        ends = mesh.vertices[np.where(forward, high, low)]
        return cls(starts, ends, _outer_apex(mesh))

    def __len__(self) -> int:
        """Return the number of edges."""
        return len(self.starts)

    def derivatives(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gradient and Hessian of the solid angle at x: they depend on the boundary only."""
        gradient, hessian = np.empty(3), np.empty((3, 3))
        boundary_field(self.starts, self.ends, x, gradient, hessian)
        return gradient, hessian

    def angle(self, x: NDArray[np.float64]) -> float:
        """Solid angle at x between 0 and 4 pi, right up to multiples of 4 pi."""
        return _wrapped(cone_angle(self.starts, self.ends, self.apex, x))

    def angles(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """`angle` of many points."""
        values = np.empty(len(points))
        cone_angles(self.starts, self.ends, self.apex, points, values)
        return _wrapped(values)

    def distance(self, x: NDArray[np.float64]) -> float:
        """Distance of a point from the boundary curve."""
        along, to = self.ends - self.starts, x - self.starts
        length = np.maximum((along * along).sum(axis=1), 1e-300)
        place = np.clip((to * along).sum(axis=1) / length, 0.0, 1.0)
        return float(np.linalg.norm(to - place[:, None] * along, axis=1).min())

    def field(self, x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Solid angle and gradient."""
        return self.angle(x), self.derivatives(x)[0]


def _wrapped(angle: Any) -> Any:
    """Into [0, 4 pi), but rounding below 0 stays near 0."""
    return np.mod(angle + 1e-9, _FULL) - 1e-9


def _outer_apex(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Choose a point in front of a facet, so outside the kernel, on the side the surface faces most."""
    corners = mesh.vertices[mesh.faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = doubled.sum(axis=0)
    towards = doubled @ (facing if facing.any() else doubled[0])
    best = int(np.argmax(towards))
    length = float(np.linalg.norm(doubled[best]))
    size = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    normal = doubled[best] / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return corners[best].mean(axis=0) + size * normal


def agrees_with_boundary(
    mesh: TriangleMesh, boundary: Boundary, center: NDArray[np.float64], *, tolerance: float = 1e-9
) -> bool:
    """Whether the triangles add up to what the boundary says: they do not at a centre too near to them."""
    total = solid_angles(mesh, center, np.ones(len(mesh.faces), np.int8))[1]
    off = (total - boundary.angle(center)) / _FULL
    return abs(off - round(off)) * _FULL < tolerance


def facet_sides(mesh: TriangleMesh, halfspaces: HalfSpaces, violated: NDArray[np.int64]) -> NDArray[np.int8]:
    """Say of each triangle on which side of it a centre lies: 1 inner, -1 outer, 0 no area, 2 for floats to find.

    `violated` are the half-spaces the centre is strictly outside of. Facets with several planes (polygons
    that are not planar) are left to floating point.
    """
    of_facet = np.zeros(mesh.n_input_facets, np.int8)
    of_facet[halfspaces.facet_ids] = 1
    of_facet[halfspaces.facet_ids[violated]] = -1
    of_facet[mesh.nonplanar_facets] = 2
    return of_facet[mesh.facet_ids]


def solid_angles(
    mesh: TriangleMesh, center: NDArray[np.float64], side: NDArray[np.int8]
) -> tuple[NDArray[np.float64], float, float]:
    """Signed solid angle of each triangle, their sum, and the sum of their sizes; steradian."""
    angles = np.empty(len(mesh.faces))
    total, size = triangle_angles(mesh.vertices, mesh.faces, center, side, angles)
    return angles, total, size


@dataclass(frozen=True, slots=True)
class Region:
    """A convex polytope to search, in units of its own size: `normals . y <= offsets`, y = (x - origin) / size.

    `plane` projects on the directions a flat polytope extends in. `candidates` are corners, face centres
    and points of the boundary in fixed directions, and `inner` is a point of the relative interior.
    """

    origin: NDArray[np.float64]
    size: float
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    facet_ids: NDArray[np.int64]
    plane: NDArray[np.float64]
    candidates: NDArray[np.float64]
    inner: NDArray[np.float64]

    def to_world(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """From own units."""
        return self.origin + self.size * y

    def nearest(self, y: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """The point of the region nearest to y; None where rounding forbids to tell."""
        found = np.empty(3)
        return found if nearest_point(self.normals, self.offsets, y, _TOLERANCE, found) else None

    def shrunken(self, share: float) -> Region:
        """Move every point this share of the way to the inner one."""
        offsets = self.offsets - share * (self.offsets - self.normals @ self.inner)
        candidates = self.candidates + share * (self.inner - self.candidates)
        return replace(self, offsets=offsets, candidates=candidates)

    def holding(self, y: NDArray[np.float64]) -> NDArray[np.int64]:
        """Planes that y lies on."""
        return np.flatnonzero(self.offsets - self.normals @ y <= _ACTIVE)


def kernel_region(kernel: KernelPolytope, halfspaces: HalfSpaces) -> Region:
    """Make a non-empty kernel searchable; `halfspaces` are those of its surface, without the domain."""
    corners = kernel.vertices
    origin = corners.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(corners, axis=0))) or 1.0
    local = (corners - origin) / size
    if kernel.dimension == 3:
        normals, offsets, ids = _bounding_planes(kernel, halfspaces)
        offsets = (offsets - normals @ origin) / size
        plane = np.eye(3)
        inner = (kernel.deepest_point - origin) / size
    else:
        _, _, axes = np.linalg.svd(local)
        axes = axes[: kernel.dimension]
        plane, inner = axes.T @ axes, np.zeros(3)
        local = local @ plane
        normals, offsets = _rim(kernel, local, axes)
        ids = np.full(len(offsets), -1, np.int64)
    # Neighbouring corners of a round kernel lead to the same optimum: a few thousand are enough.
    candidates = [local[:: 1 + len(local) // _N_CORNERS]]
    if kernel.dimension > 0:
        candidates.append(_spread(normals, offsets, inner, plane))
    if kernel.dimension >= 2:
        centers = _face_centers(kernel, local)
        candidates.append(centers[:: 1 + len(centers) // _N_CORNERS])
    return Region(origin, size, normals, offsets, ids, plane, np.concatenate(candidates), inner)


def _bounding_planes(
    kernel: KernelPolytope, halfspaces: HalfSpaces
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Planes of the facets and of the domain that made the faces of a kernel."""
    made = np.unique(kernel.face_facets)
    rows = np.flatnonzero(np.isin(halfspaces.facet_ids, made[made >= 0]))
    normals, offsets, ids = halfspaces.normals[rows], halfspaces.offsets[rows], halfspaces.facet_ids[rows]
    if kernel.domain is not None:
        planes = -1 - made[made < 0]
        normals = np.concatenate([normals, kernel.domain.normals[planes]])
        offsets = np.concatenate([offsets, kernel.domain.offsets[planes]])
        ids = np.concatenate([ids, -1 - planes])
    return np.ascontiguousarray(normals), offsets, ids


def _rim(
    kernel: KernelPolytope, local: NDArray[np.float64], axes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bound a flat kernel inside its own plane, a segment on its own line; a point needs no planes."""
    if kernel.dimension == 0:
        return np.empty((0, 3)), np.empty(0)
    if kernel.dimension == 1:
        return np.concatenate([axes, -axes]), np.array([(local @ axes[0]).max(), -(local @ axes[0]).min()])
    ring = local[kernel.faces[0]]
    along = np.roll(ring, -1, axis=0) - ring
    normals = np.cross(along, np.cross(axes[0], axes[1]))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    if float((normals * ring).sum()) < 0.0:
        normals = -normals
    return normals, (normals * ring).sum(axis=1)


def _face_centers(kernel: KernelPolytope, local: NDArray[np.float64]) -> NDArray[np.float64]:
    sizes = np.diff(kernel.face_starts)
    sums = np.add.reduceat(local[kernel.face_vertices], kernel.face_starts[:-1])
    return sums / sizes[:, None]


def _spread(
    normals: NDArray[np.float64], offsets: NDArray[np.float64], inner: NDArray[np.float64], plane: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where rays in fixed directions (a Fibonacci spiral) from an inner point leave the region."""
    k = np.arange(_N_SPREAD) + 0.5
    z, turn = 1.0 - 2.0 * k / _N_SPREAD, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z * z)
    rays = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1) @ plane
    speed = rays @ normals.T
    slack = np.maximum(offsets - normals @ inner, 0.0)
    time = np.where(speed > 1e-12, slack / np.where(speed > 1e-12, speed, 1.0), np.inf).min(axis=1)
    return inner + np.where(np.isfinite(time), time, 0.0)[:, None] * rays


def _climb(field: Field, region: Region, y: NDArray[np.float64], *, rounds: int = 80) -> NDArray[np.float64]:
    """Go uphill inside a region by projected gradients with Barzilai and Borwein's steps."""
    value, slope = field(y)
    slope = region.plane @ slope
    steep = float(np.linalg.norm(slope))
    step = 0.25 / steep if steep > 0.0 else 0.0
    for _ in range(rounds):
        step, new = _uphill(field, region, y, value, slope, step)
        if new is None:
            return y
        new_value, new_slope = field(new)
        new_slope = region.plane @ new_slope
        path, bend = new - y, new_slope - slope
        stop = float(np.linalg.norm(path)) < 1e-12
        curved = float(path @ bend)
        step = float(path @ path) / -curved if curved < 0.0 else 4.0 * step
        y, value, slope = new, new_value, new_slope
        if stop:
            return y
    return y


def _uphill(
    field: Field, region: Region, y: NDArray[np.float64], value: float, slope: NDArray[np.float64], step: float
) -> tuple[float, NDArray[np.float64] | None]:
    """Shorten a step until it gains enough; None where none does."""
    for _ in range(40):
        new = region.nearest(y + step * slope)
        if new is None or float(np.abs(new - y).max()) < 1e-14:
            return step, None
        if field(new)[0] >= value + 1e-4 * float(slope @ (new - y)):
            return step, new
        step *= 0.25
    return step, None


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
        return _FULL * round((whole_angle - own.angle(near)) / _FULL)

    def counted(y: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, slope = own.field(y)
        return value + times_full(y), slope

    def search(field: Field, heights: NDArray[np.float64]) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        order = np.argsort(-heights, kind="stable")
        apart = max(1, len(order) // _N_SPREAD)
        starts = [*inner.candidates[order[:_N_BEST]], *inner.candidates[order[::apart]], inner.inner]
        ends = [_polished(own, field, inner, _climb(field, inner, y)) for y in starts]
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
        last = _polished(own, field, region, _climb(field, region, best))
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
    rays = rays[(rays @ loose.T <= 1e-12).all(axis=1)]
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
        end = _climb(field, region, region.inner if begin is None else begin)
        value = field(end)[0]
        if value > best_value:
            best, best_value = end, value
    return region.to_world(best)
