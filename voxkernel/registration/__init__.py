"""Two surfaces in, the rigid motion between them out, with what was tried and whether to doubt it."""

from voxkernel.registration.joint_result import JointRegistration, JudgedPair
from voxkernel.registration.prepare import PreparedSurface, Rim, Samples, Skin
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
from voxkernel.registration.together import register_together

__all__ = [
    "Candidate",
    "JointRegistration",
    "JudgedPair",
    "PairRegistration",
    "PreparedSurface",
    "Registration",
    "Rim",
    "Samples",
    "Skin",
    "align_kernels",
    "frame_candidates",
    "prepare_surface",
    "refine_alignment",
    "register",
    "register_many",
    "register_together",
    "score_alignment",
]
