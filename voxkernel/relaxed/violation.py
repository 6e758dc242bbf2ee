"""How much of a surface points do not face: `violation`."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_points
from voxkernel.halfspaces.surface_arguments import SurfaceLike, surface_argument
from voxkernel.large import StreamedSurface
from voxkernel.large.stream_mesh import reader_of
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.streamed_violation import streamed_violation
from voxkernel.relaxed.violated_units import violated_units

__all__ = ["Weights", "violation"]

Weights = Literal["area", "count"] | ArrayLike


def violation(
    surface: SurfaceLike | StreamedSurface,
    points: ArrayLike,
    *,
    weights: Weights = "area",
    facets: Any = None,
    threads: int = 1,
) -> NDArray[np.float64]:
    """Compute the share of a surface that points do not face.

    The violation of x is the weight of the facets with `n . x > d`, over the weight of all. It is 0 exactly
    in the kernel.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces), HalfSpaces or StreamedSurface
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; half-spaces; or a surface of
        `stream_mesh`, which is read four times.
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
    if isinstance(surface, StreamedSurface):
        return streamed_violation(reader_of(surface, facets), xyz, weights, n_threads)
    found = surface_argument(surface, facets)
    units = violated_units(weigh(found.halfspaces, weights, mesh=found.mesh), xyz, threads=n_threads)
    return units / UNITS
