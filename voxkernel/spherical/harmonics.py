"""Spherical harmonics of radial functions: coefficients, energies, and fits where a part is not seen.

Legendre functions and Fourier transforms are SciPy's. Measured beside it: ducc0 is as fast at these degrees but
brings 44 MB under the GPL, pyshtools is slower and brings astropy, pandas and xarray.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_points, read_only
from voxkernel._frozen import Frozen
from voxkernel.spherical.sphere_grids import GridKind, SphereGrid, sphere_grid

__all__ = ["MAX_DEGREE", "Harmonics", "fit_harmonics"]

MAX_DEGREE = 256
_MAX_ROUNDS = 1000
_RESIDUAL = 1e-9
_ROOT_TWO = 2.0**0.5


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Harmonics(Frozen):
    """A function on the sphere as a sum of real spherical harmonics up to a degree.

    The basis is orthonormal: the integral of Y^2 over the sphere is 1. Y_lm is the associated Legendre function
    times cos(m phi) for m > 0 and sin(|m| phi) for m < 0, without the phase (-1)^m, so that Y_11 grows with x.

    Attributes
    ----------
    coefficients : ((degree + 1)^2,) float64
        Coefficient of Y_lm at index l^2 + l + m, mesh units.
    degree : int
        Largest l.
    center : (3,) float64
        Where radii are measured from.
    covered : float
        Share of the sphere on which the function was known.
    regularisation : float
        Weight of the squared Laplacian in the fit; 0 for quadrature.
    n_rounds : int
        Conjugate gradient steps, at most 1000; 0 for quadrature.
    rms_residual : float
        Root mean square of what the fit leaves where the function was known, mesh units.
    """

    coefficients: NDArray[np.float64]
    degree: int
    center: NDArray[np.float64]
    covered: float
    regularisation: float
    n_rounds: int
    rms_residual: float

    def __repr__(self) -> str:
        """Name degree, coverage and residual."""
        return f"Harmonics(degree={self.degree}, covered={self.covered:.4g}, rms_residual={self.rms_residual:.4g})"

    @property
    def energies(self) -> NDArray[np.float64]:
        """Sum of squared coefficients of each degree, (degree + 1,); rotations leave it as it is.

        Their sum is the integral of the squared function (Parseval). The descriptor of Kazhdan, Funkhouser
        and Rusinkiewicz (2003) is the square root of each.
        """
        starts = np.arange(self.degree + 1) ** 2
        return np.add.reduceat(self.coefficients**2, starts)

    def evaluate(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Compute the function in any directions.

        Parameters
        ----------
        directions : (k, 3) array_like
            Vectors of any positive length.

        Returns
        -------
        (k,) float64
            Radii, mesh units; NaN for a vector of length 0.
        """
        xyz = as_points("directions", directions)
        waves = _colatitude_waves(self.coefficients, self.degree)
        k, m = np.arange(-self.degree, self.degree + 1), np.arange(self.degree + 1)
        values = np.full(len(xyz), np.nan)
        known = np.flatnonzero(xyz.any(axis=1))
        for chunk in np.array_split(known, max(1, len(known) // 4096)):
            x, y, z = xyz[chunk].T
            theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
            sums = np.exp(1j * np.outer(theta, k)) @ waves
            values[chunk] = np.einsum("pm,pm->p", sums, np.exp(1j * np.outer(phi, m))).real
        return values

    def on_grid(self, grid: GridKind = "equiangular", n: int = 128) -> NDArray[np.float64]:
        """Compute the function on a grid.

        Parameters
        ----------
        grid : {"equiangular", "gauss-legendre", "healpix"}
            As `SphericalMap.sample`.
        n : int
            Rings, more than the degree; for "healpix" n_side.

        Returns
        -------
        (n, 2 n) or (12 n^2,) float64
            Radii, mesh units.
        """
        made = sphere_grid(grid, n)
        _check_resolution(made, self.degree)
        return _synthesis(made, self.coefficients, self.degree).reshape(made.shape)


def fit_harmonics(
    grid: SphereGrid,
    values: NDArray[np.float64],
    degree: int,
    regularisation: float,
    center: NDArray[np.float64],
) -> Harmonics:
    """Find the coefficients of a function known at some or all points of a grid (NaN where it is not).

    Minimises the integral of the squared misfit over the known part plus `regularisation` times that of the
    squared Laplacian over the whole sphere; where all is known and the grid integrates squares of such
    functions exactly, this is the quadrature.
    """
    _check_resolution(grid, degree)
    flat = np.ascontiguousarray(values, dtype=np.float64).reshape(-1)
    known = np.isfinite(flat)
    if not known.any():
        raise ValueError("`radii` must be known in some direction; got none")
    weights = np.where(known, grid.weights, 0.0)
    flat = np.where(known, flat, 0.0)
    covered = float(weights.sum()) / (4.0 * np.pi)
    right = _adjoint(grid, weights * flat, degree)
    of_degree = np.repeat(np.arange(degree + 1), 2 * np.arange(degree + 1) + 1).astype(np.float64)
    stiffness = regularisation * (of_degree * (of_degree + 1.0)) ** 2
    if known.all() and degree <= grid.exact_degree:
        coefficients, n_rounds = right / (1.0 + stiffness), 0
    else:
        coefficients, n_rounds = _solve(grid, weights, right, stiffness, covered, degree)
    misfit = _synthesis(grid, coefficients, degree) - flat
    rms = float(np.sqrt((weights * misfit**2).sum() / weights.sum()))
    return Harmonics(read_only(coefficients), degree, center, min(1.0, covered), regularisation, n_rounds, rms)


def _solve(
    grid: SphereGrid,
    weights: NDArray[np.float64],
    right: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    covered: float,
    degree: int,
) -> tuple[NDArray[np.float64], int]:
    """Conjugate gradients on the normal equations, scaled by what the diagonal is on average."""
    scale = 1.0 / (covered + stiffness)
    c = np.zeros_like(right)
    rest = right.copy()
    z = scale * rest
    path, size = z.copy(), float(rest @ z)
    target = _RESIDUAL**2 * size
    for k in range(_MAX_ROUNDS):
        if size <= target:
            return c, k
        image = _adjoint(grid, weights * _synthesis(grid, path, degree), degree) + stiffness * path
        step = size / float(path @ image)
        c += step * path
        rest -= step * image
        z = scale * rest
        size, before = float(rest @ z), size
        path = z + (size / before) * path
    return c, _MAX_ROUNDS


def _check_resolution(grid: SphereGrid, degree: int) -> None:
    if degree > grid.max_degree:
        need = degree + 1 if grid.is_rectangular else (degree + 1) // 2
        raise ValueError(f"`n` must be at least {need} for degree {degree} on a {grid.kind} grid; got {grid.n}")


@lru_cache(maxsize=4)
def _legendre(kind: GridKind, n: int, degree: int) -> NDArray[np.float64]:
    """Normalised associated Legendre functions at the rings of a grid: [m, l, ring]."""
    return _legendre_at(sphere_grid(kind, n).theta, degree)


def _legendre_at(theta: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """SciPy's functions, without the phase (-1)^m; the southern half by symmetry."""
    from scipy.special import sph_legendre_p_all

    half = (len(theta) + 1) // 2
    north = sph_legendre_p_all(degree, degree, theta[:half])[0][:, : degree + 1].transpose(1, 0, 2)
    m, degrees = np.arange(degree + 1)[:, None], np.arange(degree + 1)[None, :]
    table = np.zeros((degree + 1, degree + 1, len(theta)))
    table[..., :half] = north * np.where(m % 2, -1.0, 1.0)[..., None]
    mirror = np.where((degrees + m) % 2, -1.0, 1.0)[..., None]
    table[..., half:] = (table * mirror)[..., : len(theta) - half][..., ::-1]
    return table


def _places(degree: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Degree and order of all 0 <= m <= l, and the index l^2 + l of the middle of each degree."""
    degrees, orders = np.tril_indices(degree + 1)
    return degrees, orders, degrees * degrees + degrees


def _packed(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """From [m, l, (cos, sin)] to l^2 + l + m."""
    degrees, orders, middle = _places(len(table) - 1)
    c = np.zeros(len(table) ** 2)
    c[middle - orders] = table[orders, degrees, 1]
    c[middle + orders] = table[orders, degrees, 0]
    return c


def _unpacked(c: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """From l^2 + l + m to [m, l, (cos, sin)]."""
    degrees, orders, middle = _places(degree)
    table = np.zeros((degree + 1, degree + 1, 2))
    table[orders, degrees, 0] = c[middle + orders]
    table[orders, degrees, 1] = c[middle - orders]
    table[0, :, 1] = 0.0
    return table


def _adjoint(grid: SphereGrid, values: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Sum of values times Y_lm over the grid."""
    sums = _ring_sums(grid, values, degree)
    parts = np.stack([sums.real, -sums.imag], axis=-1)
    parts[1:] *= _ROOT_TWO
    return _packed(np.matmul(_legendre(grid.kind, grid.n, degree), parts))


def _synthesis(grid: SphereGrid, c: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Value of the function at every point of the grid."""
    table = _unpacked(c, degree).transpose(0, 2, 1)
    parts = np.matmul(table, _legendre(grid.kind, grid.n, degree))
    waves = parts[:, 0] - 1j * parts[:, 1]
    waves[1:] *= _ROOT_TWO
    return _ring_values(grid, waves, degree)


def _ring_sums(grid: SphereGrid, values: NDArray[np.float64], degree: int) -> NDArray[np.complex128]:
    """Sum of values times exp(-i m phi) over each ring: [m, ring]."""
    m = np.arange(degree + 1)
    if grid.is_rectangular:
        from scipy.fft import rfft

        sums = np.asarray(rfft(values.reshape(grid.shape), axis=1))[:, : degree + 1]
        return np.ascontiguousarray((sums * np.exp(-1j * m * grid.phi_start[0])).T)
    result = np.empty((degree + 1, len(grid.theta)), np.complex128)
    for i, (low, high) in enumerate(zip(grid.ring_start[:-1], grid.ring_start[1:], strict=True)):
        result[:, i] = values[low:high] @ _turns(int(high - low), degree).conj()
    return result * np.exp(-1j * np.outer(m, grid.phi_start))


def _ring_values(grid: SphereGrid, waves: NDArray[np.complex128], degree: int) -> NDArray[np.float64]:
    """Real part of the sum of waves times exp(i m phi) at each point; `waves` is [m, ring]."""
    m = np.arange(degree + 1)
    if grid.is_rectangular:
        from scipy.fft import irfft

        n_phi = 2 * grid.n
        spectrum = np.zeros((len(grid.theta), grid.n + 1), np.complex128)
        spectrum[:, : degree + 1] = waves.T * np.exp(1j * m * grid.phi_start[0]) * (0.5 * n_phi)
        spectrum[:, 0] *= 2.0
        return np.asarray(irfft(spectrum, n=n_phi, axis=1)).reshape(-1)
    shifted = waves * np.exp(1j * np.outer(m, grid.phi_start))
    values = np.empty(len(grid))
    for i, (low, high) in enumerate(zip(grid.ring_start[:-1], grid.ring_start[1:], strict=True)):
        values[low:high] = (_turns(int(high - low), degree) @ shifted[:, i]).real
    return values


@lru_cache(maxsize=512)
def _turns(size: int, degree: int) -> NDArray[np.complex128]:
    """exp(2 pi i j m / size), [j, m]: rings shorter than 2 m + 1 fold high orders back, as they must."""
    return np.exp(2j * np.pi * (np.outer(np.arange(size), np.arange(degree + 1)) % size) / size)


def _colatitude_waves(c: NDArray[np.float64], degree: int) -> NDArray[np.complex128]:
    """Fourier coefficients in colatitude of each order m: f = Re sum of waves[k, m] exp(i (k theta + m phi)).

    A function of degree L is a trigonometric polynomial of degree L in theta once it is continued over the
    poles, so 2 L + 2 values fix it.
    """
    n = degree + 1
    table = _unpacked(c, degree).transpose(0, 2, 1)
    parts = np.matmul(table, _legendre("equiangular", n, degree))
    waves = parts[:, 0] - 1j * parts[:, 1]
    waves[1:] *= _ROOT_TWO
    sign = np.where(np.arange(n) % 2, -1.0, 1.0)[:, None]
    around = np.concatenate([waves, sign * waves[:, ::-1]], axis=1)
    k = np.fft.fftfreq(2 * n, 1.0 / (2 * n))
    spectrum = np.fft.fft(around, axis=1) / (2 * n) * np.exp(-1j * k * np.pi / (2 * n))
    order = np.arange(-degree, degree + 1) % (2 * n)
    return np.ascontiguousarray(spectrum[:, order].T)
