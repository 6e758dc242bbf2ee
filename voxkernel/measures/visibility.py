"""How much of a surface is really visible from a point: `visible_fraction`."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_points, as_positive
from voxkernel._core import faces_away
from voxkernel._notebook import InNotebooks
from voxkernel.halfspaces import HalfSpaces
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.mesh.triangles import doubled_areas, triple_products
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.violated_units import violated_units

__all__ = ["VisibleFraction", "visible_fraction"]

_CLOSE = 1e-4  # a hit this close before the sample is the surface itself
_SINGLE = 4e-6  # what single precision can tell apart along a ray


@dataclass(frozen=True, slots=True, repr=False)
class VisibleFraction(InNotebooks):
    """The share of a surface that is visible from a point.

    Attributes
    ----------
    fraction : float
        Share of the area that faces the point and is not hidden behind another part, in [0, 1].
    error : float
        Sampling error of `fraction` that is exceeded with a probability of at most 1 - `confidence`; 0
        where the answer is exact.
    violation : float
        Share of the area that does not face the point: hidden in any case.
    n_samples : int
        Rays cast; 0 where none were needed.
    confidence : float
        Of `error`.
    """

    fraction: float
    error: float
    violation: float
    n_samples: int
    confidence: float

    def __repr__(self) -> str:
        """Name the share and its error."""
        return f"VisibleFraction({self.fraction:.6g} +- {self.error:.2g}, violation={self.violation:.6g})"

    def __float__(self) -> float:
        """Give `fraction`."""
        return self.fraction

    @property
    def hidden(self) -> float:
        """Share of the area that is not seen; at least `violation`."""
        return 1.0 - self.fraction

    @property
    def bounds(self) -> tuple[float, float]:
        """`fraction` less and plus `error`, cut off at 0 and at what faces the point."""
        return max(0.0, self.fraction - self.error), min(1.0 - self.violation, self.fraction + self.error)

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain numbers, ready for JSON."""
        return {
            "fraction": self.fraction,
            "error": self.error,
            "violation": self.violation,
            "n_samples": self.n_samples,
            "confidence": self.confidence,
        }


def visible_fraction(
    surface: MeshLike,
    point: ArrayLike,
    *,
    n_samples: int = 100_000,
    confidence: float = 0.999,
    facets: Any = None,
    rng: int | np.random.Generator = 0,
) -> VisibleFraction:
    """Estimate the share of a surface's area that is visible from a point.

    A spot is visible when its facet faces the point, so that the point is on the inner side of the facet, and
    nothing lies between them.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes, facets counter-clockwise seen from outside.
    point : (3,) array_like
        World coordinates.
    n_samples : int
        Spots looked at, spread evenly over the area that faces the point.
    confidence : float
        Probability with which the stated error holds, in (0, 1).
    facets : int array or bool mask, optional
        Restrict the surface to these facets; the others do not hide anything.
    rng : int or numpy.random.Generator
        Seed or generator of the spots.

    Returns
    -------
    VisibleFraction
        Exactly 1 for a point of the kernel of a surface that bounds a volume once, without casting a ray.

    Raises
    ------
    ImportError
        If rays are needed and Open3D is not there.
    MeshError, MeshReadError, TypeError, ValueError
        If the surface, the point or a number cannot be used.

    Notes
    -----
    What does not face the point is counted exactly (`violation`), so the hidden area is never less. For the
    rest the facets are cut into strata of equal area with one random spot each; the error is Hoeffding's
    bound [1]_, which strata only make safer. Rays are traced in single precision about the point (Open3D,
    Embree): what hides a spot from closer than 1e-4 of the size of the surface does not count.
    Parts of an open surface can hide each other from a point of its kernel.

    References
    ----------
    .. [1] W. Hoeffding, "Probability inequalities for sums of bounded random variables", J. Amer. Statist.
       Assoc. 58, 1963, doi:10.1080/01621459.1963.10500830, Theorem 2.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> voxkernel.visible_fraction(tetrahedron, [0.1, 0.1, 0.1])
    VisibleFraction(1 +- 0, violation=0)
    """
    mesh = as_mesh(surface, facets=facets)
    place = as_points("point", np.reshape(np.asarray(point), (1, -1)))[0]
    count = as_depth("n_samples", n_samples, 1, 1 << 30)
    level = as_positive("confidence", confidence)
    if level >= 1.0:
        raise ValueError(f"`confidence` must be below 1; got {level:g}")
    halfspaces = HalfSpaces.from_mesh(mesh)
    missed = int(violated_units(weigh(halfspaces), place[None])[0]) / UNITS
    if missed == 0.0 and halfspaces.bounds_volume and _times_around(mesh, place) < 1.5:
        return VisibleFraction(1.0, 0.0, 0.0, 0, level)
    areas = _areas_facing(mesh, place)
    if not areas.any():
        return VisibleFraction(0.0, 0.0, missed, 0, level)
    seen = _share_seen(mesh, place, areas, count, np.random.default_rng(rng))
    error = (1.0 - missed) * sqrt(log(2.0 / (1.0 - level)) / (2.0 * count))
    return VisibleFraction((1.0 - missed) * seen, error, missed, count, level)


def _corners(mesh: TriangleMesh, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of the triangles seen from the point, (m, 3, 3), in units of the largest distance."""
    corners = mesh.vertices[mesh.faces] - point
    return corners / (float(np.sqrt((corners**2).sum(axis=2).max())) or 1.0)


def _times_around(mesh: TriangleMesh, point: NDArray[np.float64]) -> float:
    """Sum of the solid angles of the triangles over 4 pi: how often the surface goes around the point.

    A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30, 1983.
    """
    a, b, c = np.moveaxis(_corners(mesh, point), 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = triple_products(a, b, c)
    ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return float(np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum() / (2.0 * np.pi))


def _areas_facing(mesh: TriangleMesh, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas of the triangles, 0 for those that turn their back to the point."""
    corners = _corners(mesh, point)
    areas = 0.5 * doubled_areas(corners)
    areas[faces_away(mesh.vertices, mesh.faces, point)] = 0.0
    return areas


def _share_seen(
    mesh: TriangleMesh, point: NDArray[np.float64], areas: NDArray[np.float64], count: int, rng: np.random.Generator
) -> float:
    """Cast a ray to one random spot in each of `count` strata of equal area."""
    from voxkernel._open3d import open3d, ray_scene

    o3d = open3d()
    corners = _corners(mesh, point)
    scene = ray_scene(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
    ends = np.cumsum(areas)
    at = (np.arange(count) + rng.random(count)) * (ends[-1] / count)
    ids = np.minimum(np.searchsorted(ends, at, side="right"), np.flatnonzero(areas)[-1])
    u, v = rng.random((2, count))
    beyond = u + v > 1.0
    u[beyond], v[beyond] = 1.0 - u[beyond], 1.0 - v[beyond]
    a, b, c = np.moveaxis(corners[ids], 1, 0)
    spots = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    rays = np.zeros((count, 6), np.float32)
    rays[:, 3:] = spots
    hits = scene.cast_rays(o3d.core.Tensor(rays))
    # The direction is the spot itself, so the spot is at 1.
    extent = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    close = max(_SINGLE, _CLOSE * min(1.0, extent))
    seen = (hits["t_hit"].numpy() >= 1.0 - close) | (hits["primitive_ids"].numpy() == ids)
    return float(np.count_nonzero(seen)) / count
