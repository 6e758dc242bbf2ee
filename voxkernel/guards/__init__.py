"""A surface in, few points that see it out: what they provably see, star-shaped pieces, how many are needed."""

from voxkernel.guards.certificate import CertifiedParts
from voxkernel.guards.clock import GuardsProgress
from voxkernel.guards.guards import guards
from voxkernel.guards.result import GuardBound, Guards
from voxkernel.guards.star_cover import StarCover, StarPiece, star_cover

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
