"""Two surfaces in, the rigid motion between them out, with what was tried and whether to doubt it."""

from voxkernel.registration.prepare import PreparedSurface, Samples
from voxkernel.registration.register import (
    align_kernels,
    frame_candidates,
    prepare_surface,
    refine_alignment,
    register,
    score_alignment,
)
from voxkernel.registration.register_many import PairRegistration, register_many
from voxkernel.registration.result import Candidate, Registration

__all__ = [
    "Candidate",
    "PairRegistration",
    "PreparedSurface",
    "Registration",
    "Samples",
    "align_kernels",
    "frame_candidates",
    "prepare_surface",
    "refine_alignment",
    "register",
    "register_many",
    "score_alignment",
]
