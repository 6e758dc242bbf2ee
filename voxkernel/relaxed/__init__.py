"""Half-spaces in, how much of the surface points do not face out, and the point that faces the most."""

from voxkernel.relaxed.best_center import best_center
from voxkernel.relaxed.star_center import StarCenter
from voxkernel.relaxed.violation import violation

__all__ = [
    "StarCenter",
    "best_center",
    "violation",
]
