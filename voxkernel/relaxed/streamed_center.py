"""The point that faces the most of a streamed surface, with certain bounds."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import least_violated
from voxkernel.exact import KernelPolytope
from voxkernel.exact.exact_kernel import kernel_of_stream
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.halfspaces.surface_arguments import SurfaceArgument, surface_argument
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.facet_weights import UNITS, WeighedPlanes, weigh
from voxkernel.relaxed.root_cube import RootCube, cube_planes
from voxkernel.relaxed.star_center import MAX_CELLS, StarCenter, skew_cube
from voxkernel.relaxed.streamed_violation import StreamedWeights, relaxed_region
from voxkernel.relaxed.thick_planes import ThickPlanes

__all__ = ["center_of_stream", "streamed_center"]

_MOST_PLANES = 1 << 20
_LEVELS = 26
_UNIT = 2.0**-53
_IN_THE_CUBE = read_only(np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0]))  # planes that are there already



class InMemory(Protocol):
    """Finds the least violated point of planes in memory."""

    def __call__(
        self, planes: WeighedPlanes, surface: SurfaceArgument, domain: Any, gap: float, ratio: float = 0.0, *,
        threads: int = 1,
    ) -> StarCenter:
        """See `center_of_planes`."""
        ...


def streamed_center(
    reader: SurfaceReader, domain: Any, weights: Any, gap: float, ratio: float, in_memory: InMemory, threads: int = 1
) -> StarCenter:
    """Find the least violated point of a stream."""
    if not isinstance(weights, str):
        raise ValueError("`weights` must be 'area' or 'count' for a streamed surface; got an array")
    kernel = kernel_of_stream(reader, domain)
    return center_of_stream(reader, kernel, domain, weights, gap, ratio, in_memory, threads)


def center_of_stream(
    reader: SurfaceReader,
    kernel: KernelPolytope,
    domain: Any,
    weights: str,
    gap: float,
    ratio: float,
    in_memory: InMemory,
    threads: int = 1,
) -> StarCenter:
    """Find the least violated point of a stream whose kernel is known; `in_memory` does it for few facets.

    Notes
    -----
    Where the kernel is empty and there are more facets than 2**20, planes that nearly agree are gathered in thick
    ones: lower bounds stay certain. What the point found really violates is counted in one more pass.
    """
    if not kernel.is_empty:
        return StarCenter(kernel.deepest_point, (0.0, 0.0), kernel.domain, 0, "")
    if reader.facts().n_planes <= _MOST_PLANES:
        found = surface_argument(reader.to_mesh())
        return in_memory(weigh(found.halfspaces, weights, mesh=found.mesh), found, domain, gap, ratio, threads=threads)
    weighed = StreamedWeights(reader, weights)
    known = weighed.share_of_facets([i for i in kernel.certificate.facet_ids if i >= 0])
    region = relaxed_region(reader, domain)
    cube = skew_cube(region, np.eye(3))
    thick = _gathered(weighed, cube)
    point, best, lower, n_cells = _searched(thick, weighed, region, cube, gap, ratio, threads)
    slack = weighed.slack
    low = min(best, max(0, lower - slack)) / UNITS if lower else 0.0
    high = min(UNITS, best + slack) / UNITS if best else 0.0
    low = min(high, max(float(np.nextafter(low, -np.inf)), known, 0.0))
    reason = ""
    if high - low > max(gap, ratio * high) + 4 * slack / UNITS:
        reason = "the least violated points fill no volume, or more cells are needed than allowed"
        if thick.width:
            reason = f"{weighed.planes.n_facet_planes:,} planes were gathered in {len(thick.offsets):,} thick ones"
    return StarCenter(read_only(point), (low, min(1.0, float(np.nextafter(high, np.inf)))), region, n_cells, reason)


def _gathered(weighed: StreamedWeights, cube: RootCube) -> ThickPlanes:
    """All planes in the unit cube, gathered where there are too many."""
    thick = ThickPlanes(_MOST_PLANES)
    for part in weighed.chunks("gather"):
        normals, offsets, _, pads = cube_planes(part.facets, cube, _LEVELS)
        thick.add(normals, offsets, pads, part.weights)
    return thick


def _searched(
    thick: ThickPlanes, weighed: StreamedWeights, region: Domain, cube: RootCube, gap: float, ratio: float, threads: int
) -> tuple[NDArray[np.float64], int, int, int]:
    """Branch and bound over cells with the thick planes; the upper bound is counted with all of them."""
    point = region.vertices.mean(axis=0)
    best = int(weighed.violated(point[None])[0])
    border = HalfSpaces.from_planes(region.normals, region.offsets)
    edges = cube_planes(border, cube, _LEVELS)
    arrays = (
        thick.normals, thick.offsets, thick.pads, thick.weights, _IN_THE_CUBE, edges[0], edges[1], edges[3],
    )  # fmt: skip
    blur = 8 * _UNIT * (1.0 + float(np.abs(cube.corner).max()) / cube.edge)
    unit, open_cell = np.full(3, np.nan), np.full(4, np.nan)
    _, lower, n_cells, _ = least_violated(
        *arrays, blur, best + 1, int(gap * UNITS), ratio, _LEVELS, MAX_CELLS, threads, unit, open_cell
    )
    if not np.isnan(unit).any():
        found = cube.to_world(unit)
        reached = int(weighed.violated(found[None])[0])
        if reached < best:
            point, best = found, reached
    return point, best, min(lower, best), n_cells
