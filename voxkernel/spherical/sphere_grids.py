"""Grids of directions on the unit sphere, made of rings of equal colatitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_choice, as_depth, read_only
from voxkernel._frozen import Frozen

__all__ = ["GRIDS", "GridKind", "SphereGrid", "sphere_grid"]

GridKind = Literal["equiangular", "gauss-legendre", "healpix"]
GRIDS = ("equiangular", "gauss-legendre", "healpix")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SphereGrid(Frozen):
    """Directions in rings from north to south; inside a ring longitudes are equally spaced.

    Attributes
    ----------
    kind : {"equiangular", "gauss-legendre", "healpix"}
        Which rings.
    n : int
        Rings from pole to pole, each of 2 n directions; for "healpix" the number n_side, 12 n^2 directions.
    theta : (k,) float64
        Colatitude of each ring, radians.
    phi_start : (k,) float64
        Longitude of the first direction of each ring, radians.
    ring_start : (k + 1,) int64
        Ring i holds directions `ring_start[i]:ring_start[i + 1]`.
    ring_weights : (k,) float64
        Quadrature weight of one direction of each ring; all together 4 pi.
    """

    kind: GridKind
    n: int
    theta: NDArray[np.float64]
    phi_start: NDArray[np.float64]
    ring_start: NDArray[np.int64]
    ring_weights: NDArray[np.float64]

    def __len__(self) -> int:
        """Return the number of directions."""
        return int(self.ring_start[-1])

    def __repr__(self) -> str:
        """Name kind and size."""
        return f"SphereGrid({self.kind!r}, n={self.n}, {len(self)} directions)"

    @property
    def is_rectangular(self) -> bool:
        """Whether all rings have the same longitudes."""
        return self.kind != "healpix"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of values on the grid: (n, 2 n), or (12 n^2,) for "healpix"."""
        return (len(self.theta), 2 * self.n) if self.is_rectangular else (len(self),)

    @property
    def ring_sizes(self) -> NDArray[np.int64]:
        """Number of directions of each ring."""
        return np.diff(self.ring_start)

    @property
    def weights(self) -> NDArray[np.float64]:
        """Quadrature weight of each direction, steradian."""
        return np.repeat(self.ring_weights, self.ring_sizes)

    @property
    def max_degree(self) -> int:
        """Degree up to which the grid resolves spherical harmonics."""
        return self.n - 1 if self.is_rectangular else 2 * self.n

    @property
    def exact_degree(self) -> int:
        """Degree of harmonics whose products the weights integrate exactly, -1 where they do not."""
        return {"gauss-legendre": self.n - 1, "equiangular": (self.n - 1) // 2}.get(self.kind, -1)

    def angles(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Colatitude and longitude of each direction, radians."""
        sizes = self.ring_sizes
        place = np.arange(len(self)) - np.repeat(self.ring_start[:-1], sizes)
        phi = np.repeat(self.phi_start, sizes) + 2.0 * np.pi * place / np.repeat(sizes, sizes)
        return np.repeat(self.theta, sizes), phi

    def directions(self) -> NDArray[np.float64]:
        """Unit vectors, (len(self), 3), C-contiguous."""
        if not self.is_rectangular:
            theta, phi = self.angles()
            flat = np.sin(theta)
            return np.stack([flat * np.cos(phi), flat * np.sin(phi), np.cos(theta)], axis=1)
        phi = self.phi_start[0] + 2.0 * np.pi * np.arange(2 * self.n) / (2 * self.n)
        xyz = np.empty((len(self.theta), 2 * self.n, 3))
        flat = np.sin(self.theta)[:, None]
        xyz[..., 0], xyz[..., 1], xyz[..., 2] = flat * np.cos(phi), flat * np.sin(phi), np.cos(self.theta)[:, None]
        return xyz.reshape(-1, 3)


def sphere_grid(kind: GridKind, n: int) -> SphereGrid:
    """Make a grid of directions.

    Parameters
    ----------
    kind : {"equiangular", "gauss-legendre", "healpix"}
        "equiangular": the centres of n by 2 n cells in colatitude and longitude, with the weights of Fejér's
        first rule [1]_, exact for products of harmonics up to degree (n - 1) / 2. "gauss-legendre":
        colatitudes at the Gauss-Legendre nodes, exact for products up to degree n - 1. "healpix": centres of
        12 n^2 pixels of equal area in ring order [2]_.
    n : int
        Rings, 1 to 8192; for "healpix" n_side (any positive number: ring order does not need a power of two).

    Returns
    -------
    SphereGrid
        Arrays are read-only.

    Raises
    ------
    ValueError
        If `kind` or `n` is none of these.

    References
    ----------
    .. [1] L. Fejér, "Mechanische Quadraturen mit positiven Cotesschen Zahlen", Math. Z. 37, 1933.
    .. [2] K. M. Górski et al., "HEALPix", Astrophys. J. 622, 2005, equations 4 to 9.
    """
    as_choice("grid", kind, GRIDS)
    n = as_depth("n", n, 1, 8192)
    if kind == "healpix":
        theta, phi_start, sizes = _healpix_rings(n)
        ring_weights = np.full(len(theta), 4.0 * np.pi / (12 * n * n))
    else:
        theta, weights = _fejer(n) if kind == "equiangular" else _gauss_legendre(n)
        sizes = np.full(n, 2 * n)
        phi_start = np.full(n, np.pi / (2 * n) if kind == "equiangular" else 0.0)
        ring_weights = weights * np.pi / n
    start = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    return SphereGrid(kind, n, read_only(theta), read_only(phi_start), read_only(start), read_only(ring_weights))


def _fejer(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    theta = (np.arange(n) + 0.5) * np.pi / n
    k = np.arange(1, n // 2 + 1)
    return theta, 2.0 / n * (1.0 - 2.0 * (np.cos(2.0 * np.outer(theta, k)) / (4.0 * k * k - 1.0)).sum(axis=1))


def _gauss_legendre(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    from scipy.special import roots_legendre

    nodes, weights = roots_legendre(n)
    return np.arccos(nodes[::-1]), weights[::-1]


def _healpix_rings(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Colatitude, first longitude and size of the 4 n - 1 rings."""
    ring = np.arange(1, 4 * n)
    cap = np.minimum(ring, 4 * n - ring)  # counted from the nearer pole
    is_cap = cap < n
    z = np.where(is_cap, np.sign(2 * n - ring) * (1.0 - cap**2 / (3.0 * n * n)), 4.0 / 3.0 - 2.0 * ring / (3.0 * n))
    sizes = np.where(is_cap, 4 * cap, 4 * n)
    shifted = is_cap | ((ring - n) % 2 == 0)
    return np.arccos(z), np.where(shifted, np.pi / sizes, 0.0), sizes
