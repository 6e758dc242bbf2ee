"""A star-shaped surface in, its radius on the sphere around the best centre out."""

from voxkernel.spherical.coverage import CoverageCertificate
from voxkernel.spherical.harmonics import Harmonics
from voxkernel.spherical.radial_grid import RadialGrid, ReconstructionError
from voxkernel.spherical.sphere_grids import SphereGrid
from voxkernel.spherical.spherical_map import SphericalMap, spherical_map

__all__ = [
    "CoverageCertificate",
    "Harmonics",
    "RadialGrid",
    "ReconstructionError",
    "SphereGrid",
    "SphericalMap",
    "spherical_map",
]
