"""Surfaces and kernels in, numbers out: verdict, defect, visibility, moments, sample points."""

from voxkernel.measures.defect_profile import DefectProfile, defect_profile
from voxkernel.measures.moments import KernelMoments, kernel_moments
from voxkernel.measures.points import KernelPoints, kernel_points
from voxkernel.measures.starshapeness import Starshapeness, starshapeness
from voxkernel.measures.visibility import VisibleFraction, visible_fraction

__all__ = [
    "DefectProfile",
    "KernelMoments",
    "KernelPoints",
    "Starshapeness",
    "VisibleFraction",
    "defect_profile",
    "kernel_moments",
    "kernel_points",
    "starshapeness",
    "visible_fraction",
]
