"""How much of a surface points do not face: `violation`."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_points
from voxkernel._core import StopFlag, violated_weights
from voxkernel._threads import run_parts
from voxkernel.halfspaces.surface_arguments import SurfaceLike, surface_argument
from voxkernel.relaxed.facet_weights import UNITS, WeighedPlanes, weigh

__all__ = ["Weights", "violated_units", "violation"]

_THREAD_CHUNK = 1 << 15

Weights = Literal["area", "count"] | ArrayLike


def violation(
    surface: SurfaceLike, points: ArrayLike, *, weights: Weights = "area", facets: Any = None, threads: int = 1
) -> NDArray[np.float64]:
    """Compute the share of a surface that points do not face.

    The violation of x is the weight of the facets with `n . x > d`, over the weight of all. It is 0 exactly
    in the kernel.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or HalfSpaces
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or half-spaces.
    points : (n, 3) array_like
        World coordinates.
    weights : {"area", "count"} or (k,) array_like
        What a facet counts: its area, 1, or the number >= 0 given for each facet id.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    threads : int
        Threads for large batches; the result does not depend on it.

    Returns
    -------
    (n,) float64
        In [0, 1]. Empty for n = 0.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the surface, the points or the weights cannot be used.

    Notes
    -----
    Every sign is exact for the doubles given; a point on a facet's plane does not violate it. Weights are
    rounded to 60 bits of their sum: the result is within (k + 1024) 2**-60 of the exact share, for k facets
    with the weights of `HalfSpaces.weights`, rounded once to a double. Points are divided like a kd-tree and
    each part keeps the planes that may cross it, so that a million points cost far less than a sweep.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section 2.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> voxkernel.violation(tetrahedron, [[0.1, 0.1, 0.1], [0.1, 0.1, -1.0]], weights="count")
    array([0.  , 0.25])
    """
    xyz = as_points("points", points)
    n_threads = as_depth("threads", threads, 1, 256)
    found = surface_argument(surface, facets)
    units = violated_units(weigh(found.halfspaces, weights, mesh=found.mesh), xyz, threads=n_threads)
    return units / UNITS


def violated_units(planes: WeighedPlanes, points: NDArray[np.float64], *, threads: int = 1) -> NDArray[np.int64]:
    """Add up the integer weights that points violate, every sign exact."""
    facets = planes.facets
    with np.errstate(over="ignore", invalid="ignore"):
        local = np.ascontiguousarray(facets.to_local(points).T)
    sums = np.zeros(len(points), np.int64)
    arrays = (
        local, points, facets.local_normals, facets.local_offsets, facets.local_errors, planes.weights,
        facets.corner_ids(), facets.vertices, _expansions_hold(facets.vertices) and _expansions_hold(points),
    )  # fmt: skip
    parts = _parts_of(local, max(1, min(4 * threads, len(points) // _THREAD_CHUNK)) if threads > 1 else 1)

    def run(part: NDArray[np.int64], stop: StopFlag) -> NDArray[np.int64]:
        return violated_weights(*arrays, part, sums, stop)

    for p, i in np.concatenate(run_parts(run, parts, threads)):
        a, b, c, d = facets.integer_planes([i])[0]
        x, y, z = facets.world_to_lattice([Fraction(float(v)) for v in points[p]])
        if a * x + b * y + c * z > d:
            sums[p] += planes.weights[i]
    return sums


def _expansions_hold(values: NDArray[np.float64]) -> bool:
    """Whether products of these coordinates neither overflow nor underflow in expansion arithmetic."""
    used = np.abs(values)
    if used.size == 0:
        return True
    return bool(used.max() <= 2.0**200 and np.min(used, where=used > 0, initial=1.0) >= 2.0**-200)


def _parts_of(local: NDArray[np.float64], count: int) -> list[NDArray[np.int64]]:
    """Divide points into slabs along their longest extent."""
    n = local.shape[1]
    if count == 1:
        return [np.arange(n)]
    axis = int(np.argmax(np.ptp(local, axis=1)))
    cuts = [n * k // count for k in range(1, count)]
    return np.split(np.argpartition(local[axis], cuts), cuts)
