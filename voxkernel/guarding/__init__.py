"""A surface in, few points that see it out: what they provably see, star-shaped pieces, how many are needed."""

from voxkernel.guarding.certificate import CertifiedParts
from voxkernel.guarding.clock import GuardsProgress
from voxkernel.guarding.guards import guards
from voxkernel.guarding.result import GuardBound, Guards
from voxkernel.guarding.star_cover import StarCover, StarPiece, star_cover

__all__ = [
    "CertifiedParts",
    "GuardBound",
    "Guards",
    "GuardsProgress",
    "StarCover",
    "StarPiece",
    "guards",
    "star_cover",
]
