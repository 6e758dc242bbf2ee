"""The convex region in which a centre is looked for, and steps uphill that stay in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import nearest_point
from voxkernel._frozen import Frozen
from voxkernel.exact import KernelPolytope
from voxkernel.halfspaces import HalfSpaces

__all__ = ["N_SPREAD", "Field", "Region", "climb", "kernel_region"]

_TOLERANCE = 1e-13  # of the kernel's size: rounding of a projection onto its planes
_ACTIVE = 1e-9  # of the kernel's size: planes this near hold a local optimum
N_SPREAD = 32
_BLOCK = 1 << 13  # planes whose products with all rays are held at a time
_N_CORNERS = 2000

Field = Callable[[NDArray[np.float64]], tuple[float, NDArray[np.float64]]]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Region(Frozen):
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
    k = np.arange(N_SPREAD) + 0.5
    z, turn = 1.0 - 2.0 * k / N_SPREAD, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z * z)
    rays = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1) @ plane
    slack = np.maximum(offsets - normals @ inner, 0.0)
    time = np.full(len(rays), np.inf)
    for first in range(0, len(normals), _BLOCK):
        speed = rays @ normals[first : first + _BLOCK].T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            leave = np.where(speed > 1e-12, slack[first : first + _BLOCK] / speed, np.inf)
        time = np.minimum(time, leave.min(axis=1))
    return inner + np.where(np.isfinite(time), time, 0.0)[:, None] * rays


def climb(field: Field, region: Region, y: NDArray[np.float64], *, rounds: int = 80) -> NDArray[np.float64]:
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
